//! `docs/deviations.md` and `docs/paper-open.md`: how the code reads the paper, collected from
//! `// Deviation:` and `// Open:` comments.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context as _, Result, bail};

use crate::{read, rust_files};

/// A page that is collected from comments.
struct Page {
    file: &'static str,
    mark: &'static str,
    opening: &'static str,
    /// The heading of the table, with a column for the line of code below the comment if `values`.
    heading: &'static str,
    values: bool,
}

const PAGES: [Page; 2] = [
    Page {
        file: "docs/deviations.md",
        mark: "// Deviation:",
        opening: "# Deviations from the paper

Every known point at which the code does not follow the text of the paper, by section. [What the
paper leaves open](paper-open.md) lists the values that the text does not state.

`cargo xtask bless` collects this page from the `// Deviation:` comments in the code; edit them
there.
",
        heading: "| the paper, the code, and why | where |\n|---|---|\n",
        values: false,
    },
    Page {
        file: "docs/paper-open.md",
        mark: "// Open:",
        opening: "# What the paper leaves open

Decisions that the text of the paper does not state, with the value chosen here, by section.
[Deviations](deviations.md) lists the points at which the code does not follow the text.

The paper's supplementary material and the curves of its figures were not available. Only the
claims of the text and Table I can be compared, as [the studies](study/README.md) do.

`cargo xtask bless` collects this page from the `// Open:` comments in the code. A value is the
line of code below its comment. The `config.json` next to a study's tables states all its
parameters, such as the camera, the length of the path and the number of cases.
",
        heading: "| decision and reason | value | where |\n|---|---|---|\n",
        values: true,
    },
];

/// The sections of the paper that marks may name.
const SECTIONS: [(&str, &str); 4] = [
    ("§III", "Background"),
    ("§IV", "Hybrid ICP"),
    ("§V", "Sequential pose estimation"),
    ("§VI", "Experiments"),
];

/// A mark in the code.
struct Mark {
    /// The first section that it names, such as `§III-A.1`.
    section: String,
    text: String,
    /// The line of code below it.
    code: String,
    file: String,
}

/// Writes the pages.
pub(crate) fn bless() -> Result<()> {
    for page in &PAGES {
        std::fs::write(page.file, page.document()?).context(page.file)?;
    }
    Ok(())
}

/// Returns a message for each page that is not what [`bless`] would write.
pub(crate) fn check() -> Result<Vec<String>> {
    let mut findings = Vec::new();
    for page in &PAGES {
        if read(page.file)? != page.document()? {
            let file = page.file;
            findings.push(format!(
                "{file} differs from the code: run `cargo xtask bless`"
            ));
        }
    }
    Ok(findings)
}

impl Page {
    fn document(&self) -> Result<String> {
        let mut marks = Vec::new();
        for file in rust_files(Path::new("crates")) {
            let name = file.display().to_string();
            marks.extend(marks_in(self.mark, &name, &read(&file)?)?);
        }
        // Sections sort like text, and marks of a section stay in the order of the files.
        marks.sort_by(|a: &Mark, b| a.section.cmp(&b.section));
        let mut document = self.opening.to_owned();
        for (section, title) in SECTIONS {
            let _ = write!(document, "\n## {section} {title}\n\n{}", self.heading);
            for mark in marks.iter().filter(|mark| mark.is_in(section)) {
                let (topic, text) = mark.text.split_once(": §").unwrap_or_default();
                let _ = match topic {
                    "" => write!(document, "| {} |", mark.text),
                    topic => write!(document, "| **{topic}**: §{text} |"),
                };
                if self.values {
                    let _ = write!(document, " {} |", value(&mark.code));
                }
                let _ = writeln!(document, " `{}` |", mark.file);
            }
        }
        Ok(document)
    }
}

impl Mark {
    fn is_in(&self, section: &str) -> bool {
        self.section.split(['-', '.']).next() == Some(section)
    }
}

/// Returns the marks of a file.
fn marks_in(mark: &str, file: &str, code: &str) -> Result<Vec<Mark>> {
    let mut found = Vec::new();
    let mut lines = (1..).zip(code.lines().map(str::trim)).peekable();
    while let Some((number, line)) = lines.next() {
        let Some(first) = line.strip_prefix(mark) else {
            continue;
        };
        let mut text = first.trim().to_owned();
        while let Some((_, more)) = lines.next_if(|(_, l)| l.starts_with("// ") && !is_mark(l)) {
            text.push(' ');
            text.push_str(&more[3..]);
        }
        let section = text.find('§').map(|start| {
            let named = text[start..].split([' ', ',', ':', ';', ')']);
            let named = named.map(|name| name.trim_end_matches('.'));
            named.take(1).collect::<String>()
        });
        let mark = Mark {
            section: section.unwrap_or_default(),
            text,
            code: lines.peek().map_or("", |(_, line)| line).to_owned(),
            file: file.to_owned(),
        };
        if !SECTIONS.iter().any(|(section, _)| mark.is_in(section)) {
            bail!("{file}:{number}: the mark names no section, expected one of §III to §VI");
        }
        found.push(mark);
    }
    Ok(found)
}

fn is_mark(line: &str) -> bool {
    PAGES.iter().any(|page| line.starts_with(page.mark))
}

/// Returns the value in a line of code, or a dash if it holds none.
fn value(code: &str) -> String {
    let code = code.trim_start_matches("pub ").trim_start_matches("let ");
    let code = code.trim_end_matches([',', ';']);
    if code.ends_with(['{', '[']) {
        return "–".to_owned();
    }
    let constant = code.strip_prefix("const ").and_then(|constant| {
        let (name, value) = constant.split_once(" = ")?;
        Some(format!("`{} = {value}`", name.split(':').next()?))
    });
    constant.unwrap_or_else(|| format!("`{code}`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points that the pages must name, whatever else they list.
    const DEVIATIONS: &[&str] = &[
        "stride of V_O",
        "V_O per stage",
        "stride of C",
        "pixels without normals leave C",
        "tolerance of rule 3",
        "divergence rules of the baselines",
        "floor of e_MVE",
        "U instead of I₆",
        "symmetric objects in fusing",
        "objects instead of ShapeNet",
        "object instead of camera poses",
        "noise-free model images",
        "axial-only D435 noise",
        "last increment",
        "no pairs",
        "direction of the path",
        "clock",
    ];
    const OPEN: &[&str] = &[
        "number of points of O",
        "τ_max and θ_max",
        "max_iter",
        "window of the normals",
        "convergence of the loss",
        "δ of occluded pixels",
        "near plane",
        "floor of e_MVE",
        "rejection sampling",
        "point in the proximity",
        "resolution of the objects",
        "voxels of reconstructions",
        "truncation of reconstructions",
        "time of an MVE",
        "length of the path",
        "camera",
    ];

    #[test]
    fn the_pages_equal_the_marks_and_name_every_point() {
        std::env::set_current_dir(crate::root()).unwrap();
        assert_eq!(check().unwrap(), Vec::<String>::new());
        for (page, points) in PAGES.iter().zip([DEVIATIONS, OPEN]) {
            let document = page.document().unwrap();
            for point in points {
                let row = document.lines().find(|line| {
                    let topic = line
                        .strip_prefix("| **")
                        .and_then(|row| row.split("**").next());
                    topic.is_some_and(|topic| topic.contains(point))
                });
                assert!(row.is_some(), "{} lacks \"{point}\"", page.file);
            }
        }
    }

    #[test]
    fn a_mark_ends_at_the_next_line_of_code() {
        let code = "// Open: limit: §IV-B.2. It is\n// small.\npub const LIMIT: f64 = 0.5;\n\
                    // Deviation: other: §V.\n// Open: last: (§VI-A.1) 3 mm.\n  width: 3e-3,\n";
        let marks = marks_in("// Open:", "a.rs", code).unwrap();
        let parts = |mark: &Mark| (mark.section.clone(), mark.text.clone(), value(&mark.code));
        let found: Vec<_> = marks.iter().map(parts).collect();
        let expected = [
            ("§IV-B.2", "limit: §IV-B.2. It is small.", "`LIMIT = 0.5`"),
            ("§VI-A.1", "last: (§VI-A.1) 3 mm.", "`width: 3e-3`"),
        ];
        assert_eq!(
            found,
            expected.map(|(a, b, c)| (a.into(), b.into(), c.into()))
        );
        assert!(marks[0].is_in("§IV") && !marks[0].is_in("§V"));
        assert_eq!(value("pub fn diameter() -> f64 {"), "–");
    }

    #[test]
    fn a_mark_without_a_section_is_an_error() {
        let error = marks_in("// Open:", "a.rs", "\n// Open: limit.\n")
            .err()
            .unwrap();
        assert!(error.to_string().starts_with("a.rs:2: "), "{error}");
    }
}

//! `docs/deviations.md`: where the code departs from the paper, collected from `// Deviation:` comments.

use std::fmt::Write as _;
use std::path::Path;

use crate::{Findings, relative, rust_files};

const FILE: &str = "docs/deviations.md";
const MARK: &str = "// Deviation:";

/// Writes the document.
pub(crate) fn bless(root: &Path) -> Findings {
    let file = root.join(FILE);
    file.parent()
        .map_or(Ok(()), std::fs::create_dir_all)
        .and_then(|()| std::fs::write(&file, document(root)))
        .map_err(|error| vec![format!("{FILE}: {error}")])
}

/// Checks that the document is what [`bless`] would write.
pub(crate) fn check(root: &Path) -> Vec<String> {
    let written = std::fs::read_to_string(root.join(FILE)).unwrap_or_default();
    if written == document(root) {
        Vec::new()
    } else {
        vec![format!(
            "{FILE} is not what the code says: run `cargo xtask bless`"
        )]
    }
}

fn document(root: &Path) -> String {
    let mut text = String::from(
        "# Deviations from the paper\n\n\
         Collected from the `// Deviation:` comments in the code by `cargo xtask bless`; edit them there.\n\n\
         | where | what and why |\n|---|---|\n",
    );
    for file in rust_files(&root.join("crates")) {
        let Ok(code) = std::fs::read_to_string(&file) else {
            continue;
        };
        let mut lines = code.lines().map(str::trim).peekable();
        while let Some(line) = lines.next() {
            let Some(first) = line.strip_prefix(MARK) else {
                continue;
            };
            let mut words = first.trim().to_owned();
            while let Some(more) = lines.peek().and_then(|l| l.strip_prefix("// ")) {
                words.push(' ');
                words.push_str(more.trim());
                lines.next();
            }
            let _ = writeln!(text, "| `{}` | {words} |", relative(root, &file));
        }
    }
    text
}

//! `cargo xtask tidy`: the rules that no other tool checks.

use std::path::Path;

use crate::{Findings, deviations, mutants, relative, rust_files};

/// Every crate and its level: dependencies within the workspace go strictly downwards.
const LAYERS: &[(&str, u32)] = &[
    ("hicp-core", 0),
    ("hicp-io", 1),
    ("hicp-raster", 1),
    ("hicp-association", 1),
    ("hicp-metric", 1),
    ("hicp-score", 1),
    ("hicp-fusion", 1),
    ("hicp-icp", 2),
    ("hicp-switch", 3),
    ("hybrid-icp", 4),
    ("hicp-sim", 4),
    ("hicp-testkit", 5),
    ("hicp-experiments", 5),
    ("hicp-bop", 5),
    ("hybrid-icp-cli", 6),
    ("hybrid-icp-python", 6),
];

/// Libraries that stay inside one crate.
const CONFINED: &[(&str, &str)] = &[
    ("glam", "hicp-raster"),
    ("kiddo", "hicp-association"),
    ("tobj", "hicp-io"),
];

/// What must not be left in the code. Split, so that this file does not hold them itself.
const LEFT_OPEN: &[(&str, &str)] = &[
    ("TO", "DO"),
    ("FIX", "ME"),
    ("todo", "!("),
    ("unimplemented", "!("),
    ("dbg", "!("),
];

/// The names of the crates, from the lowest level up.
pub(crate) fn crates() -> impl Iterator<Item = &'static str> {
    LAYERS.iter().map(|(name, _)| *name)
}

/// Runs every rule.
pub(crate) fn run(root: &Path) -> Findings {
    let mut findings = layers(root);
    findings.extend(crate_documentation(root));
    findings.extend(left_open(root));
    findings.extend(deviations::check(root));
    findings.extend(mutants::outdated_reasons(root));
    if findings.is_empty() {
        Ok(())
    } else {
        Err(findings)
    }
}

/// The layer table, and the libraries that stay inside one crate.
fn layers(root: &Path) -> Vec<String> {
    let mut findings = Vec::new();
    let level_of = |name: &str| {
        LAYERS
            .iter()
            .find(|(n, _)| *n == name)
            .map(|(_, level)| *level)
    };
    let mut found: Vec<String> = std::fs::read_dir(root.join("crates"))
        .map(|entries| {
            entries
                .flatten()
                .filter(|entry| entry.path().join("Cargo.toml").is_file())
                .map(|entry| entry.file_name().to_string_lossy().into_owned())
                .collect()
        })
        .unwrap_or_default();
    found.sort();
    for name in &found {
        let manifest = format!("crates/{name}/Cargo.toml");
        let Some(level) = level_of(name) else {
            findings.push(format!(
                "{manifest}: {name} is not in the layer table of xtask/src/tidy.rs"
            ));
            continue;
        };
        let text = std::fs::read_to_string(root.join(&manifest)).unwrap_or_default();
        if !text.contains(&format!("name = \"{name}\"")) {
            findings.push(format!(
                "{manifest}: the package is not named like its folder"
            ));
        }
        for dependency in dependencies(&text) {
            match level_of(&dependency) {
                Some(below) if below >= level => findings.push(format!(
                    "{manifest}: {name} (level {level}) depends on {dependency} (level {below}), expected a lower level"
                )),
                _ => {}
            }
            if let Some((_, home)) = CONFINED.iter().find(|(library, _)| *library == dependency)
                && home != name
            {
                findings.push(format!("{manifest}: {dependency} stays inside {home}"));
            }
        }
    }
    for (name, _) in LAYERS {
        if !found.iter().any(|f| f == name) {
            findings.push(format!("crates/{name} is in the layer table but not there"));
        }
    }
    findings
}

/// The names in a manifest's `[dependencies]`.
fn dependencies(manifest: &str) -> Vec<String> {
    manifest
        .lines()
        .skip_while(|line| line.trim() != "[dependencies]")
        .skip(1)
        .take_while(|line| !line.starts_with('['))
        .filter_map(|line| line.split(['.', '=', ' ']).next())
        .filter(|name| !name.is_empty() && !name.starts_with('#'))
        .map(str::to_owned)
        .collect()
}

/// Every library says what it is, whether to use it, shows an example, and lists its modules.
fn crate_documentation(root: &Path) -> Vec<String> {
    let mut findings = Vec::new();
    for (name, _) in LAYERS {
        let file = format!("crates/{name}/src/lib.rs");
        let Ok(text) = std::fs::read_to_string(root.join(&file)) else {
            continue;
        };
        for wanted in ["Should you use this crate?", "//! ```", "reading order"] {
            if !text.contains(wanted) {
                findings.push(format!(
                    "{file}: the crate's documentation lacks {wanted:?}"
                ));
            }
        }
    }
    findings
}

fn left_open(root: &Path) -> Vec<String> {
    let mut findings = Vec::new();
    for folder in ["crates", "benches", "tests", "xtask"] {
        for file in rust_files(&root.join(folder)) {
            let text = std::fs::read_to_string(&file).unwrap_or_default();
            for (number, line) in (1..).zip(text.lines()) {
                for (head, tail) in LEFT_OPEN {
                    let mark = format!("{head}{tail}");
                    if line.contains(&mark) {
                        findings.push(format!("{}:{number}: {mark}", relative(root, &file)));
                    }
                }
            }
        }
    }
    findings
}

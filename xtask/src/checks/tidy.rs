//! `cargo xtask tidy`: the rules that no other tool checks.

use std::path::Path;

use anyhow::{Context as _, Result, ensure};

use super::{cycles, marks, prose};
use crate::{read, rust_files};

/// Every crate and its level. Dependencies within the workspace point to a lower level.
const LAYERS: &[(&str, u32)] = &[
    ("hicp-core", 0),
    ("hicp-io", 1),
    ("hicp-raster", 1),
    ("hicp-association", 1),
    ("hicp-metric", 1),
    ("hicp-score", 1),
    ("hicp-fusion", 1),
    ("hicp-icp", 2),
    ("hicp-picture", 2),
    ("hicp-switch", 3),
    ("hicp-pipeline", 4),
    ("hicp-sim", 4),
    ("hybrid-icp", 5),
    ("hicp-testkit", 6),
    ("hicp-experiments", 6),
    ("hicp-bop", 6),
    ("hybrid-icp-cli", 7),
    ("hybrid-icp-python", 8),
];

/// Libraries that only one crate may depend on.
const CONFINED: &[(&str, &str)] = &[
    ("glam", "hicp-raster"),
    ("kiddo", "hicp-association"),
    ("tobj", "hicp-io"),
    ("toml", "hicp-pipeline"),
];

/// Marks of unfinished work, split so that this file does not contain them.
const LEFT_OPEN: &[(&str, &str)] = &[
    ("TO", "DO"),
    ("FIX", "ME"),
    ("todo", "!("),
    ("unimplemented", "!("),
    ("dbg", "!("),
];

/// The largest number of words of the README, with code and tables.
const README_WORDS: usize = 650;

/// Runs every rule.
pub(crate) fn run() -> Result<()> {
    let mut findings = Vec::new();
    for entry in std::fs::read_dir("crates").context("crates")? {
        let name = entry.context("crates")?.file_name();
        let name = name.to_string_lossy();
        layers(
            &name,
            &read(format!("crates/{name}/Cargo.toml"))?,
            &mut findings,
        );
        documentation(&name, &mut findings);
        findings.extend(cycles::find(&Path::new("crates").join(&*name).join("src"))?);
    }
    let words = read("README.md")?.split_whitespace().count();
    if words > README_WORDS {
        findings.push(format!(
            "README.md: {words} words, expected at most {README_WORDS}"
        ));
    }
    left_open(&mut findings)?;
    findings.extend(marks::check()?);
    findings.extend(prose::check()?);
    ensure!(findings.is_empty(), "{}", findings.join("\nxtask: "));
    Ok(())
}

/// Checks a manifest against the layer table and the confined libraries.
fn layers(name: &str, manifest: &str, findings: &mut Vec<String>) {
    let level = |name: &str| {
        LAYERS
            .iter()
            .find(|(n, _)| *n == name)
            .map(|(_, level)| *level)
    };
    let Some(own) = level(name) else {
        findings.push(format!(
            "crates/{name}: not in the layer table of xtask/src/checks/tidy.rs"
        ));
        return;
    };
    for dependency in dependencies(manifest) {
        if let Some(other) = level(dependency).filter(|other| *other >= own) {
            findings.push(format!(
                "crates/{name}: level {own} depends on {dependency} of level {other}, expected a lower level"
            ));
        }
        let home = CONFINED.iter().find(|(library, _)| *library == dependency);
        if let Some((_, home)) = home.filter(|(_, home)| *home != name) {
            findings.push(format!(
                "crates/{name}: only {home} may depend on {dependency}"
            ));
        }
    }
}

/// Returns the names in the `[dependencies]` of a manifest.
fn dependencies(manifest: &str) -> impl Iterator<Item = &str> {
    let lines = manifest
        .lines()
        .skip_while(|line| line.trim() != "[dependencies]");
    lines
        .skip(1)
        .take_while(|line| !line.starts_with('['))
        .filter_map(|line| line.split(['.', '=', ' ']).next())
        .filter(|name| !name.is_empty() && !name.starts_with('#'))
}

/// The files that each published crate needs, as links or of its own.
const FILES: [&str; 3] = ["LICENSE-APACHE", "LICENSE-MIT", "README.md"];

/// Checks that a crate has its files, and that the documentation of a library says whether to use
/// it and shows an example.
fn documentation(name: &str, findings: &mut Vec<String>) {
    let folder = Path::new("crates").join(name);
    let missing = FILES.iter().filter(|file| !folder.join(file).is_file());
    findings.extend(missing.map(|file| format!("crates/{name}: no {file}")));
    let file = format!("crates/{name}/src/lib.rs");
    let Ok(text) = read(&file) else { return };
    for part in ["Should you use this crate?", "//! ```"] {
        if !text.contains(part) {
            findings.push(format!("{file}: the crate's documentation lacks {part:?}"));
        }
    }
}

/// Searches all code for marks of unfinished work.
fn left_open(findings: &mut Vec<String>) -> Result<()> {
    for folder in ["crates", "benches", "tests", "xtask"] {
        for file in rust_files(Path::new(folder)) {
            for (number, line) in (1..).zip(read(&file)?.lines()) {
                let marks = LEFT_OPEN.iter().map(|(head, tail)| format!("{head}{tail}"));
                for mark in marks.filter(|mark| line.contains(mark)) {
                    findings.push(format!("{}:{number}: {mark}", file.display()));
                }
            }
        }
    }
    Ok(())
}

//! `cargo xtask deny`: licences, sources and duplicates of what is linked, held to the rules of `deny.toml`.
//!
//! cargo-deny is no part of CI, whose machine would have to build it; what it would say from the repository alone is read
//! here from `cargo tree` and `Cargo.lock`: licences and duplicates of what is built on this platform, sources of every
//! package. Where cargo-deny is installed, it runs as well and looks at every platform.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use crate::{Findings, process};

const FILE: &str = "deny.toml";

/// The rules, as far as this reads them.
#[derive(Debug, Default, PartialEq)]
struct Rules {
    licenses: BTreeSet<String>,
    registries: BTreeSet<String>,
    duplicates: BTreeSet<String>,
}

/// Runs the checks, and cargo-deny where it is.
pub(crate) fn run(root: &Path) -> Findings {
    let rules = rules(&read(root, FILE)?);
    if rules.licenses.is_empty() || rules.registries.is_empty() {
        return Err(vec![format!(
            "{FILE}: no `allow` under [licenses], or no `allow-registry` under [sources]"
        )]);
    }
    let tree = [
        "tree",
        "--workspace",
        "--locked",
        "--edges",
        "normal,build,dev",
        "--prefix",
        "none",
        "--no-dedupe",
        "--format",
        "{p}|{l}",
    ];
    let packages: BTreeMap<String, String> = process::cargo_output(root, &tree)?
        .lines()
        .filter_map(|line| line.split_once('|'))
        .map(|(package, license)| (package.to_owned(), license.to_owned()))
        .collect();
    let mut findings = licenses(&rules, &packages);
    findings.extend(duplicates(&rules, &packages));
    findings.extend(sources(&rules, &read(root, "Cargo.lock")?));
    if !findings.is_empty() {
        return Err(findings);
    }
    println!("xtask deny: {} packages pass", packages.len());
    if process::has_subcommand(root, "deny") {
        let arguments = ["deny", "check", "licenses", "bans", "sources"];
        return process::run(&mut process::cargo(root, &arguments));
    }
    println!(
        "xtask deny: cargo-deny is not installed (`cargo install cargo-deny --locked`): other platforms were not looked at"
    );
    Ok(())
}

fn read(root: &Path, file: &str) -> Result<String, Vec<String>> {
    std::fs::read_to_string(root.join(file)).map_err(|e| vec![format!("{file}: {e}")])
}

/// Reads lists of strings, and of tables with a `crate`, from the sections of the file.
fn rules(text: &str) -> Rules {
    let mut rules = Rules::default();
    let (mut section, mut key) = ("", "");
    for line in text.lines().map(str::trim).filter(|l| !l.starts_with('#')) {
        if line.starts_with('[') && line.ends_with(']') {
            (section, key) = (line, "");
            continue;
        }
        if let Some((name, _)) = line.split_once(" = [") {
            key = name;
        }
        let values = quoted(line);
        match (section, key) {
            ("[licenses]", "allow") => rules.licenses.extend(values),
            ("[sources]", "allow-registry") => rules.registries.extend(values),
            // Of a table, the name; the reason follows it.
            ("[bans]", "skip") => rules.duplicates.extend(values.into_iter().take(1)),
            _ => {}
        }
        if line.ends_with(']') {
            key = "";
        }
    }
    rules
}

/// The strings in double quotes of a line.
fn quoted(line: &str) -> Vec<String> {
    line.split('"')
        .skip(1)
        .step_by(2)
        .map(str::to_owned)
        .collect()
}

fn licenses(rules: &Rules, packages: &BTreeMap<String, String>) -> Vec<String> {
    packages
        .iter()
        .filter(|(_, license)| !allows(&rules.licenses, license))
        .map(|(package, license)| {
            format!("{package}: licence {license:?}, expected one that {FILE} allows")
        })
        .collect()
}

/// Returns whether an SPDX expression can be met with the allowed licences. AND binds tighter than OR; `/` is an old OR.
fn allows(allowed: &BTreeSet<String>, expression: &str) -> bool {
    let spaced = expression
        .replace('/', " OR ")
        .replace('(', " ( ")
        .replace(')', " ) ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let mut at = 0;
    let met = any(allowed, &words, &mut at);
    met && at == words.len()
}

fn any(allowed: &BTreeSet<String>, words: &[&str], at: &mut usize) -> bool {
    let mut met = all(allowed, words, at);
    while words.get(*at) == Some(&"OR") {
        *at += 1;
        met |= all(allowed, words, at);
    }
    met
}

fn all(allowed: &BTreeSet<String>, words: &[&str], at: &mut usize) -> bool {
    let mut met = one(allowed, words, at);
    while words.get(*at) == Some(&"AND") {
        *at += 1;
        met &= one(allowed, words, at);
    }
    met
}

fn one(allowed: &BTreeSet<String>, words: &[&str], at: &mut usize) -> bool {
    let Some(word) = words.get(*at) else {
        return false;
    };
    *at += 1;
    if *word == "(" {
        let met = any(allowed, words, at);
        let closed = words.get(*at) == Some(&")");
        *at += usize::from(closed);
        return met && closed;
    }
    if words.get(*at) == Some(&"WITH") {
        let with = format!("{word} WITH {}", words.get(*at + 1).unwrap_or(&""));
        *at += 2;
        return allowed.contains(&with);
    }
    allowed.contains(*word)
}

fn duplicates(rules: &Rules, packages: &BTreeMap<String, String>) -> Vec<String> {
    let mut versions: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for package in packages.keys() {
        let mut words = package.split_whitespace();
        if let (Some(name), Some(version)) = (words.next(), words.next()) {
            versions.entry(name).or_default().insert(version);
        }
    }
    versions
        .iter()
        .filter(|(name, versions)| versions.len() > 1 && !rules.duplicates.contains(**name))
        .map(|(name, versions)| {
            format!(
                "{name}: versions {versions:?}, expected one (or `skip` in {FILE} with the reason)"
            )
        })
        .collect()
}

/// Every package of the lock file is of the workspace (no source) or from an allowed registry.
fn sources(rules: &Rules, lock: &str) -> Vec<String> {
    let mut findings = BTreeSet::new();
    for line in lock.lines() {
        let Some(source) = line.strip_prefix("source = ") else {
            continue;
        };
        let source = source.trim_matches('"');
        let allowed = source
            .strip_prefix("registry+")
            .is_some_and(|registry| rules.registries.contains(registry));
        if !allowed {
            findings.insert(format!(
                "Cargo.lock: source {source}, expected one that {FILE} allows"
            ));
        }
    }
    findings.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(words: &[&str]) -> BTreeSet<String> {
        words.iter().map(|w| (*w).to_owned()).collect()
    }

    #[test]
    fn expressions_are_met_or_not() {
        let allowed = of(&["MIT", "Unicode-3.0"]);
        for met in [
            "MIT",
            "MIT OR GPL-3.0",
            "GPL-3.0/MIT",
            "(MIT OR Apache-2.0) AND Unicode-3.0",
            "Apache-2.0 WITH LLVM-exception OR MIT",
            "GPL-3.0 AND BSL-1.0 OR MIT",
        ] {
            assert!(allows(&allowed, met), "{met}");
        }
        for refused in [
            "",
            "GPL-3.0",
            "MIT AND GPL-3.0",
            "MIT WITH LLVM-exception",
            "(MIT OR GPL-3.0",
            "MIT GPL-3.0",
            "GPL-3.0 AND (MIT OR Unicode-3.0)",
        ] {
            assert!(!allows(&allowed, refused), "{refused}");
        }
    }

    #[test]
    fn rules_are_read_from_their_sections() {
        let text = "[licenses]\nallow = [\n \"MIT\",\n]\n[licenses.private]\nallow = [\"X\"]\n[bans]\nskip = [\n { crate = \"syn\", reason = \"a\" },\n]\n[sources]\nallow-registry = [\"r\"]\nallow-git = [\"g\"]\n";
        let expected = Rules {
            licenses: of(&["MIT"]),
            registries: of(&["r"]),
            duplicates: of(&["syn"]),
        };
        assert_eq!(rules(text), expected);
    }

    #[test]
    fn licences_sources_and_duplicates_are_found() {
        let rules = Rules {
            licenses: of(&["MIT"]),
            registries: of(&["r"]),
            duplicates: of(&["b"]),
        };
        let packages = [
            ("a v1", "MIT"),
            ("a v2", "GPL-3.0"),
            ("b v1", "MIT"),
            ("b v2", "MIT"),
        ];
        let packages = packages.map(|(p, l)| (p.to_owned(), l.to_owned())).into();
        assert_eq!(licenses(&rules, &packages).len(), 1);
        let found = duplicates(&rules, &packages);
        assert!(found.len() == 1 && found[0].starts_with("a: "), "{found:?}");
        let lock = "source = \"registry+r\"\nsource = \"registry+other\"\nsource = \"git+r\"\n";
        assert_eq!(sources(&rules, lock).len(), 2);
    }
}

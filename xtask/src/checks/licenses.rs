//! `cargo xtask licenses`: the licenses and sources of all dependencies on this platform, against
//! `deny.toml`.

use anyhow::{Context as _, Result, ensure};
use serde_json::Value;

use crate::process::{cargo, command, output};
use crate::read;

/// Runs the check.
pub(crate) fn run() -> Result<()> {
    let rules = read("deny.toml")?;
    let (licenses, registries) = (list(&rules, "allow")?, list(&rules, "allow-registry")?);
    let host = output(&mut command("rustc --print host-tuple"))?;
    let mut metadata = cargo("metadata --locked --format-version 1 --filter-platform");
    let metadata: Value = serde_json::from_str(&output(metadata.arg(host.trim()))?)?;
    let packages = metadata["packages"]
        .as_array()
        .context("cargo metadata: no packages")?;
    let mut findings = Vec::new();
    for package in packages {
        let name = format!("{} {}", package["name"], package["version"]);
        let license = package["license"].as_str().unwrap_or_default();
        if !allows(&licenses, license) {
            findings.push(format!("{name}: deny.toml does not allow {license:?}"));
        }
        // Packages of the workspace have no source.
        let source = package["source"].as_str().unwrap_or_default();
        let registry = source.strip_prefix("registry+").unwrap_or(source);
        if !source.is_empty() && !registries.contains(&registry) {
            findings.push(format!("{name}: deny.toml does not allow {source}"));
        }
    }
    ensure!(findings.is_empty(), "{}", findings.join("\nxtask: "));
    println!("xtask licenses: {} packages pass", packages.len());
    Ok(())
}

/// Returns the strings of a list in a TOML file.
fn list<'a>(text: &'a str, key: &str) -> Result<Vec<&'a str>> {
    let rest = text
        .split_once(&format!("\n{key} = ["))
        .map(|(_, rest)| rest);
    let list = rest
        .and_then(|rest| rest.split_once(']'))
        .map(|(list, _)| list);
    let list = list.with_context(|| format!("deny.toml: no list `{key}`"))?;
    Ok(list.split('"').skip(1).step_by(2).collect())
}

/// Returns whether the allowed licenses meet an SPDX expression. `/` is an old way to write OR.
fn allows(allowed: &[&str], expression: &str) -> bool {
    let one = |license: &str| license.trim() == "met" || allowed.contains(&license.trim());
    // AND binds tighter than OR.
    let flat = |text: &str| text.split(" OR ").any(|part| part.split(" AND ").all(one));
    let mut text = expression.replace('/', " OR ");
    while let Some(close) = text.find(')') {
        let Some(open) = text[..close].rfind('(') else {
            return false;
        };
        let word = if flat(&text[open + 1..close]) {
            "met"
        } else {
            "refused"
        };
        text.replace_range(open..=close, word);
    }
    flat(&text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expressions_are_met_or_refused() {
        let allowed = ["MIT", "Unicode-3.0"];
        for met in [
            "MIT",
            "MIT OR GPL-3.0",
            "GPL-3.0/MIT",
            "(MIT OR Apache-2.0) AND Unicode-3.0",
            "Apache-2.0 WITH LLVM-exception OR MIT",
            "GPL-3.0 AND BSL-1.0 OR MIT",
            "((GPL-3.0 OR MIT) AND Unicode-3.0)",
        ] {
            assert!(allows(&allowed, met), "{met}");
        }
        for refused in [
            "",
            "GPL-3.0",
            "MIT AND GPL-3.0",
            "MIT WITH LLVM-exception",
            "(MIT OR GPL-3.0",
            "MIT OR GPL-3.0)",
            "MIT GPL-3.0",
            "GPL-3.0 AND (MIT OR Unicode-3.0)",
        ] {
            assert!(!allows(&allowed, refused), "{refused}");
        }
    }

    #[test]
    fn lists_are_read_by_their_key() {
        let text = "[licenses]\nallow = [\n \"MIT\",\n]\n[sources]\nallow-registry = [\"r\"]\n";
        assert_eq!(list(text, "allow").unwrap(), ["MIT"]);
        assert_eq!(list(text, "allow-registry").unwrap(), ["r"]);
        assert!(list(text, "allow-git").is_err());
    }
}

//! `cargo xtask mutants`: changes to the numerical crates that no test notices, by cargo-mutants.

use std::path::Path;

use crate::{Findings, process};

/// The crates that `.cargo/mutants.toml` looks at.
const CRATES: [&str; 4] = ["hicp-core", "hicp-metric", "hicp-score", "hicp-fusion"];

/// Runs `cargo xtask mutants [CRATE [K/N]]`: all of them, those of a crate, or every N-th of a crate from the K-th on.
pub(crate) fn run(root: &Path, arguments: &[&str]) -> Findings {
    let (crates, shard) = match *arguments {
        [] => (CRATES.to_vec(), None),
        [name] if CRATES.contains(&name) => (vec![name], None),
        [name, shard] if CRATES.contains(&name) => (vec![name], Some(shard)),
        _ => {
            return Err(vec![format!(
                "mutants: cannot read {arguments:?}, expected one of {} and, if wanted, a share like 0/40",
                CRATES.join(", ")
            )]);
        }
    };
    if !process::has_subcommand(root, "mutants") {
        return Err(vec![
            "mutants: cargo-mutants is not installed: `cargo install cargo-mutants --version 27.1.0 --locked`".to_owned(),
        ]);
    }
    let mut findings = Vec::new();
    for name in crates {
        let mut command = process::cargo(root, &["mutants"]);
        let output = process::target(root).join("mutants").join(name);
        command
            .args(["mutants", "--package", name, "--output"])
            .arg(output);
        if let Some(shard) = shard {
            command.args(["--shard", shard, "--sharding", "round-robin"]);
        }
        // Each crate is held to its own tests. Two means that mutants were missed; they are on the terminal.
        if let Err(found) = process::run(&mut command) {
            findings.extend(found);
        }
    }
    if findings.is_empty() {
        Ok(())
    } else {
        Err(findings)
    }
}

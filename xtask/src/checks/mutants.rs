//! `cargo xtask mutants`: cargo-mutants on changed lines.

use anyhow::Result;

use crate::process::{cargo, command, execute, output, require, target};

/// Tries the mutants of the lines that differ from a commit; options go to cargo-mutants.
pub(crate) fn run(base: &str, options: &[&str]) -> Result<()> {
    require(
        cargo("mutants --version"),
        "cargo install cargo-mutants --version 27.1.0 --locked",
    )?;
    let diff = target().join("mutants.diff");
    std::fs::write(&diff, output(command("git diff").arg(base))?)?;
    let mut mutants = cargo("mutants");
    execute(
        mutants
            .arg("--output")
            .arg(target())
            .arg("--in-diff")
            .arg(&diff)
            .args(options),
    )
}

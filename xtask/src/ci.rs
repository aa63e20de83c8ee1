//! `cargo xtask ci`.
//!
//! `.ci/run` runs the README's `cargo test` first and sets `HICP_TESTED`. Then those tests are not
//! run again; the tests of `xtask`, which `cargo test` leaves out, are.

use std::time::Instant;

use anyhow::{Context as _, Result, ensure};

use crate::checks::{licenses, tidy, valgrind};
use crate::measure::bench::BENCHES;
use crate::measure::{counts, instructions};
use crate::pages::book;
use crate::process::{cargo, execute};
use crate::{python, read};

/// Runs every check and stops at the first that fails.
pub(crate) fn run() -> Result<()> {
    step("formatting", || execute(&mut cargo("fmt --all --check")))?;
    step("clippy", || {
        let lint = "clippy --workspace --all-targets --quiet -- -D warnings";
        execute(&mut cargo(lint))
    })?;
    step("tidy", tidy::run)?;
    step("licenses", licenses::run)?;
    step("book, without dead links", book::check)?;
    if std::env::var_os("HICP_TESTED").is_none() {
        step("tests", || execute(&mut cargo("test")))?;
    }
    step("tests of xtask", || {
        execute(&mut cargo("test --package xtask"))
    })?;
    step("documentation", || {
        let mut doc = cargo("doc --workspace --no-deps --quiet");
        execute(doc.env("RUSTDOCFLAGS", "-D warnings"))
    })?;
    step("benches, each run once", || {
        execute(&mut cargo(&format!("test {BENCHES} --quiet")))
    })?;
    step("work counts", counts::check)?;
    step("instruction counts", instructions::run)?;
    step("vectorized loops under memcheck", valgrind::run)?;
    step("association without the k-d tree", || {
        execute(&mut cargo(
            "check --package hicp-association --no-default-features --quiet",
        ))
    })?;
    step("Python module, with Ray and Open3D", python::check_all)?;
    for example in examples()? {
        step(&format!("example {example}"), || {
            execute(cargo("run --quiet --example").arg(&example))
        })?;
    }
    for command in readme_commands()?
        .iter()
        .filter(|command| *command != "cargo test")
    {
        let words = command
            .strip_prefix("cargo ")
            .context("README.md: expected cargo commands")?;
        // The result of the command is checked, not its speed: the tests have built the program.
        let words = words.replace(" --release", "");
        step(command, || execute(&mut cargo(&words)))?;
    }
    Ok(())
}

/// Returns the names of the façade's numbered examples. Each fails if its result is wrong.
fn examples() -> Result<Vec<String>> {
    let folder = "crates/hybrid-icp/examples";
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).context(folder)? {
        let name = entry.context(folder)?.file_name();
        names.extend(
            name.to_string_lossy()
                .strip_suffix(".rs")
                .map(str::to_owned),
        );
    }
    names.sort();
    Ok(names)
}

/// Returns the two commands of the README's first `sh` block.
fn readme_commands() -> Result<Vec<String>> {
    let text = read("README.md")?;
    let block = text
        .split_once("```sh\n")
        .and_then(|(_, rest)| rest.split_once("```"));
    let (block, _) = block.context("README.md: no `sh` block")?;
    let lines = block
        .lines()
        .map(|line| line.split(" #").next().unwrap_or(line).trim());
    let commands: Vec<_> = lines
        .filter(|line| !line.is_empty())
        .map(str::to_owned)
        .collect();
    ensure!(
        commands.len() == 2,
        "README.md: expected two commands, found {commands:?}"
    );
    Ok(commands)
}

fn step(what: &str, check: impl FnOnce() -> Result<()>) -> Result<()> {
    println!("xtask ci: {what}");
    let start = Instant::now();
    let result = check();
    println!("xtask ci: {what}: {:.0} s", start.elapsed().as_secs_f64());
    result
}

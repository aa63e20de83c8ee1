//! `cargo xtask ci`.
//!
//! Where `HICP_TESTED` is set, as `.ci/run` does after the README's `cargo test`, the tests that have passed a moment before are not
//! run a second time: four minutes of the whole. Those of `xtask` and `xtask/mutation`, which are no part of `cargo test`, are.

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use crate::{Findings, api, counts, deny, instructions, python, tidy, valgrind};

/// Runs every check and stops at the first that fails.
pub(crate) fn run(root: &Path) -> Findings {
    let deny_warnings = [("RUSTDOCFLAGS", "-D warnings")];
    let none: [(&str, &str); 0] = [];
    cargo(root, "formatting", &["fmt", "--all", "--check"], &none)?;
    cargo(
        root,
        "clippy",
        &[
            "clippy",
            "--workspace",
            "--all-targets",
            "--quiet",
            "--",
            "-D",
            "warnings",
        ],
        &none,
    )?;
    step("tidy", || tidy::run(root))?;
    step("public functions", || api::run(root))?;
    step("licences and sources", || deny::run(root))?;
    // Without the module for Python, which has tests of its own below: the features that its dependencies turn on would build
    // everything a second time.
    if std::env::var_os("HICP_TESTED").is_some() {
        println!(
            "xtask ci: tests: passed before, as HICP_TESTED says; those of the tools are left"
        );
        let tools = ["test", "--package", "xtask", "--package", "mutation"];
        cargo(root, "tests of the tools", &tools, &none)?;
    } else {
        cargo(
            root,
            "tests",
            &["test", "--workspace", "--exclude", "hybrid-icp-python"],
            &none,
        )?;
    }
    cargo(
        root,
        "documentation",
        &["doc", "--workspace", "--no-deps", "--quiet"],
        &deny_warnings,
    )?;
    cargo(
        root,
        "benches, each run once",
        &["test", "--package", "hicp-benches", "--benches", "--quiet"],
        &none,
    )?;
    step("work counts", || counts::check(root))?;
    step("instruction counts", || instructions::check(root))?;
    step("vectorised loops under memcheck", || valgrind::run(root))?;
    cargo(
        root,
        "association without the k-d tree",
        &[
            "check",
            "--package",
            "hicp-association",
            "--no-default-features",
            "--quiet",
        ],
        &none,
    )?;
    step("Python module, with Ray and Open3D", || {
        python::check_all(root)
    })?;
    examples(root)?;
    readme(root)
}

/// Runs the façade's numbered examples; each fails unless it does what it says.
fn examples(root: &Path) -> Findings {
    let folder = "crates/hybrid-icp/examples";
    let entries =
        std::fs::read_dir(root.join(folder)).map_err(|error| vec![format!("{folder}: {error}")])?;
    let mut names: Vec<String> = entries
        .flatten()
        .filter_map(|entry| {
            let name = entry.file_name().into_string().ok()?;
            Some(name.strip_suffix(".rs")?.to_owned())
        })
        .collect();
    names.sort();
    let none: [(&str, &str); 0] = [];
    for name in names {
        cargo(
            root,
            &format!("example {name}"),
            &[
                "run",
                "--quiet",
                "--package",
                "hybrid-icp",
                "--example",
                &name,
            ],
            &none,
        )?;
    }
    Ok(())
}

/// Runs the commands of the README's first block, but for the tests, which have run.
fn readme(root: &Path) -> Findings {
    let commands = readme_commands(root)?;
    if commands.len() != 2 {
        return Err(vec![format!(
            "README.md: the first ```sh block holds {} commands, expected two",
            commands.len()
        )]);
    }
    for command in commands.iter().filter(|c| !c.starts_with("cargo test")) {
        let words: Vec<&str> = command.split_whitespace().skip(1).collect();
        if !command.starts_with("cargo ") {
            return Err(vec![format!(
                "README.md: cannot run {command:?}, expected a cargo command"
            )]);
        }
        let none: [(&str, &str); 0] = [];
        cargo(root, command, &words, &none)?;
    }
    Ok(())
}

/// The lines of the README's first ```sh block, without comments.
fn readme_commands(root: &Path) -> Result<Vec<String>, Vec<String>> {
    let text = std::fs::read_to_string(root.join("README.md"))
        .map_err(|error| vec![format!("README.md: {error}")])?;
    Ok(text
        .lines()
        .skip_while(|line| line.trim() != "```sh")
        .skip(1)
        .take_while(|line| line.trim() != "```")
        .map(|line| line.split(" #").next().unwrap_or(line).trim().to_owned())
        .filter(|line| !line.is_empty())
        .collect())
}

fn cargo(root: &Path, what: &str, arguments: &[&str], environment: &[(&str, &str)]) -> Findings {
    step(what, || {
        let program = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
        let status = Command::new(program)
            .args(arguments)
            .envs(environment.iter().copied())
            .current_dir(root)
            .status();
        match status {
            Ok(status) if status.success() => Ok(()),
            Ok(status) => Err(vec![format!("`cargo {}`: {status}", arguments.join(" "))]),
            Err(error) => Err(vec![format!("`cargo {}`: {error}", arguments.join(" "))]),
        }
    })
}

fn step(what: &str, check: impl FnOnce() -> Findings) -> Findings {
    println!("xtask ci: {what}");
    let start = Instant::now();
    let result = check();
    println!("xtask ci: {what}: {:.0} s", start.elapsed().as_secs_f64());
    result
}

//! `cargo xtask peers`: other libraries and this one on the same arrays.

use std::path::Path;
use std::process::Command;

use crate::{Findings, process, venv};

/// The programs of ours that the script runs.
const PROGRAMS: [&str; 2] = ["peers", "bop_frame"];

/// Builds our programs, sets up the script's virtual environment below `target/`, and runs it; options are passed on.
///
/// The table goes to the terminal and to `target/peers/peers.md`.
pub(crate) fn run(root: &Path, options: &[&str]) -> Findings {
    let mut build = process::cargo(root, &["build", "--release", "--package", "hicp-benches"]);
    for program in PROGRAMS {
        build.args(["--example", program]);
    }
    process::run(&mut build)?;
    process::run(&mut process::cargo(
        root,
        &["build", "--release", "--package", "hybrid-icp-cli"],
    ))?;

    let target = process::target(root);
    let venv = target.join("peers/venv");
    let python = venv::environment(root, &venv, &["benches/peers/requirements.txt"])?;
    let mut script = Command::new(python);
    script
        .arg(root.join("benches/peers/peers.py"))
        .arg("--target")
        .arg(&target)
        .args(options)
        .current_dir(root);
    process::run(&mut script)
}

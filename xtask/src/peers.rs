//! `cargo xtask peers`: other libraries and this one on the same arrays.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::{Findings, process};

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
    let python = environment(root, &target.join("peers/venv"))?;
    let mut script = Command::new(python);
    script
        .arg(root.join("benches/peers/peers.py"))
        .arg("--target")
        .arg(&target)
        .args(options)
        .current_dir(root);
    process::run(&mut script)
}

/// Makes the virtual environment, once per content of the requirements file, and returns its Python.
fn environment(root: &Path, venv: &Path) -> Result<PathBuf, Vec<String>> {
    let requirements = root.join("benches/peers/requirements.txt");
    let wanted = std::fs::read_to_string(&requirements)
        .map_err(|e| vec![format!("benches/peers/requirements.txt: {e}")])?;
    let python = venv.join("bin/python");
    let installed = venv.join("requirements.installed");
    if std::fs::read_to_string(&installed).is_ok_and(|found| found == wanted) {
        return Ok(python);
    }
    process::run(Command::new("python3").args(["-m", "venv"]).arg(venv))?;
    process::run(
        Command::new(&python)
            .args(["-m", "pip", "install", "--quiet", "--requirement"])
            .arg(&requirements),
    )?;
    std::fs::write(&installed, wanted)
        .map_err(|e| vec![format!("{}: {e}", installed.display())])?;
    Ok(python)
}

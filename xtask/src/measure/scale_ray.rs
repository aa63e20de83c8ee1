//! `cargo xtask scale --ray`: the rows of `cargo xtask scale` on Ray workers of this machine.

use std::process::Command;

use anyhow::Result;

use super::scale::Scale;
use crate::process::execute;
use crate::{python, root};

/// Runs the script that compares Ray with the `seconds` and the output of `bop refine` on as many
/// threads.
pub(crate) fn run(scale: &Scale, seconds: f64) -> Result<()> {
    let python = python::with_module(&["--ray"], "release")?;
    let mut script = Command::new(python);
    script.arg(root().join(python::PACKAGE).join("benches/ray_scale.py"));
    script.args(["data", "data/initial_synthetic-test.csv", "whole.csv"]);
    for (option, value) in [
        ("--rows", scale.rows.to_string()),
        ("--workers", scale.threads.to_string()),
        ("--seconds", seconds.to_string()),
    ] {
        script.args([option, &value]);
    }
    execute(script.current_dir(&scale.folder))
}

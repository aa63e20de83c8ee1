//! `cargo xtask scale --ray`: the rows of `cargo xtask scale` on Ray workers of this machine.

use std::path::Path;
use std::process::Command;

use crate::scale::Scale;
use crate::{Findings, process, python};

/// Runs the script that compares Ray with `seconds` of `bop refine` on as many threads, and its bytes with those that this left.
pub(crate) fn run(root: &Path, scale: &Scale, seconds: f64) -> Findings {
    let python = python::with_module(root, &["--ray"], "release")?;
    process::run(
        Command::new(python)
            .arg(root.join(python::PACKAGE).join("benches/ray_scale.py"))
            .args(["data", "data/initial_synthetic-test.csv", "whole.csv"])
            .args(["--rows", &scale.rows.to_string()])
            .args(["--workers", &scale.threads.to_string()])
            .args(["--seconds", &seconds.to_string()])
            .current_dir(&scale.folder),
    )
}

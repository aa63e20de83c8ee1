//! `cargo xtask peers`: other libraries and this one on the same arrays.

use std::process::Command;

use anyhow::Result;

use crate::process::{cargo, execute, target};
use crate::venv;

/// Builds our programs and runs the script in its own virtual environment; options go to the
/// script.
///
/// The table goes to the terminal and to `target/peers/peers.md`.
pub(crate) fn run(options: &[&str]) -> Result<()> {
    execute(&mut cargo(
        "build --release --package hicp-benches --example peers --example peer_clouds",
    ))?;
    execute(&mut cargo("build --release --bin hybrid-icp"))?;
    let venv = target().join("peers/venv");
    let python = venv::environment(&venv, &["benches/peers/requirements.txt".to_owned()])?;
    let mut script = Command::new(python);
    execute(
        script
            .args(["benches/peers/peers.py", "--target"])
            .arg(target())
            .args(options),
    )
}

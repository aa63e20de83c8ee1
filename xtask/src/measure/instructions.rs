//! `cargo xtask instructions`: instruction counts of every step. The limits are in
//! `benches/benches/instructions.rs`.

use anyhow::Result;

use crate::process::{cargo, command, execute, output, succeeds};

/// The compiler that the limits were measured with; others compile to other counts.
const COMPILER: &str = "rustc 1.95.0 ";
/// The version of gungraun in `benches/Cargo.toml`; the runner must have the same.
const RUNNER: &str = "0.20.0";

/// Counts and compares. Skips with a message if the tools are missing.
pub(crate) fn run() -> Result<()> {
    let runner = output(&mut command("gungraun-runner --version")).unwrap_or_default();
    if !succeeds(command("valgrind --quiet true")) || !runner.contains(RUNNER) {
        println!(
            "xtask instructions: SKIPPED: needs valgrind and `cargo install gungraun-runner --version ={RUNNER}`"
        );
        return Ok(());
    }
    let mut bench =
        cargo("bench --quiet --features hicp-benches/instructions --bench instructions");
    if !output(&mut command("rustc --version"))?.starts_with(COMPILER) {
        println!("xtask instructions: NOT COMPARED with the limits, which are for {COMPILER}");
        bench.env("GUNGRAUN_CALLGRIND_LIMITS", "ir=1000%");
    }
    execute(bench.args(["--", "--callgrind-metrics=ir"]))
}

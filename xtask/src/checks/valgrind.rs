//! `cargo xtask valgrind`: tests that run every vectorized loop, under memcheck.
//!
//! The libraries contain no unsafe code; their dependencies do, most of all pulp's dispatch to
//! AVX2.

use anyhow::{Context as _, Result};
use serde_json::Value;

use crate::process::{cargo, command, execute, output, succeeds};

/// The package and the filter of the tests: the vector loops against their baseline, and whole
/// refinements of the fuzz seeds.
const TESTS: [(&str, &str); 2] = [
    ("crates/hicp-core/src/lib.rs", "vectorized"),
    ("tests/tests/it/main.rs", "every_target_passes_on_its_seeds"),
];

/// Runs the tests. Skips with a message if valgrind is missing or does not support the C library.
pub(crate) fn run() -> Result<()> {
    if !succeeds(command("valgrind --quiet true")) {
        println!("xtask valgrind: SKIPPED: `valgrind true` fails on this machine");
        return Ok(());
    }
    // All tests, because the features of a single package would build its dependencies again.
    let messages = output(&mut cargo("test --no-run --message-format json"))?;
    let messages = messages.lines().map(serde_json::from_str);
    let messages: Vec<Value> = messages.collect::<Result<_, _>>()?;
    for (source, filter) in TESTS {
        let path = crate::root().join(source);
        let program = messages.iter().find_map(|message| {
            let is_source = message["target"]["src_path"].as_str() == path.to_str();
            let is_test = message["profile"]["test"].as_bool() == Some(true);
            message["executable"]
                .as_str()
                .filter(|_| is_source && is_test)
        });
        let program =
            program.with_context(|| format!("valgrind: cargo built no test of {source}"))?;
        let mut valgrind = command("valgrind --quiet --error-exitcode=99 --leak-check=no");
        execute(valgrind.args([program, filter, "--test-threads=1"]))?;
    }
    Ok(())
}

//! `cargo xtask miri`: unit tests of the crates without vector loops under miri, where the toolchain has it.

use std::path::Path;

use crate::{Findings, process};

/// Miri interprets; these have unit tests that end in minutes. It knows no AVX2, so vector loops run as compiled for the baseline.
const CRATES: [&str; 3] = ["hicp-core", "hicp-fusion", "hicp-metric"];

/// Runs miri, or says what is missing.
pub(crate) fn run(root: &Path) -> Findings {
    if !process::has_subcommand(root, "miri") {
        return Err(vec![
            "miri: the toolchain has no miri, which stable ones never have: `rustup toolchain install nightly --component miri,rust-src`, then `cargo +nightly xtask miri`".to_owned(),
            "miri: on stable, `cargo xtask valgrind` looks at the same loops".to_owned(),
        ]);
    }
    let mut arguments = vec!["miri", "test", "--lib"];
    for name in CRATES {
        arguments.extend(["--package", name]);
    }
    // Tests look at the clock and at files.
    process::run(process::cargo(root, &arguments).env("MIRIFLAGS", "-Zmiri-disable-isolation"))
}

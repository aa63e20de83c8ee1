//! `cargo xtask miri`: unit tests under miri, if the toolchain has it.

use anyhow::Result;

use crate::process::{cargo, execute, require};

/// Runs the tests of the crates whose unit tests end in minutes when interpreted.
pub(crate) fn run() -> Result<()> {
    require(
        cargo("miri --version"),
        "rustup toolchain install nightly --component miri,rust-src`, then run `cargo +nightly xtask miri",
    )?;
    let mut miri =
        cargo("miri test --lib --package hicp-core --package hicp-fusion --package hicp-metric");
    // Tests read the clock and files.
    execute(miri.env("MIRIFLAGS", "-Zmiri-disable-isolation"))
}

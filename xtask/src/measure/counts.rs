//! `cargo xtask counts`: the work of every preset on a fixed set of scenes, against a blessed file.

use anyhow::{Context as _, Result, bail};

use crate::process::{cargo, output};
use crate::read;

const FILE: &str = "benches/counts.txt";

/// Counts again and compares with the file.
pub(crate) fn check() -> Result<()> {
    let (blessed, counted) = (read(FILE)?, count()?);
    let (mut before, mut after) = (blessed.lines(), counted.lines());
    let header = after.clone().next().unwrap_or_default().to_owned();
    let mut differences = Vec::new();
    loop {
        match (before.next(), after.next()) {
            (None, None) => break,
            (before, after) if before == after => {}
            (before, after) => {
                differences.extend(before.map(|line| format!("- {line}")));
                differences.extend(after.map(|line| format!("+ {line}")));
            }
        }
    }
    if differences.is_empty() {
        println!("xtask counts: as in {FILE}");
        return Ok(());
    }
    bail!(
        "the work differs from {FILE}; if this is intended, run `cargo xtask counts --bless` and \
         give the reason in the commit\n  {header}\n{}",
        differences.join("\n")
    );
}

/// Writes the file.
pub(crate) fn bless() -> Result<()> {
    std::fs::write(FILE, count()?).context(FILE)
}

/// Runs in the profile of the tests, because the release profile may omit an allocation of the cold
/// run.
fn count() -> Result<String> {
    output(&mut cargo("run --quiet --example counts"))
}

//! `cargo xtask counts`: the work of every preset on a fixed set of scenes, against a blessed file.

use anyhow::{Context as _, Result};

use crate::process::{cargo, command, execute, output, target};

const FILE: &str = "benches/counts.txt";

/// Counts again and compares with the file.
pub(crate) fn check() -> Result<()> {
    let counted = target().join("counts.txt");
    std::fs::write(&counted, count()?)?;
    // The heading of each difference repeats the names of the columns.
    let mut diff = command("git --no-pager diff --no-index --unified=0 --");
    execute(diff.arg(FILE).arg(&counted)).with_context(|| {
        format!(
            "the work differs from {FILE}; if this is intended, run `cargo xtask counts --bless` \
             and give the reason in the commit"
        )
    })?;
    println!("xtask counts: as in {FILE}");
    Ok(())
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

//! `cargo xtask bench`: the criterion benches, and their baselines compared by critcmp.

use anyhow::{Result, bail};

use crate::process::{cargo, command, execute, require, target};

/// Selects all benches but `instructions`, which needs a feature.
pub(crate) const BENCHES: &str = "--bench [!i]*";

/// Runs the benches and saves them as a baseline (`last` without `--save`), then compares with
/// another one.
pub(crate) fn run(options: &[&str]) -> Result<()> {
    let (save, against, filter) = match *options {
        ["--save", name, ref filter @ ..] => (name, None, filter),
        ["--against", name, ref filter @ ..] => ("last", Some(name), filter),
        ref filter => ("last", None, filter),
    };
    if filter.len() > 1 || filter.iter().any(|word| word.starts_with('-')) {
        bail!("bench: expected [--save NAME | --against NAME] [FILTER], found {options:?}");
    }
    if against.is_some() {
        require(
            command("critcmp --version"),
            "cargo install critcmp --version 0.1.8 --locked",
        )?;
    }
    let mut bench = cargo(&format!("bench {BENCHES} -- --save-baseline"));
    execute(
        bench
            .env("CRITERION_HOME", target().join("criterion"))
            .arg(save)
            .args(filter),
    )?;
    if let Some(before) = against {
        let mut compare = command("critcmp --target-dir");
        execute(
            compare
                .arg(target())
                .args([before, save])
                .args(filter.iter().flat_map(|f| ["--filter", f])),
        )?;
    }
    Ok(())
}

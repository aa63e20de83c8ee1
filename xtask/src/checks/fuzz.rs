//! `cargo xtask fuzz`: cargo-fuzz on every target in turn. libFuzzer prints the executions of each
//! at its end.

use std::path::Path;

use anyhow::{Context as _, Result, bail, ensure};

use crate::process::{cargo, execute, require, target};

/// Limits of libFuzzer: seconds until a run counts as hanging (also one that waits for a busy
/// processor), MiB of memory, and bytes of the longest input.
const LIMITS: [&str; 5] = [
    "-timeout=300",
    "-rss_limit_mb=2048",
    "-max_len=4096",
    "-print_final_stats=1",
    "-verbosity=0",
];

/// Runs `cargo xtask fuzz [--minutes N] [--target T]...`.
pub(crate) fn run(options: &[&str]) -> Result<()> {
    let (mut minutes, mut targets) = (5.0, Vec::new());
    for option in options.chunks(2) {
        match *option {
            ["--minutes", n] => minutes = n.parse().context("--minutes")?,
            ["--target", target] => targets.push(target.to_owned()),
            _ => bail!("fuzz: expected --minutes N or --target NAME, found {option:?}"),
        }
    }
    require(
        cargo("fuzz --version"),
        "cargo install cargo-fuzz --version 0.13.2 --locked",
    )?;
    if targets.is_empty() {
        for entry in std::fs::read_dir("fuzz/seeds").context("fuzz/seeds")? {
            targets.push(entry?.file_name().to_string_lossy().into_owned());
        }
        targets.sort();
    }
    targets.retain(|name| {
        println!("xtask fuzz: {name}, {minutes} minutes");
        let result = fuzz(name, 60.0 * minutes);
        result
            .inspect_err(|error| eprintln!("xtask fuzz: {error:#}"))
            .is_err()
    });
    ensure!(
        targets.is_empty(),
        "findings of {} are in fuzz/artifacts; keep each as fuzz/regressions/TARGET/NAME when it is fixed",
        targets.join(", ")
    );
    Ok(())
}

fn fuzz(name: &str, seconds: f64) -> Result<()> {
    // The first folder collects new inputs, the others are only read.
    let corpus = format!("fuzz/corpus/{name}");
    std::fs::create_dir_all(&corpus).context(corpus.clone())?;
    // Without a sanitizer, stable Rust can build the targets.
    let mut fuzz = cargo("fuzz run --fuzz-dir fuzz --sanitizer none");
    fuzz.args([name, &corpus, &format!("fuzz/seeds/{name}")]);
    let regressions = format!("fuzz/regressions/{name}");
    if Path::new(&regressions).is_dir() {
        fuzz.arg(regressions);
    }
    fuzz.args(["--", &format!("-max_total_time={seconds:.0}")])
        .args(LIMITS);
    // A target directory of its own, because coverage counters are compiled in.
    fuzz.env("CARGO_TARGET_DIR", target().join("fuzz"));
    // Targets write temporary files.
    if Path::new("/dev/shm").is_dir() {
        fuzz.env("TMPDIR", "/dev/shm");
    }
    execute(&mut fuzz)
}

//! `cargo xtask fuzz`: every fuzz target in turn, for some minutes each.

use std::path::{Path, PathBuf};

use crate::{Findings, process};

/// Beyond this a run counts as hanging, seconds; the slowest takes one or two, and a busy machine some times that.
const HANG_SECONDS: u32 = 60;
/// More resident memory than this is a finding, MiB.
const MEMORY_MIB: u32 = 2048;
/// Longest input, bytes.
const LONGEST: u32 = 4096;

/// What the command line asks for.
#[derive(Debug, PartialEq)]
struct Options {
    minutes: f64,
    target: Option<String>,
}

/// Runs `cargo xtask fuzz [--minutes N] [--target T]`.
pub(crate) fn run(root: &Path, arguments: &[&str]) -> Findings {
    let options = parse(arguments)?;
    if !process::has_subcommand(root, "fuzz") {
        return Err(vec![
            "fuzz: cargo-fuzz is not installed: `cargo install cargo-fuzz --version 0.13.2 --locked`; it wants a C++ compiler and no nightly Rust".to_owned(),
        ]);
    }
    let names = target_names(root)?;
    if let Some(wanted) = &options.target
        && !names.contains(wanted)
    {
        return Err(vec![format!(
            "fuzz: no target is called {wanted:?}, expected one of {}",
            names.join(", ")
        )]);
    }
    cargo_fuzz(root, &["build", "--sanitizer", "none"])?;
    let mut findings = Vec::new();
    for name in names
        .iter()
        .filter(|name| options.target.as_ref().is_none_or(|t| t == *name))
    {
        println!("xtask fuzz: {name}, {} minutes", options.minutes);
        if let Err(found) = fuzz(root, name, options.minutes) {
            findings.extend(found);
            findings.push(format!(
                "{name}: see fuzz/artifacts/{name}; when it is mended, keep it as fuzz/regressions/{name}/WHAT-IT-IS"
            ));
        }
    }
    if findings.is_empty() {
        Ok(())
    } else {
        Err(findings)
    }
}

/// The programs of `fuzz/fuzz_targets`.
fn target_names(root: &Path) -> Result<Vec<String>, Vec<String>> {
    let folder = "fuzz/fuzz_targets";
    let entries =
        std::fs::read_dir(root.join(folder)).map_err(|e| vec![format!("{folder}: {e}")])?;
    let mut names: Vec<String> = entries
        .flatten()
        .filter_map(|entry| Some(entry.file_name().to_str()?.strip_suffix(".rs")?.to_owned()))
        .collect();
    names.sort();
    Ok(names)
}

fn fuzz(root: &Path, name: &str, minutes: f64) -> Findings {
    let corpus = PathBuf::from("fuzz/corpus").join(name);
    std::fs::create_dir_all(root.join(&corpus))
        .map_err(|e| vec![format!("{}: {e}", corpus.display())])?;
    let corpus = corpus.to_string_lossy().into_owned();
    let seeds = format!("fuzz/seeds/{name}");
    let total = format!("-max_total_time={:.0}", (minutes * 60.0).max(1.0));
    let hang = format!("-timeout={HANG_SECONDS}");
    let memory = format!("-rss_limit_mb={MEMORY_MIB}");
    let longest = format!("-max_len={LONGEST}");
    cargo_fuzz(
        root,
        &[
            "run",
            "--sanitizer",
            "none",
            name,
            &corpus,
            &seeds,
            "--",
            &total,
            &hang,
            &memory,
            &longest,
            "-print_final_stats=1",
        ],
    )
}

/// cargo-fuzz in the workspace; temporary files go to memory where there is such a folder.
fn cargo_fuzz(root: &Path, arguments: &[&str]) -> Findings {
    let (subcommand, rest) = arguments.split_at(1);
    let mut command = process::cargo(root, &["fuzz"]);
    command
        .args(subcommand)
        .args(["--fuzz-dir", "fuzz"])
        .args(rest);
    let memory = Path::new("/dev/shm");
    if memory.is_dir() {
        command.env("TMPDIR", memory);
    }
    // Counters are compiled in: a target folder of its own spares the workspace's.
    command.env("CARGO_TARGET_DIR", process::target(root).join("fuzz"));
    process::run(&mut command)
}

fn parse(arguments: &[&str]) -> Result<Options, Vec<String>> {
    let mut options = Options {
        minutes: 5.0,
        target: None,
    };
    let mut words = arguments.iter();
    while let Some(word) = words.next() {
        let value = words.next().copied();
        match (*word, value) {
            ("--minutes", Some(value)) => {
                options.minutes = value
                    .parse()
                    .ok()
                    .filter(|m: &f64| m.is_finite() && *m > 0.0)
                    .ok_or_else(|| {
                        vec![format!(
                            "fuzz: --minutes {value}, expected a number above 0"
                        )]
                    })?;
            }
            ("--target", Some(value)) => options.target = Some(value.to_owned()),
            _ => {
                return Err(vec![format!(
                    "fuzz: cannot read {word:?}, expected --minutes N or --target NAME"
                )]);
            }
        }
    }
    Ok(options)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_read() {
        let read = parse(&["--minutes", "0.5", "--target", "obj"]).unwrap();
        assert_eq!((read.minutes, read.target.as_deref()), (0.5, Some("obj")));
        for wrong in [
            &["--minutes"][..],
            &["--minutes", "0"],
            &["obj"],
            &["--minutes", "x"],
        ] {
            assert!(parse(wrong).is_err(), "{wrong:?}");
        }
    }
}

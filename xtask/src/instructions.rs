//! `cargo xtask instructions`: instruction counts of every step, against a blessed file.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::{Findings, process};

const FILE: &str = "benches/instructions.txt";

/// Counts that differ by less than this share are the same: allocators, `memcpy` and compilers move them a little.
const TOLERANCE: f64 = 0.03;

/// Of the library in `benches/Cargo.toml`; the two must be of one version.
const RUNNER_VERSION: &str = "0.20.0";

/// Counts anew and compares with the file. Skips, and says so, where the tools are missing.
pub(crate) fn check(root: &Path) -> Findings {
    if let Err(missing) = tools() {
        println!("xtask instructions: SKIPPED, {missing}");
        return Ok(());
    }
    let text =
        std::fs::read_to_string(root.join(FILE)).map_err(|e| vec![format!("{FILE}: {e}")])?;
    let blessed = read(&text);
    let counted = count(root)?;
    print!("{}", table(&blessed, &counted));
    let findings = findings(&blessed, &counted);
    if !text.contains(&format!("made with {}.\n", compiler())) {
        println!(
            "xtask instructions: NOT HELD to the file, which another compiler than {} made",
            compiler()
        );
        Ok(())
    } else if findings.is_empty() {
        Ok(())
    } else {
        Err(findings)
    }
}

/// Writes the file.
pub(crate) fn bless(root: &Path) -> Findings {
    tools().map_err(|missing| vec![missing])?;
    let counted = count(root)?;
    let mut text = format!(
        "# Instructions per step, `cargo xtask instructions`; made with {}.\n",
        compiler()
    );
    for (name, count) in &counted {
        let _ = writeln!(text, "{name} {count}");
    }
    std::fs::write(root.join(FILE), text).map_err(|e| vec![format!("{FILE}: {e}")])
}

/// What is missing, if anything.
fn tools() -> Result<(), String> {
    if !process::is_there("valgrind") {
        return Err("valgrind is not installed".to_owned());
    }
    let runner = std::env::var("GUNGRAUN_RUNNER").unwrap_or_else(|_| "gungraun-runner".to_owned());
    let found = output(&runner, "--version");
    let install = format!("cargo install gungraun-runner --version ={RUNNER_VERSION}");
    match found {
        None => Err(format!("gungraun-runner is not on the path ({install})")),
        Some(text) if text.split_whitespace().any(|word| word == RUNNER_VERSION) => Ok(()),
        Some(text) => Err(format!(
            "{} is not version {RUNNER_VERSION} ({install})",
            text.trim()
        )),
    }
}

fn output(program: &str, argument: &str) -> Option<String> {
    let output = Command::new(program)
        .arg(argument)
        .stderr(Stdio::null())
        .output()
        .ok()?;
    output
        .status
        .success()
        .then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}

fn compiler() -> String {
    let program = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    let version = output(&program, "--version").unwrap_or_default();
    let words: Vec<&str> = version.split_whitespace().take(2).collect();
    words.join(" ")
}

/// Runs the benches under valgrind and reads the instructions of each from what callgrind wrote.
fn count(root: &Path) -> Result<BTreeMap<String, u64>, Vec<String>> {
    let results = process::target(root).join("gungraun/hicp-benches/instructions/steps");
    // Benches that are no longer there must not be found.
    let _ = std::fs::remove_dir_all(&results);
    let arguments = [
        "bench",
        "--quiet",
        "--package",
        "hicp-benches",
        "--features",
        "instructions",
        "--bench",
        "instructions",
    ];
    process::cargo_output(root, &arguments)?;
    let entries =
        std::fs::read_dir(&results).map_err(|e| vec![format!("{}: {e}", results.display())])?;
    let mut counts = BTreeMap::new();
    for folder in entries.flatten().map(|entry| entry.path()) {
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        let file = folder.join(format!("callgrind.{name}.out"));
        let text =
            std::fs::read_to_string(&file).map_err(|e| vec![format!("{}: {e}", file.display())])?;
        let count = summary(&text)
            .ok_or_else(|| vec![format!("{}: no summary of instructions", file.display())])?;
        counts.insert(name.into_owned(), count);
    }
    Ok(counts)
}

/// The instructions of a callgrind file: the first number of its summary, if instructions are the first event.
fn summary(text: &str) -> Option<u64> {
    let of = |key: &str| text.lines().find_map(|line| line.strip_prefix(key));
    of("events:")?.trim().starts_with("Ir").then_some(())?;
    of("summary:")
        .or_else(|| of("totals:"))?
        .split_whitespace()
        .next()?
        .parse()
        .ok()
}

fn read(text: &str) -> BTreeMap<String, u64> {
    text.lines()
        .filter(|line| !line.starts_with('#'))
        .filter_map(|line| line.split_once(' '))
        .filter_map(|(name, count)| Some((name.to_owned(), count.trim().parse().ok()?)))
        .collect()
}

fn table(blessed: &BTreeMap<String, u64>, counted: &BTreeMap<String, u64>) -> String {
    let width = counted.keys().map(String::len).max().unwrap_or(0);
    let mut text = format!(
        "{:width$}  {:>12}  {:>12}  ratio\n",
        "step", "blessed", "now"
    );
    for (name, now) in counted {
        let (before, ratio) = blessed.get(name).map_or_else(
            || ("-".to_owned(), "-".to_owned()),
            |before| {
                let ratio = *now as f64 / *before as f64;
                (before.to_string(), format!("{ratio:.3}"))
            },
        );
        let _ = writeln!(text, "{name:width$}  {before:>12}  {now:>12}  {ratio}");
    }
    text
}

fn findings(blessed: &BTreeMap<String, u64>, counted: &BTreeMap<String, u64>) -> Vec<String> {
    let mut findings = Vec::new();
    for (name, now) in counted {
        match blessed.get(name) {
            None => findings.push(format!("{name} is not in {FILE}")),
            Some(before) => {
                let ratio = *now as f64 / *before as f64;
                if (ratio - 1.0).abs() > TOLERANCE {
                    let change = (ratio - 1.0) * 100.0;
                    findings.push(format!("{name}: {change:+.1} % instructions"));
                }
            }
        }
    }
    for name in blessed.keys().filter(|name| !counted.contains_key(*name)) {
        findings.push(format!("{name} is in {FILE} but was not run"));
    }
    if !findings.is_empty() {
        findings.push(format!(
            "the instructions differ from {FILE} (within {} % is let pass): if that is meant, run `cargo xtask instructions --bless` and say why in the commit",
            TOLERANCE * 100.0
        ));
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_summary_is_read() {
        let text = "version: 1\nevents: Ir Dr Dw\nfn=main\n1 2 3\nsummary: 3792132 5 6\n";
        assert_eq!(summary(text), Some(3_792_132));
        assert_eq!(summary("events: Dr Ir\nsummary: 1 2\n"), None);
    }

    #[test]
    fn what_is_within_the_tolerance_passes_in_both_directions() {
        let of = |count| BTreeMap::from([("render.mug".to_owned(), count)]);
        assert!(findings(&of(1000), &of(1029)).is_empty());
        assert!(findings(&of(1000), &of(971)).is_empty());
        assert_eq!(findings(&of(1000), &of(1031)).len(), 2);
        assert_eq!(findings(&of(1000), &of(900)).len(), 2);
        assert_eq!(findings(&of(1000), &BTreeMap::new()).len(), 2);
        assert_eq!(findings(&BTreeMap::new(), &of(1000)).len(), 2);
    }

    #[test]
    fn the_blessed_file_is_read() {
        let counts = read("# made with rustc\nrender.mug 12\n");
        assert_eq!(counts, BTreeMap::from([("render.mug".to_owned(), 12)]));
    }
}

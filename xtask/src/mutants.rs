//! `cargo xtask mutants`: changes to the numerical crates that no test notices, by cargo-mutants.

use std::path::Path;

use crate::{Findings, process};

/// The crates that `.cargo/mutants.toml` looks at.
const CRATES: [&str; 4] = ["hicp-core", "hicp-metric", "hicp-score", "hicp-fusion"];

/// Mutants by what became of them.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
struct Count {
    /// A test failed, or did not end in time.
    caught: usize,
    /// No test failed.
    missed: usize,
    /// Do not compile.
    unviable: usize,
}

/// Runs `cargo xtask mutants [CRATE [K/N]...]`: all of them, those of a crate, or samples of a crate, each every N-th mutant from the
/// K-th on.
pub(crate) fn run(root: &Path, arguments: &[&str]) -> Findings {
    let (crates, samples) = parse(arguments)?;
    if !process::has_subcommand(root, "mutants") {
        return Err(vec![
            "mutants: cargo-mutants is not installed: `cargo install cargo-mutants --version 27.1.0 --locked`".to_owned(),
        ]);
    }
    let mut findings = Vec::new();
    let mut table = vec![
        "| crate | mutants | do not compile | caught | missed | share caught, 95 % interval |"
            .to_owned(),
        "|---|---|---|---|---|---|".to_owned(),
    ];
    for name in crates {
        let mut count = Count::default();
        for sample in &samples {
            let place = sample.map_or_else(|| "all".to_owned(), |s| s.replace('/', "-of-"));
            let output = process::target(root).join("mutants").join(name).join(place);
            let _ = std::fs::remove_dir_all(&output);
            std::fs::create_dir_all(&output)
                .map_err(|e| vec![format!("{}: {e}", output.display())])?;
            let mut command = process::cargo(root, &["mutants", "--package", name, "--output"]);
            command.arg(&output);
            if let Some(sample) = sample {
                command.args(["--shard", sample, "--sharding", "round-robin"]);
            }
            // What is built for a single run of the tests: less optimised, and without lines for debuggers.
            command
                .env("CARGO_PROFILE_DEV_OPT_LEVEL", "1")
                .env("CARGO_PROFILE_DEV_DEBUG", "0");
            // Each crate is held to its own tests. Two means that mutants were missed; they are on the terminal.
            if let Err(found) = process::run(&mut command) {
                findings.extend(found);
            }
            count.add(&output.join("mutants.out"));
        }
        table.push(count.row(name));
    }
    println!("{}", table.join("\n"));
    if findings.is_empty() {
        Ok(())
    } else {
        Err(findings)
    }
}

/// The crates, and which samples of each: `None` for all mutants.
type Wanted<'a> = (Vec<&'a str>, Vec<Option<&'a str>>);

fn parse<'a>(arguments: &[&'a str]) -> Result<Wanted<'a>, Vec<String>> {
    let is_sample = |word: &&str| {
        let numbers = word
            .split_once('/')
            .and_then(|(k, n)| Some((k.parse::<usize>().ok()?, n.parse::<usize>().ok()?)));
        numbers.is_some_and(|(k, n)| k < n)
    };
    match arguments {
        [] => Ok((CRATES.to_vec(), vec![None])),
        [name] if CRATES.contains(name) => Ok((vec![*name], vec![None])),
        [name, samples @ ..] if CRATES.contains(name) && samples.iter().all(is_sample) => {
            Ok((vec![*name], samples.iter().copied().map(Some).collect()))
        }
        _ => Err(vec![format!(
            "mutants: cannot read {arguments:?}, expected one of {} and, if wanted, samples like 0/40 7/40",
            CRATES.join(", ")
        )]),
    }
}

impl Count {
    /// Adds what cargo-mutants wrote into a folder, a mutant a line.
    fn add(&mut self, folder: &Path) {
        let lines = |name: &str| {
            let text = std::fs::read_to_string(folder.join(name)).unwrap_or_default();
            text.lines().count()
        };
        self.caught += lines("caught.txt") + lines("timeout.txt");
        self.missed += lines("missed.txt");
        self.unviable += lines("unviable.txt");
    }

    fn row(&self, name: &str) -> String {
        let Self {
            caught,
            missed,
            unviable,
        } = *self;
        let share = match caught + missed {
            0 => "-".to_owned(),
            of => {
                let (low, high) = interval(caught, of);
                let percent = |share: f64| format!("{:.0}", 100.0 * share);
                #[allow(clippy::cast_precision_loss)] // Some thousands.
                let share = caught as f64 / of as f64;
                format!("{} % [{}, {}]", percent(share), percent(low), percent(high))
            }
        };
        let all = caught + missed + unviable;
        format!("| `{name}` | {all} | {unviable} | {caught} | {missed} | {share} |")
    }
}

/// The 95 % interval of a share that was seen `hits` times in `of`, by Wilson (1927).
#[allow(clippy::cast_precision_loss)] // Some thousands.
fn interval(hits: usize, of: usize) -> (f64, f64) {
    const Z: f64 = 1.959_964;
    let n = of as f64;
    let share = hits as f64 / n;
    let middle = share + Z * Z / (2.0 * n);
    let half = Z * (share * (1.0 - share) / n + Z * Z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + Z * Z / n;
    ((middle - half) / scale, (middle + half) / scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_are_read() {
        assert_eq!(parse(&[]).unwrap(), (CRATES.to_vec(), vec![None]));
        let all = parse(&["hicp-core"]).unwrap();
        assert_eq!(all, (vec!["hicp-core"], vec![None]));
        let some = parse(&["hicp-core", "0/40", "7/40"]).unwrap();
        assert_eq!(some, (vec!["hicp-core"], vec![Some("0/40"), Some("7/40")]));
        for wrong in [
            &["hicp-io"][..],
            &["0/40"],
            &["hicp-core", "40/40"],
            &["hicp-core", "1"],
            &["hicp-core", "hicp-score"],
        ] {
            assert!(parse(wrong).is_err(), "{wrong:?}");
        }
    }

    /// Newcombe (1998), table I: 81 of 263, and 0 of 20.
    #[test]
    fn intervals_are_those_of_the_literature() {
        let (low, high) = interval(81, 263);
        assert!((low - 0.2553).abs() < 5e-5 && (high - 0.3662).abs() < 5e-5);
        let (low, high) = interval(0, 20);
        assert!(low.abs() < 1e-12 && (high - 0.1611).abs() < 5e-5);
    }

    #[test]
    fn mutants_are_counted_by_what_became_of_them() {
        let folder = std::env::temp_dir().join(format!("xtask-mutants-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        for (name, text) in [
            ("caught.txt", "a\nb\nc\n"),
            ("timeout.txt", "d\n"),
            ("missed.txt", "e\n"),
            ("unviable.txt", "f\ng\n"),
        ] {
            std::fs::write(folder.join(name), text).unwrap();
        }
        let mut count = Count::default();
        count.add(&folder);
        std::fs::remove_dir_all(&folder).unwrap();
        count.add(&folder);
        let expected = Count {
            caught: 4,
            missed: 1,
            unviable: 2,
        };
        assert_eq!(count, expected);
        assert_eq!(count.row("x"), "| `x` | 7 | 2 | 4 | 1 | 80 % [38, 96] |");
        assert_eq!(Count::default().row("x"), "| `x` | 0 | 0 | 0 | 0 | - |");
    }
}

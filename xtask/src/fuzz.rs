//! `cargo xtask fuzz`: every fuzz target in turn, for some minutes of a processor each, and a table of what was done.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::{Findings, process};

/// Beyond this a run counts as hanging, seconds. By the clock, which is what libFuzzer looks at: the slowest take some seconds of a
/// processor, and a fuzzer that waits for one behind other programs twenty times that.
const HANG_SECONDS: u32 = 300;
/// More resident memory than this is a finding, MiB.
const MEMORY_MIB: u32 = 2048;
/// Longest input, bytes.
const LONGEST: u32 = 4096;
/// A target is not started again for less than this, seconds: it reads its corpus first.
const SHORTEST_SECONDS: f64 = 3.0;

/// What the command line asks for.
#[derive(Debug, PartialEq)]
struct Options {
    /// Of a processor; by the clock where nothing tells.
    minutes: f64,
    /// Those that are named; all if none is.
    targets: Vec<String>,
}

/// What one fuzzer did.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Done {
    /// Runs of the target.
    executions: u64,
    /// Edges of the control flow that were taken.
    edges: u64,
    /// By the clock.
    minutes: f64,
    /// Of a processor, where `/proc` tells: fewer than by the clock on a machine that does other things.
    processor_minutes: Option<f64>,
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
    if let Some(wanted) = options.targets.iter().find(|t| !names.contains(t)) {
        return Err(vec![format!(
            "fuzz: no target is called {wanted:?}, expected one of {}",
            names.join(", ")
        )]);
    }
    process::run(&mut cargo_fuzz(root, &["build", "--sanitizer", "none"]))?;
    let mut findings = Vec::new();
    let mut table = vec![
        "| target | minutes | of a processor | executions | edges covered | findings |".to_owned(),
        "|---|---|---|---|---|---|".to_owned(),
    ];
    let chosen = |name: &&String| options.targets.is_empty() || options.targets.contains(name);
    for name in names.iter().filter(chosen) {
        println!(
            "xtask fuzz: {name}, {} minutes of a processor",
            options.minutes
        );
        let (done, found) = fuzz(root, name, options.minutes)?;
        table.push(row(name, &done, found.is_err()));
        if let Err(found) = found {
            findings.extend(found);
            findings.push(format!(
                "{name}: see fuzz/artifacts/{name}; when it is mended, keep it as fuzz/regressions/{name}/WHAT-IT-IS"
            ));
        }
    }
    println!("{}", table.join("\n"));
    if findings.is_empty() {
        Ok(())
    } else {
        Err(findings)
    }
}

/// A line of the table.
fn row(name: &str, done: &Done, found: bool) -> String {
    let processor = done
        .processor_minutes
        .map_or_else(|| "not known".to_owned(), |minutes| format!("{minutes:.1}"));
    format!(
        "| `{name}` | {:.1} | {processor} | {} | {} | {} |",
        done.minutes,
        done.executions,
        done.edges,
        if found { "one" } else { "none" }
    )
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

/// Runs a fuzzer until it has had its minutes of a processor, or finds something. libFuzzer counts by the clock and is therefore
/// started again, on the corpus that it left, as often as other programs took the processor from it.
fn fuzz(root: &Path, name: &str, minutes: f64) -> Result<(Done, Findings), Vec<String>> {
    let mut done = Done::default();
    loop {
        let left = 60.0 * (minutes - done.processor_minutes.unwrap_or(done.minutes));
        if left < SHORTEST_SECONDS && done.executions > 0 {
            return Ok((done, Ok(())));
        }
        let (more, found) = start(root, name, left.max(1.0))?;
        done = done.and(more);
        if found.is_err() || more.executions == 0 {
            return Ok((done, found));
        }
    }
}

/// Runs a fuzzer for some seconds by the clock; what it says goes to `target/fuzz/logs/NAME.log`.
fn start(root: &Path, name: &str, seconds: f64) -> Result<(Done, Findings), Vec<String>> {
    let corpus = PathBuf::from("fuzz/corpus").join(name);
    let logs = target(root).join("logs");
    for folder in [&root.join(&corpus), &logs] {
        std::fs::create_dir_all(folder).map_err(|e| vec![format!("{}: {e}", folder.display())])?;
    }
    let log = logs.join(name).with_extension("log");
    let cannot = |e: std::io::Error| vec![format!("{}: {e}", log.display())];
    let corpus = corpus.to_string_lossy().into_owned();
    let seeds = format!("fuzz/seeds/{name}");
    let total = format!("-max_total_time={seconds:.0}");
    let hang = format!("-timeout={HANG_SECONDS}");
    let memory = format!("-rss_limit_mb={MEMORY_MIB}");
    let longest = format!("-max_len={LONGEST}");
    let mut command = cargo_fuzz(
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
    );
    command.stderr(std::fs::File::create(&log).map_err(cannot)?);
    let (begun, before) = (std::time::Instant::now(), processor_seconds());
    let found = process::run(&mut command).map_err(|mut findings| {
        findings.push(format!("{name}: its last words are in {}", log.display()));
        findings
    });
    let minutes = begun.elapsed().as_secs_f64() / 60.0;
    let said = std::fs::read(&log).map_err(cannot)?;
    let (executions, edges) = counts(&String::from_utf8_lossy(&said));
    let processor_minutes = processor_seconds()
        .zip(before)
        .map(|(after, before)| (after - before) / 60.0);
    let done = Done {
        executions,
        edges,
        minutes,
        processor_minutes,
    };
    Ok((done, found))
}

impl Done {
    /// Two runs as one.
    fn and(self, more: Self) -> Self {
        let first = self.executions == 0;
        Self {
            executions: self.executions + more.executions,
            edges: self.edges.max(more.edges),
            minutes: self.minutes + more.minutes,
            processor_minutes: if first {
                more.processor_minutes
            } else {
                self.processor_minutes
                    .zip(more.processor_minutes)
                    .map(|(a, b)| a + b)
            },
        }
    }
}

/// Executions and covered edges, out of what libFuzzer says: its statistics at the end, or the last line of one that was stopped.
fn counts(said: &str) -> (u64, u64) {
    let number = |word: &str| -> Option<u64> {
        let digits = word.trim_start_matches('#');
        digits
            .split(|c: char| !c.is_ascii_digit())
            .next()?
            .parse()
            .ok()
    };
    let (mut executions, mut edges) = (0, 0);
    for line in said.lines() {
        if let Some((_, n)) = line.split_once("number_of_executed_units:") {
            executions = number(n.trim()).unwrap_or(executions);
        } else if let Some((n, rest)) = line.split_once(" cov: ")
            && line.starts_with('#')
        {
            executions = number(n.trim()).unwrap_or(executions);
            edges = number(rest).unwrap_or(edges);
        }
    }
    (executions, edges)
}

/// What the programs that this one has waited for took of a processor, where there is a `/proc`.
fn processor_seconds() -> Option<f64> {
    children_seconds(&std::fs::read_to_string("/proc/self/stat").ok()?)
}

/// The sixteenth and seventeenth field of `/proc/PID/stat`, in hundredths of a second; names may hold spaces and brackets.
fn children_seconds(stat: &str) -> Option<f64> {
    let (_, fields) = stat.rsplit_once(')')?;
    let mut fields = fields.split_whitespace().skip(13);
    let mut next = || fields.next()?.parse::<f64>().ok();
    Some((next()? + next()?) / 100.0)
}

/// Where fuzzers are built: counters are compiled in, and a folder of its own spares the workspace's.
fn target(root: &Path) -> PathBuf {
    process::target(root).join("fuzz")
}

/// cargo-fuzz in the workspace; temporary files go to memory where there is such a folder.
fn cargo_fuzz(root: &Path, arguments: &[&str]) -> Command {
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
    command.env("CARGO_TARGET_DIR", target(root));
    command
}

fn parse(arguments: &[&str]) -> Result<Options, Vec<String>> {
    let mut options = Options {
        minutes: 5.0,
        targets: Vec::new(),
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
            ("--target", Some(value)) => options.targets.push(value.to_owned()),
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
        let read = parse(&["--minutes", "0.5", "--target", "obj", "--target", "ply"]).unwrap();
        assert_eq!(read.minutes, 0.5);
        assert_eq!(read.targets, ["obj", "ply"]);
        assert_eq!(parse(&[]).unwrap().targets, Vec::<String>::new());
        for wrong in [
            &["--minutes"][..],
            &["--minutes", "0"],
            &["obj"],
            &["--minutes", "x"],
        ] {
            assert!(parse(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn what_a_fuzzer_says_is_counted() {
        let line =
            "#4096\tpulse  cov: 812 ft: 2210 corp: 38/1204b lim: 43 exec/s: 2048 rss: 48Mb\n";
        assert_eq!(counts(line), (4096, 812));
        let end =
            format!("{line}stat::number_of_executed_units: 5310\nstat::average_exec_per_sec: 7\n");
        assert_eq!(counts(&end), (5310, 812));
        assert_eq!(counts("INFO: nothing yet"), (0, 0));
    }

    #[test]
    fn runs_of_a_target_add_up() {
        let run = |executions, edges, processor_minutes| Done {
            executions,
            edges,
            minutes: 2.0,
            processor_minutes,
        };
        let two = Done::default()
            .and(run(10, 7, Some(0.5)))
            .and(run(30, 6, Some(1.0)));
        assert_eq!((two.executions, two.edges, two.minutes), (40, 7, 4.0));
        assert_eq!(two.processor_minutes, Some(1.5));
        assert_eq!(two.and(run(1, 1, None)).processor_minutes, None);
    }

    #[test]
    fn the_processors_time_is_that_of_the_children() {
        let stat = "7 (a ) b) S 1 2 3 4 5 6 7 8 9 10 11 12 150 250 20 0 1 0\n";
        assert_eq!(children_seconds(stat), Some(4.0));
        assert_eq!(children_seconds("7 (a) S 1"), None);
    }
}

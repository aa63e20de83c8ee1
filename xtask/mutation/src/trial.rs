//! Mutants before their tests.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use crate::programs::Test;
use crate::report::Fate;
use crate::working_copy::WorkingCopy;

/// Tests below this are run in one process for all of a program, seconds; longer ones one by one, for the first to fail ends the trial.
const SHORT: f64 = 0.05;
/// A test may take this many times what it took without a mutant, of a processor, and [`GRACE`] more.
const PATIENCE: f64 = 5.0;
/// Seconds of a processor.
const GRACE: f64 = 3.0;
/// By the clock, for tests that wait for ever, seconds.
const LONGEST: Duration = Duration::from_secs(300);
/// Address space of a test, KiB: a mutant that allocates without end fails.
const MEMORY: u32 = 6 << 20;

/// How a process ended.
#[derive(Debug, PartialEq)]
enum End {
    Passed,
    Failed,
    /// It had its time and was ended.
    Late,
}

/// What a test reaches, and how long it takes.
pub(crate) struct Reached {
    mutants: BTreeSet<usize>,
    seconds: f64,
}

/// Runs each test once, without a mutant, and says which mutants it reaches.
pub(crate) fn trace(copy: &WorkingCopy, tests: &[Test]) -> Result<Vec<Reached>> {
    let file = copy.target.join("reached.txt");
    let mut all = Vec::new();
    for test in tests {
        let _ = std::fs::remove_file(&file);
        let begun = Instant::now();
        let mut command = command(copy, &test.program, &[&test.name], LONGEST.as_secs_f64());
        command.env("HICP_MUTANTS_REACHED", &file);
        if run(&mut command)? != End::Passed {
            bail!("{} fails without a mutant", test.name);
        }
        let seconds = begun.elapsed().as_secs_f64();
        let said = std::fs::read_to_string(&file).unwrap_or_default();
        let mutants = said
            .lines()
            .map(|line| line.parse().context("reached.txt"))
            .collect::<Result<_>>()?;
        all.push(Reached { mutants, seconds });
    }
    Ok(all)
}

/// Tries mutants that are woven in, some at a time.
pub(crate) fn try_woven(
    copy: &WorkingCopy,
    tests: &[Test],
    reached: &[Reached],
    mutants: &[usize],
    jobs: usize,
) -> Result<BTreeMap<usize, Fate>> {
    let left = Mutex::new(mutants.iter());
    let done: Mutex<BTreeMap<usize, Fate>> = Mutex::new(BTreeMap::new());
    let work = || -> Result<()> {
        loop {
            let next = left.lock().map_or(None, |mut left| left.next());
            let Some(&mutant) = next else {
                return Ok(());
            };
            let fate = try_one(copy, tests, reached, mutant)?;
            if let Ok(mut done) = done.lock() {
                done.insert(mutant, fate);
                if done.len() % 100 == 0 {
                    eprintln!("mutation: {} of {}", done.len(), mutants.len());
                }
            }
        }
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..jobs).map(|_| scope.spawn(work)).collect();
        workers
            .into_iter()
            .try_for_each(|worker| worker.join().unwrap_or_else(|_| bail!("a worker panicked")))
    })?;
    done.into_inner().map_err(|e| anyhow::anyhow!("{e}"))
}

fn try_one(copy: &WorkingCopy, tests: &[Test], reached: &[Reached], mutant: usize) -> Result<Fate> {
    let on = mutant.to_string();
    let mut short: HashMap<&Path, (Vec<&str>, f64)> = HashMap::new();
    let mut long = Vec::new();
    for (test, reached) in tests.iter().zip(reached) {
        if !reached.mutants.contains(&mutant) {
            continue;
        }
        if reached.seconds < SHORT {
            let (names, seconds) = short.entry(&test.program).or_default();
            names.push(&test.name);
            *seconds += reached.seconds;
        } else {
            long.push((test, reached.seconds));
        }
    }
    let n_tests = short.values().map(|(names, _)| names.len()).sum::<usize>() + long.len();
    let mut short: Vec<_> = short.into_iter().collect();
    short.sort_by(|a, b| a.1.1.total_cmp(&b.1.1));
    long.sort_by(|a, b| a.1.total_cmp(&b.1));
    let long = long
        .iter()
        .map(|(test, seconds)| (test.program.as_path(), (vec![test.name.as_str()], *seconds)));
    for (program, (names, seconds)) in short.into_iter().chain(long) {
        let mut command = command(copy, program, &names, PATIENCE * seconds + GRACE);
        match run(command.env("HICP_MUTANT", &on))? {
            End::Passed => {}
            End::Failed => return Ok(Fate::Caught),
            End::Late => return Ok(Fate::Late),
        }
    }
    Ok(Fate::Missed { n_tests })
}

/// How long each program's tests take together, seconds.
pub(crate) fn programs_seconds(tests: &[Test], reached: &[Reached]) -> BTreeMap<String, f64> {
    let mut seconds = BTreeMap::new();
    for (test, reached) in tests.iter().zip(reached) {
        *seconds.entry(file_stem(&test.program)).or_default() += reached.seconds;
    }
    seconds
}

/// The name of a program without the hash that cargo appends, which is another in each build.
fn file_stem(program: &Path) -> String {
    let name = program.file_name().unwrap_or_default().to_string_lossy();
    let stem = name.rsplit_once('-').map_or(&*name, |(stem, _)| stem);
    stem.to_owned()
}

/// Tries what is built, with all tests, of which it is known how long they take without a mutant.
pub(crate) fn try_built(
    copy: &WorkingCopy,
    tests: &[Test],
    usual: &BTreeMap<String, f64>,
) -> Result<Fate> {
    let programs: BTreeSet<&PathBuf> = tests.iter().map(|test| &test.program).collect();
    for program in programs {
        let seconds = usual
            .get(&file_stem(program))
            .map_or(LONGEST.as_secs_f64(), |s| PATIENCE * s + GRACE);
        match run(&mut command(copy, program, &[], seconds))? {
            End::Passed => {}
            End::Failed => return Ok(Fate::Caught),
            End::Late => return Ok(Fate::Late),
        }
    }
    Ok(Fate::Missed {
        n_tests: tests.len(),
    })
}

/// A test program, with limits on its time and memory that a mutant may exceed. Property tests draw the same cases in each run, do not
/// look for the least that fails, and leave nothing behind for the next.
fn command(copy: &WorkingCopy, program: &Path, tests: &[&str], seconds: f64) -> Command {
    let mut command = Command::new("sh");
    let limits = format!(
        "ulimit -v {MEMORY}; ulimit -t {:.0}; exec \"$0\" \"$@\"",
        seconds.ceil()
    );
    command.args(["-c", &limits]).arg(program);
    if !tests.is_empty() {
        command.arg("--exact").args(tests);
    }
    command
        .args(["--test-threads", "1"])
        .current_dir(copy.package_folder())
        .env("CARGO_MANIFEST_DIR", copy.package_folder())
        .env("PROPTEST_RNG_SEED", "1")
        .env("PROPTEST_MAX_SHRINK_ITERS", "0")
        .env("PROPTEST_DISABLE_FAILURE_PERSISTENCE", "1")
        .env("RUST_BACKTRACE", "0")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command
}

fn run(command: &mut Command) -> Result<End> {
    /// Ends a program that has had its seconds.
    const SIGXCPU: i32 = 24;
    /// The same, where the limit is a hard one.
    const SIGKILL: i32 = 9;
    let begun = Instant::now();
    let mut child = command.spawn().with_context(|| format!("{command:?}"))?;
    let mut pause = Duration::from_micros(500);
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(match (status.success(), signal(status)) {
                (true, _) => End::Passed,
                (_, Some(SIGXCPU | SIGKILL)) => End::Late,
                _ => End::Failed,
            });
        }
        if begun.elapsed() > LONGEST {
            child.kill()?;
            child.wait()?;
            return Ok(End::Late);
        }
        std::thread::sleep(pause);
        pause = (2 * pause).min(Duration::from_millis(20));
    }
}

/// The signal that ended a process.
#[cfg(unix)]
fn signal(status: std::process::ExitStatus) -> Option<i32> {
    std::os::unix::process::ExitStatusExt::signal(&status)
}

/// There are none elsewhere; nor is there the shell that sets the limits.
#[cfg(not(unix))]
fn signal(_: std::process::ExitStatus) -> Option<i32> {
    None
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_program_passes_fails_or_is_late() {
        let shell = |script: &str| run(Command::new("sh").args(["-c", script])).unwrap();
        assert_eq!(shell("exit 0"), End::Passed);
        assert_eq!(shell("exit 101"), End::Failed);
        assert_eq!(shell("kill -ABRT $$"), End::Failed);
        assert_eq!(shell("kill -XCPU $$"), End::Late);
    }

    #[test]
    fn a_program_is_known_without_its_hash() {
        let stem = |path: &str| file_stem(Path::new(path));
        assert_eq!(stem("/t/deps/pose_error-0af3"), "pose_error");
        assert_eq!(stem("plain"), "plain");
    }
}

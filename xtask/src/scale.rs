//! `cargo xtask scale`: a result file of many rows over generated images, refined whole, killed and resumed, and in shards.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::{Findings, process};

/// Images are 20 scenes of 10; with six objects each, and this many starts per object, somewhat more than 20,000 rows.
const GENERATED: &str = "--scenes 20 --images 10 --instances 6 --starts 20 --seed 7";
const ROWS: u32 = 20_000;

/// Runs it; the figures go to the terminal.
pub(crate) fn run(root: &Path, options: &[&str]) -> Findings {
    let (rows, threads) = read(options)?;
    let mut build = process::cargo(root, &["build", "--release", "-p", "hybrid-icp-cli"]);
    process::run(&mut build)?;
    let target = process::target(root);
    let scale = Scale {
        program: target.join("release/hybrid-icp"),
        folder: target.join("scale"),
        rows,
        threads,
    };
    scale.generate()?;
    scale.figures()
}

/// Reads `--rows N` and `--threads N`.
fn read(options: &[&str]) -> Result<(u32, u32), Vec<String>> {
    let (mut rows, mut threads) = (ROWS, 1);
    for pair in options.chunks(2) {
        let value = pair.get(1).and_then(|text| text.parse().ok());
        match (pair[0], value) {
            ("--rows", Some(n)) if n > 0 => rows = n,
            ("--threads", Some(n)) if n > 0 => threads = n,
            (option, _) => {
                return Err(vec![format!(
                    "scale: {option}: expected --rows N or --threads N, with N from 1"
                )]);
            }
        }
    }
    Ok((rows, threads))
}

struct Scale {
    program: PathBuf,
    folder: PathBuf,
    rows: u32,
    threads: u32,
}

/// What a run cost.
struct Cost {
    seconds: f64,
    /// Peak of the resident memory, MiB, where the system tells.
    peak: Option<f64>,
}

impl Scale {
    /// Makes the dataset, once.
    fn generate(&self) -> Findings {
        let made = self.folder.join("generated");
        if fs::read_to_string(&made).is_ok_and(|with| with == GENERATED) {
            return Ok(());
        }
        let data = self.folder.join("data");
        if data.exists() {
            fs::remove_dir_all(&data).map_err(|e| vec![format!("{}: {e}", data.display())])?;
        }
        fs::create_dir_all(&self.folder)
            .map_err(|e| vec![format!("{}: {e}", self.folder.display())])?;
        let mut generate = Command::new(&self.program);
        generate
            .args(["bop", "generate", "--out", "data"])
            .args(GENERATED.split(' '))
            .current_dir(&self.folder);
        process::run(&mut generate)?;
        fs::write(&made, GENERATED).map_err(|e| vec![format!("{}: {e}", made.display())])
    }

    fn figures(&self) -> Findings {
        let whole = self.refine("whole.csv", &[])?;
        println!(
            "{} rows whole, {} threads: {:.1} s, {:.1} rows/s, peak memory {}",
            self.rows,
            self.threads,
            whole.seconds,
            f64::from(self.rows) / whole.seconds,
            whole.peak(),
        );
        let quarter = (self.rows / 4).max(1).to_string();
        let cost = self.refine("quarter.csv", &["--limit", &quarter])?;
        println!("{quarter} rows: peak memory {}", cost.peak());

        let expected = self.bytes("whole.csv")?;
        let held = self.killed()?;
        self.refine("killed.csv", &["--resume"])?;
        let resumed = self.bytes("killed.csv")?;
        println!(
            "killed with {held} images in the journal, then resumed: {}",
            same(&resumed, &expected)
        );

        let mut joined = Vec::new();
        for shard in ["1/2", "2/2"] {
            self.refine("shard.csv", &["--shard", shard])?;
            let bytes = self.bytes("shard.csv")?;
            let header = bytes
                .iter()
                .position(|byte| *byte == b'\n')
                .map_or(0, |end| end + 1);
            let from = if joined.is_empty() { 0 } else { header };
            joined.extend_from_slice(&bytes[from..]);
        }
        println!(
            "two shards one after the other: {}",
            same(&joined, &expected)
        );
        if resumed == expected && joined == expected {
            Ok(())
        } else {
            Err(vec!["scale: the outputs differ".to_owned()])
        }
    }

    fn command(&self, output: &str, options: &[&str]) -> Command {
        let (rows, threads) = (self.rows.to_string(), self.threads.to_string());
        let limit = ["--limit", rows.as_str()];
        let limited = options.contains(&"--limit");
        let mut command = Command::new(&self.program);
        command
            .args([
                "bop",
                "refine",
                "--dataset",
                "data",
                "--no-time",
                "--rescore",
                "mve",
                "--pipeline",
                "hybrid",
            ])
            .args([
                "--results",
                "data/initial_synthetic-test.csv",
                "--output",
                output,
            ])
            .args(["--threads", &threads])
            .args(if limited { &[][..] } else { &limit[..] })
            .args(options)
            .current_dir(&self.folder)
            .stdout(Stdio::null());
        command
    }

    /// Runs to the end, looking at the memory meanwhile.
    fn refine(&self, output: &str, options: &[&str]) -> Result<Cost, Vec<String>> {
        let mut command = self.command(output, options);
        let start = Instant::now();
        let mut child = command
            .spawn()
            .map_err(|e| vec![format!("{command:?}: {e}")])?;
        let mut peak = None;
        loop {
            peak = peak_memory(&child).or(peak);
            match child.try_wait() {
                Ok(None) => std::thread::sleep(Duration::from_millis(20)),
                Ok(Some(status)) if status.success() => break,
                Ok(Some(status)) => return Err(vec![format!("{command:?}: {status}")]),
                Err(error) => return Err(vec![format!("{command:?}: {error}")]),
            }
        }
        let seconds = start.elapsed().as_secs_f64();
        Ok(Cost { seconds, peak })
    }

    /// Kills a run when a third of the images are done; returns how many its journal holds.
    fn killed(&self) -> Result<usize, Vec<String>> {
        let journal = self.folder.join("killed.csv.journal");
        let _ = fs::remove_file(&journal);
        let mut command = self.command("killed.csv", &[]);
        let mut child = command
            .spawn()
            .map_err(|e| vec![format!("{command:?}: {e}")])?;
        let done = || {
            let text = fs::read(&journal).unwrap_or_default();
            let lines = text.iter().filter(|byte| **byte == b'\n').count();
            lines.saturating_sub(1)
        };
        // 200 images of some 110 rows each.
        let wanted = (self.rows as usize / 330).clamp(1, 60);
        while done() < wanted {
            if child.try_wait().is_ok_and(|status| status.is_some()) {
                return Err(vec![format!(
                    "{command:?}: ended before it could be killed"
                )]);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        // SIGKILL where there are signals.
        child
            .kill()
            .and_then(|()| child.wait())
            .map_err(|e| vec![format!("{command:?}: {e}")])?;
        Ok(done())
    }

    fn bytes(&self, name: &str) -> Result<Vec<u8>, Vec<String>> {
        let path = self.folder.join(name);
        fs::read(&path).map_err(|e| vec![format!("{}: {e}", path.display())])
    }
}

impl Cost {
    fn peak(&self) -> String {
        self.peak
            .map_or_else(|| "not told here".to_owned(), |mib| format!("{mib:.0} MiB"))
    }
}

fn same(found: &[u8], expected: &[u8]) -> &'static str {
    if found == expected {
        "the same bytes"
    } else {
        "OTHER BYTES"
    }
}

/// Peak of a process's resident memory so far, MiB; `None` where there is no `/proc`, or it has ended.
fn peak_memory(child: &Child) -> Option<f64> {
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.trim().strip_suffix(" kB")?.parse().ok()?;
    Some(kib / 1024.0)
}

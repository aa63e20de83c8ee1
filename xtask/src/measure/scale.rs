//! `cargo xtask scale`: many rows over generated images through `bop refine`, as a whole, on one
//! thread, killed and resumed, and in shards; or on Ray.

use std::fs;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail, ensure};

use crate::process::{cargo, execute, target};
use crate::{python, root};

/// 20 scenes of 10 images, 6 objects per image and 20 starts per object give more than 20,000 rows.
const GENERATE: &str =
    "bop generate --out data --scenes 20 --images 10 --instances 6 --starts 20 --seed 7";
const ROWS: usize = 20_000;
const REFINE: &str = "bop refine --dataset data --results data/initial_synthetic-test.csv --no-time \
                      --rescore mve --pipeline hybrid";

/// Runs `cargo xtask scale [--rows N] [--threads N] [--ray]`.
pub(crate) fn run(options: &[&str]) -> Result<()> {
    let (mut rows, mut threads, mut ray) = (ROWS, 1, false);
    let mut options = options.iter();
    while let Some(option) = options.next() {
        let count = match *option {
            "--ray" => {
                ray = true;
                continue;
            }
            "--rows" => &mut rows,
            "--threads" => &mut threads,
            _ => bail!("scale: expected --rows N, --threads N or --ray, found {option}"),
        };
        let number = options
            .next()
            .and_then(|text| text.parse().ok())
            .filter(|n| *n > 0);
        *count = number.with_context(|| format!("scale: {option} expects a number from 1"))?;
    }
    execute(&mut cargo("build --release --bin hybrid-icp"))?;
    let folder = target().join("scale");
    let scale = Scale {
        program: target().join("release/hybrid-icp"),
        folder,
        rows,
        threads,
    };
    scale.generate()?;
    let seconds = scale.refine("whole.csv", &format!("--limit {rows} --threads {threads}"))?;
    if ray {
        return scale.compare_with_ray(seconds);
    }
    scale.compare(seconds)
}

/// The runs of one command line.
struct Scale {
    program: PathBuf,
    /// The working folder, with the dataset in `data` and the output of the whole run in
    /// `whole.csv`.
    folder: PathBuf,
    rows: usize,
    threads: usize,
}

impl Scale {
    /// Generates the dataset, unless it is there already.
    fn generate(&self) -> Result<()> {
        let marker = self.folder.join("generated");
        if fs::read_to_string(&marker).is_ok_and(|command| command == GENERATE) {
            return Ok(());
        }
        let _ = fs::remove_dir_all(&self.folder);
        fs::create_dir_all(&self.folder)?;
        execute(self.command(GENERATE).current_dir(&self.folder))?;
        Ok(fs::write(marker, GENERATE)?)
    }

    /// Compares the output of the whole run, which took some seconds, with those of the other runs.
    fn compare(&self, seconds: f64) -> Result<()> {
        let (rows, threads) = (self.rows, self.threads);
        let limit = format!("--limit {rows} --threads {threads}");
        let expected = self.bytes("whole.csv")?;
        let single = self.refine("single.csv", &format!("--limit {rows} --threads 1"))?;
        println!(
            "{threads} threads are {:.2} times as fast as one",
            single / seconds
        );
        self.refine(
            "quarter.csv",
            &format!("--limit {} --threads {threads}", rows.div_ceil(4)),
        )?;
        self.kill("killed.csv", &limit)?;
        self.refine("killed.csv", &format!("{limit} --resume"))?;
        self.refine("shard1.csv", &format!("{limit} --shard 1/2"))?;
        self.refine("shard2.csv", &format!("{limit} --shard 2/2"))?;
        let [mut joined, second] = [self.bytes("shard1.csv")?, self.bytes("shard2.csv")?];
        // Without the header.
        joined.extend(
            second
                .splitn(2, |byte| *byte == b'\n')
                .nth(1)
                .unwrap_or_default(),
        );
        for (bytes, run) in [
            (self.bytes("single.csv")?, "one thread"),
            (self.bytes("killed.csv")?, "killed and resumed"),
            (joined, "two shards"),
        ] {
            ensure!(
                bytes == expected,
                "scale: {run}: the output differs from that of the whole run"
            );
            println!("{run}: the same bytes");
        }
        Ok(())
    }

    /// Runs the script that compares Ray on this machine with the output of the whole run, which
    /// took some seconds on as many threads.
    fn compare_with_ray(&self, seconds: f64) -> Result<()> {
        let python = python::with_module(&["--ray"], "release")?;
        let mut script = Command::new(python);
        script.arg(root().join(python::PACKAGE).join("benches/ray_scale.py"));
        script.args(["data", "data/initial_synthetic-test.csv", "whole.csv"]);
        for (option, value) in [
            ("--rows", self.rows.to_string()),
            ("--workers", self.threads.to_string()),
            ("--seconds", seconds.to_string()),
        ] {
            script.args([option, &value]);
        }
        execute(script.current_dir(&self.folder))
    }

    fn command(&self, words: &str) -> Command {
        let mut command = Command::new(&self.program);
        command
            .args(words.split_whitespace())
            .current_dir(&self.folder)
            .stdout(Stdio::null());
        command
    }

    fn start(&self, output: &str, options: &str) -> Result<Child> {
        let mut command = self.command(&format!("{REFINE} --output {output} {options}"));
        command.spawn().context(output.to_owned())
    }

    /// Refines to the end, prints time and peak memory, and returns the seconds.
    fn refine(&self, output: &str, options: &str) -> Result<f64> {
        let start = Instant::now();
        let mut child = self.start(output, options)?;
        let mut peak = String::new();
        let status = loop {
            peak = peak_memory(&child).unwrap_or(peak);
            match child.try_wait()? {
                None => std::thread::sleep(Duration::from_millis(20)),
                Some(status) => break status,
            }
        };
        ensure!(status.success(), "bop refine {options}: {status}");
        let seconds = start.elapsed().as_secs_f64();
        println!("bop refine {options}: {seconds:.1} s, peak memory {peak}");
        Ok(seconds)
    }

    /// Kills a run when about a third of the 200 images are in its journal.
    fn kill(&self, output: &str, options: &str) -> Result<()> {
        let journal = self.folder.join(format!("{output}.journal"));
        let _ = fs::remove_file(&journal);
        let mut child = self.start(output, options)?;
        let images = || {
            let text = fs::read(&journal).unwrap_or_default();
            text.iter()
                .filter(|byte| **byte == b'\n')
                .count()
                .saturating_sub(1)
        };
        while images() < (self.rows / 330).clamp(1, 60) {
            ensure!(
                child.try_wait()?.is_none(),
                "scale: the run ended before it could be killed"
            );
            std::thread::sleep(Duration::from_millis(5));
        }
        child.kill()?;
        child.wait()?;
        println!("killed with {} images in the journal", images());
        Ok(())
    }

    fn bytes(&self, name: &str) -> Result<Vec<u8>> {
        fs::read(self.folder.join(name)).context(name.to_owned())
    }
}

/// Returns the peak of the resident memory so far, or `None` without `/proc` or after the end.
fn peak_memory(child: &Child) -> Option<String> {
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).ok()?;
    let peak = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(peak.trim().to_owned())
}

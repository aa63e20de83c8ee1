//! Runs that are killed or interrupted, or whose disk is full.
//!
//! Existing files are kept, written files are complete, and a run can be continued.
#![cfg(unix)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::*;
use crate::world::*;
use hicp_io::LengthUnit;
use hicp_io::bop::{ResultRow, write_results};
use hicp_sim::Household;
use rand::RngExt as _;

type Files = BTreeMap<PathBuf, Vec<u8>>;

/// Returns all files below a folder.
fn files(folder: &Path) -> Files {
    let mut found = Files::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap().map(Result::unwrap) {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if let Ok(content) = std::fs::read(&path) {
                found.insert(path.strip_prefix(folder).unwrap().to_owned(), content);
            }
        }
    }
    found
}

/// A command that saves its work, with its outputs.
struct Job {
    folder: tempfile::TempDir,
    arguments: Vec<&'static str>,
    /// The folder of the outputs.
    out: &'static str,
    /// The output that grows row by row.
    grows: Option<&'static str>,
    /// The file that keeps the finished work.
    kept: &'static str,
}

fn bop_refine(rows: impl Fn(&World) -> Vec<ResultRow>) -> Job {
    let world = World::new();
    write_results(world.path("in.csv"), &rows(&world)).unwrap();
    let words =
        "bop refine --dataset . --results in.csv --output out/it --no-time --threads 1 --resume";
    Job {
        folder: world.folder,
        arguments: words.split(' ').collect(),
        out: "out",
        grows: None,
        kept: "it.journal",
    }
}

fn experiment(poses: &'static str) -> Job {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("meshes")).unwrap();
    let mesh = Household::Mug.solid().to_mesh().unwrap();
    hicp_io::write_ply(
        folder.path().join("meshes/mug.ply"),
        &mesh,
        LengthUnit::Meters,
    )
    .unwrap();
    let words =
        "experiment init-noise --objects meshes --no-times --threads 1 --out out --resume --poses";
    Job {
        folder,
        arguments: words.split(' ').chain([poses]).collect(),
        out: "out",
        grows: Some("cases.csv"),
        kept: "cases.csv",
    }
}

impl Job {
    fn out(&self) -> PathBuf {
        self.folder.path().join(self.out)
    }

    /// Empties the folder of the outputs.
    fn begin(&self) {
        let _ = std::fs::remove_dir_all(self.out());
        std::fs::create_dir(self.out()).unwrap();
    }

    fn spawn(&self) -> Child {
        program(self.folder.path())
            .args(&self.arguments)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    }

    fn finish(&self) -> Files {
        run(self.folder.path(), &self.arguments).exits(0);
        files(&self.out())
    }

    fn inputs(&self) -> Files {
        let mut all = files(self.folder.path());
        all.retain(|path, _| !path.starts_with(self.out));
        all
    }

    /// Asserts that every output equals that of the whole run or does not exist.
    #[track_caller]
    fn assert_whole_or_absent(&self, whole: &Files) {
        for (path, content) in files(&self.out()) {
            let name = path.to_string_lossy();
            if name.starts_with(".hicp-") || name.ends_with(".journal") {
                continue;
            }
            if self.grows == Some(&*name) {
                assert!(whole[&path].starts_with(&content), "{name}");
            } else {
                assert!(whole[&path] == content, "{name}: {} bytes", content.len());
            }
        }
    }

    /// Kills the run at `count` random moments, and asserts that it resumes to the same bytes.
    fn kill(&self, count: usize) {
        self.begin();
        let start = Instant::now();
        let whole = self.finish();
        let longest = start.elapsed();
        let inputs = self.inputs();
        let mut rng = hicp_sim::rng(9);
        let (mut killed, mut half_done) = (0, 0);
        while killed < count {
            self.begin();
            let mut child = self.spawn();
            std::thread::sleep(longest.mul_f64(rng.random_range(0.0..1.0)));
            child.kill().unwrap();
            // The run may have finished before.
            killed += usize::from(!child.wait().unwrap().success());
            self.assert_whole_or_absent(&whole);
            let kept = std::fs::read(self.out().join(self.kept)).unwrap_or_default();
            half_done += usize::from(kept.iter().filter(|byte| **byte == b'\n').count() > 1);
            let mut resumed = self.finish();
            // A killed run may leave temporary files, which nothing reads.
            resumed.retain(|path, _| !path.to_string_lossy().starts_with(".hicp-"));
            assert!(resumed == whole, "kill {killed}");
            assert!(self.inputs() == inputs, "kill {killed}");
        }
        println!(
            "{}: {killed} kills, {half_done} with finished work, all resumed to the same bytes",
            self.arguments[..2].join(" ")
        );
    }

    /// Interrupts a run, resumes it, and returns the time until the interrupted program ended.
    fn interrupt(&self, signal: &str) -> Duration {
        self.begin();
        let whole = self.finish();
        let (took, told) = self.interrupted(signal);
        assert!(told.contains("--resume"), "{told}");
        self.assert_whole_or_absent(&whole);
        assert!(self.finish() == whole);
        took
    }

    /// Sends a signal after some work is done.
    ///
    /// Returns the time until the program ended, and its standard error.
    fn interrupted(&self, signal: &str) -> (Duration, String) {
        self.begin();
        let mut child = self.spawn();
        let begun = Instant::now();
        let kept = self.out().join(self.kept);
        let lines = || {
            let text = std::fs::read(&kept).unwrap_or_default();
            text.iter().filter(|byte| **byte == b'\n').count()
        };
        while lines() < 2 {
            assert!(child.try_wait().unwrap().is_none(), "finished too early");
            assert!(begun.elapsed() < Duration::from_secs(300));
            std::thread::sleep(Duration::from_millis(1));
        }
        let sent = Instant::now();
        assert!(send(signal, &child));
        let output = child.wait_with_output().unwrap();
        let took = sent.elapsed();
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(130), "{told}");
        assert!(lines() >= 2);
        (took, told)
    }
}

#[test]
fn killed_at_a_few_random_moments() {
    bop_refine(|world| grouped(world, 6)).kill(3);
    experiment("10").kill(3);
}

/// The same test with more kills.
///
/// Run it with `cargo test --release -p hybrid-icp-cli --test it faults -- --ignored --nocapture`.
#[test]
#[ignore = "takes minutes"]
fn killed_at_fifty_random_moments() {
    bop_refine(|world| grouped(world, 12)).kill(50);
    experiment("10").kill(50);
}

#[test]
fn interrupted_runs_save_finished_work_and_name_the_option_to_continue() {
    for (job, signal) in [
        (bop_refine(grouped_for_signals), "-INT"),
        (bop_refine(grouped_for_signals), "-TERM"),
        (experiment("40"), "-INT"),
        (experiment("40"), "-TERM"),
    ] {
        let took = job.interrupt(signal);
        println!(
            "{} {signal}: ended after {took:?}",
            job.arguments[..2].join(" ")
        );
    }
}

/// `bop compare` has no `--resume`: the same command continues.
#[test]
fn an_interrupted_comparison_continues_with_the_same_command() {
    let refine = bop_refine(grouped_for_signals);
    let words = "bop compare --dataset . --init in.csv --pipelines hybrid --out out --threads 1";
    let job = Job {
        arguments: words.split(' ').collect(),
        kept: "hybrid.csv.journal",
        ..refine
    };
    let (_, told) = job.interrupted("-INT");
    assert!(told.contains("continue with the same command"), "{told}");
    let run = run(job.folder.path(), &job.arguments).exits(0);
    assert!(run.out.contains("frames from the journal"), "{}", run.out);
    assert!(!job.out().join(job.kept).exists());
}

/// Runs the program in a shell after another command.
///
/// If that command cannot run, prints a message and returns `None`.
fn in_shell(folder: &Path, user_namespace: bool, first: &str, arguments: &[&str]) -> Option<Run> {
    let script = format!("{first} || exit 99; exec \"$@\"");
    let mut words = Vec::new();
    if user_namespace {
        words.extend(["unshare", "-rm"]);
    }
    words.extend(["sh", "-c", &script, "sh", env!("CARGO_BIN_EXE_hybrid-icp")]);
    let output = Command::new(words[0])
        .args(&words[1..])
        .args(arguments)
        .current_dir(folder)
        .output();
    let ran = |code: Option<i32>, err: &str| match code {
        Some(99) => false,
        Some(1) => err.starts_with("error: "),
        _ => true,
    };
    match output {
        Ok(output)
            if ran(
                output.status.code(),
                &String::from_utf8_lossy(&output.stderr),
            ) =>
        {
            Some(Run {
                code: output.status.code().unwrap_or(-1),
                out: String::from_utf8_lossy(&output.stdout).into_owned(),
                err: String::from_utf8_lossy(&output.stderr).into_owned(),
            })
        }
        other => {
            println!("skipped: cannot run {first:?}: {other:?}");
            None
        }
    }
}

const REFINE: [&str; 15] = [
    "refine",
    "--model",
    "mesh.ply",
    "--model-unit=m",
    "--depth=depth.png",
    "--depth-scale=0.1",
    "--mask",
    "mask.png",
    "--camera",
    "camera.json",
    "--init",
    "init.json",
    "--output=disk/out.json",
    "--trace=disk/trace.jsonl",
    "--overlay=disk/overlay.png",
];

#[test]
fn a_full_disk_leaves_existing_files() {
    // A limit on the size of files simulates a full disk: writing fails in the middle of a file.
    let scene = Scene::new();
    std::fs::create_dir(scene.path("disk")).unwrap();
    for name in ["out.json", "trace.jsonl", "overlay.png"] {
        scene.write(&format!("disk/{name}"), "the user's");
    }
    let limit = "ulimit -f 1";
    if let Some(run) = in_shell(scene.folder.path(), false, limit, &REFINE) {
        run.exits(1)
            .complains(&["error: cannot write disk/", "too large"]);
        let names = names(&scene.path("disk"));
        assert_eq!(names, ["out.json", "overlay.png", "trace.jsonl"]);
        assert_eq!(
            std::fs::read(scene.path("disk/overlay.png")).unwrap(),
            b"the user's"
        );
    }
    // A run ends if its journal cannot grow. With free space, it can continue.
    let job = bop_refine(|world| grouped(world, 6));
    job.begin();
    let whole = job.finish();
    job.begin();
    if let Some(run) = in_shell(job.folder.path(), false, limit, &job.arguments) {
        run.exits(1).complains(&["cannot write", "too large"]);
        assert!(!job.out().join("it").exists());
        assert!(job.finish() == whole);
    }
    // If this user may mount, a small disk is filled.
    let disk = "mount -t tmpfs -o size=8k none disk && echo old > disk/out.json";
    if let Some(run) = in_shell(scene.folder.path(), true, disk, &REFINE) {
        run.exits(1)
            .complains(&["error: cannot write disk/", "No space left"]);
    }
    // Devices are written in place.
    if Path::new("/dev/full").exists() {
        let scene = Scene::new().with("--output", "/dev/full");
        scene
            .run()
            .exits(1)
            .complains(&["cannot write /dev/full", "No space left"]);
    }
}

#[test]
fn a_read_only_folder_is_reported_before_anything_is_computed() {
    let scene = Scene::new();
    std::fs::create_dir(scene.path("disk")).unwrap();
    let disk = "mount -t tmpfs none disk && echo old > disk/out.json && mount -o remount,ro disk";
    if let Some(run) = in_shell(scene.folder.path(), true, disk, &REFINE) {
        run.exits(1)
            .complains(&["error: cannot write disk/out.json", "Read-only"]);
    }
    let job = bop_refine(|world| grouped(world, 1));
    job.begin();
    let disk = "mount -t tmpfs none out && mount -o remount,ro out";
    if let Some(run) = in_shell(job.folder.path(), true, disk, &job.arguments) {
        run.exits(1)
            .complains(&["error: cannot write out/it", "Read-only"]);
    }
}

//! Runs that are killed or interrupted, or whose disk is full.
//!
//! Existing files are kept, written files are complete, and a run can be continued.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::*;
use hicp_io::LengthUnit;
use hicp_io::bop::{ResultRow, write_results};
use hicp_sim::Household;
use rand::RngExt as _;

/// The folder of the outputs of jobs.
const OUT: &str = "out";

/// A command that saves its work.
struct Job {
    folder: Folder,
    command: String,
    /// The output that grows row by row.
    grows: Option<&'static str>,
    /// The file that keeps the finished work.
    kept: &'static str,
}

fn bop_refine(rows: impl Fn(&World) -> Vec<ResultRow>) -> Job {
    let world = World::new();
    write_results(world.path("in.csv"), &rows(&world)).unwrap();
    let command =
        "bop refine --dataset . --results in.csv --output out/it --no-time --threads 1 --resume";
    Job {
        folder: world.folder,
        command: command.to_owned(),
        grows: None,
        kept: "it.journal",
    }
}

fn experiment(poses: u32) -> Job {
    let folder = Folder::new();
    folder.create_dir("meshes");
    let mesh = Household::Mug.solid().to_mesh().unwrap();
    hicp_io::write_ply(folder.path("meshes/mug.ply"), &mesh, LengthUnit::Meters).unwrap();
    let fixed = "experiment init-noise --objects meshes --no-times --threads 1 --out out --resume";
    Job {
        folder,
        command: format!("{fixed} --poses {poses}"),
        grows: Some("cases.csv"),
        kept: "cases.csv",
    }
}

impl Job {
    /// Returns the path of the file that keeps the finished work.
    fn kept(&self) -> PathBuf {
        self.folder.path(OUT).join(self.kept)
    }

    /// Empties the folder of the outputs.
    fn begin(&self) {
        let _ = std::fs::remove_dir_all(self.folder.path(OUT));
        self.folder.create_dir(OUT);
    }

    fn spawn(&self) -> Child {
        let mut program = program(self.folder.root());
        program.args(self.command.split(' '));
        program.stdout(Stdio::null()).stderr(Stdio::piped());
        program.spawn().unwrap()
    }

    fn finish(&self) -> Files {
        self.folder.command(&self.command).exits(0);
        self.folder.files(OUT)
    }

    fn inputs(&self) -> Files {
        let mut all = self.folder.files("");
        all.retain(|path, _| !path.starts_with(OUT));
        all
    }

    /// Asserts that every output equals that of the whole run or does not exist.
    #[track_caller]
    fn assert_whole_or_absent(&self, whole: &Files) {
        for (path, content) in self.folder.files(OUT) {
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
            half_done += usize::from(n_lines(&self.kept()) > 1);
            let mut resumed = self.finish();
            // A killed run may leave temporary files, which nothing reads.
            resumed.retain(|path, _| !path.to_string_lossy().starts_with(".hicp-"));
            assert!(resumed == whole, "kill {killed}");
            assert!(self.inputs() == inputs, "kill {killed}");
        }
        println!(
            "{}: {killed} kills, {half_done} with finished work, all resumed to the same bytes",
            self.command
        );
    }

    /// Interrupts a run by each of some signals, and asserts that it resumes to the same bytes.
    fn interrupt(&self, signals: &[&str]) {
        self.begin();
        let whole = self.finish();
        for signal in signals {
            let (took, told) = self.interrupted(signal);
            println!("{} {signal}: ended after {took:?}", self.command);
            assert_contains(&told, &["--resume"]);
            self.assert_whole_or_absent(&whole);
            assert!(self.finish() == whole);
        }
    }

    /// Sends a signal after some work is done.
    ///
    /// Returns the time until the program ended, and its standard error.
    fn interrupted(&self, signal: &str) -> (Duration, String) {
        self.begin();
        let mut child = self.spawn();
        let kept = self.kept();
        wait_for_lines(&mut child, &kept, 2);
        let sent = Instant::now();
        assert!(send(signal, &child));
        let output = child.wait_with_output().unwrap();
        let took = sent.elapsed();
        let told = Run::from(output).exits(130).err;
        assert!(n_lines(&kept) >= 2);
        (took, told)
    }
}

#[test]
fn killed_at_a_few_random_moments() {
    bop_refine(|world| grouped(world, 6)).kill(3);
    experiment(10).kill(3);
}

/// The same test with more kills.
///
/// Run it with `cargo test --release -p hybrid-icp-cli --test it faults -- --ignored --nocapture`.
#[test]
#[ignore = "takes minutes"]
fn killed_at_fifty_random_moments() {
    bop_refine(|world| grouped(world, 12)).kill(50);
    experiment(10).kill(50);
}

#[test]
fn interrupted_runs_save_finished_work_and_name_the_option_to_continue() {
    bop_refine(grouped_for_signals).interrupt(&["-INT", "-TERM"]);
    experiment(15).interrupt(&["-INT", "-TERM"]);
}

/// `bop compare` has no `--resume`: the same command continues, and finished pipelines are not
/// repeated.
#[test]
fn an_interrupted_comparison_continues_with_the_same_command() {
    let refine = bop_refine(grouped_for_signals);
    let words =
        "bop compare --dataset . --init in.csv --pipelines hybrid,local --out out --threads 1";
    let job = Job {
        command: words.to_owned(),
        kept: "local.csv.journal",
        ..refine
    };
    let (_, told) = job.interrupted("-INT");
    assert_contains(&told, &["continue with the same command"]);
    let first = job.folder.bytes("out/hybrid.csv");
    let run = job.folder.command(&job.command).exits(0);
    let resumed = run.out.matches("frames from the journal").count();
    assert_eq!(resumed, 3, "{}", run.out);
    // It has the times of the first run.
    assert_eq!(job.folder.bytes("out/hybrid.csv"), first);
    let mut names = job.folder.names("out").into_iter();
    assert!(!names.any(|name| name.ends_with(".journal")));
}

/// Runs the program in a shell after another command.
///
/// If that command cannot run, prints a message and returns `None`.
fn in_shell(folder: &Path, user_namespace: bool, first: &str, words: &str) -> Option<Run> {
    let script = format!("{first} || exit 99; exec \"$@\"");
    let mut shell = vec!["sh", "-c", &script, "sh", env!("CARGO_BIN_EXE_hybrid-icp")];
    if user_namespace {
        shell.splice(..0, ["unshare", "-rm"]);
    }
    let mut command = Command::new(shell[0]);
    let command = command.args(&shell[1..]).args(words.split_whitespace());
    let run = command.current_dir(folder).output().map(Run::from);
    match run {
        Ok(run) if run.code != 99 && (run.code != 1 || run.err.starts_with("error: ")) => Some(run),
        other => {
            println!("skipped: cannot run {first:?}: {other:?}");
            None
        }
    }
}

const REFINE: &str = "refine --model mesh.ply --model-unit m --depth depth.png --depth-scale 0.1 \
    --mask mask.png --camera camera.json --init init.json --output disk/out.json \
    --trace disk/trace.jsonl --overlay disk/overlay.png";

#[test]
fn a_full_disk_leaves_existing_files() {
    // A limit on the size of files simulates a full disk: writing fails in the middle of a file.
    let scene = Scene::new();
    scene.create_dir("disk");
    for name in ["out.json", "trace.jsonl", "overlay.png"] {
        scene.write(format!("disk/{name}"), "the user's");
    }
    let limit = "ulimit -f 1";
    if let Some(run) = in_shell(scene.root(), false, limit, REFINE) {
        run.fails(&["error: cannot write disk/", "too large"]);
        let names = scene.names("disk");
        assert_eq!(names, ["out.json", "overlay.png", "trace.jsonl"]);
        assert_eq!(scene.bytes("disk/overlay.png"), b"the user's");
    }
    // A run ends if its journal cannot grow. With free space, it can continue.
    let job = bop_refine(|world| grouped(world, 6));
    job.begin();
    let whole = job.finish();
    job.begin();
    if let Some(run) = in_shell(job.folder.root(), false, limit, &job.command) {
        run.fails(&["cannot write", "too large"]);
        assert!(!job.folder.path("out/it").exists());
        assert!(job.finish() == whole);
    }
    // If this user may mount, a small disk is filled.
    let disk = "mount -t tmpfs -o size=8k none disk && echo old > disk/out.json";
    if let Some(run) = in_shell(scene.root(), true, disk, REFINE) {
        run.fails(&["error: cannot write disk/", "No space left"]);
    }
    // Devices are written in place.
    if Path::new("/dev/full").exists() {
        let scene = Scene::new().with("--output", "/dev/full");
        scene
            .run()
            .fails(&["cannot write /dev/full", "No space left"]);
    }
}

#[test]
fn a_read_only_folder_is_reported_before_anything_is_computed() {
    let scene = Scene::new();
    scene.create_dir("disk");
    let disk = "mount -t tmpfs none disk && echo old > disk/out.json && mount -o remount,ro disk";
    if let Some(run) = in_shell(scene.root(), true, disk, REFINE) {
        run.fails(&["error: cannot write disk/out.json", "Read-only"]);
    }
    let job = bop_refine(|world| grouped(world, 1));
    job.begin();
    let disk = "mount -t tmpfs none out && mount -o remount,ro out";
    if let Some(run) = in_shell(job.folder.root(), true, disk, &job.command) {
        run.fails(&["error: cannot write out/it", "Read-only"]);
    }
}

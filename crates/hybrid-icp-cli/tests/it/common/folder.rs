//! A temporary folder, and runs of the program in it.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output};
use std::time::{Duration, Instant};

use serde_json::Value;

/// Contents of files by their paths below a folder.
pub(crate) type Files = BTreeMap<PathBuf, Vec<u8>>;

/// A temporary folder. Names are paths below it.
pub(crate) struct Folder(tempfile::TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(crate) fn root(&self) -> &Path {
        self.0.path()
    }

    pub(crate) fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.root().join(name)
    }

    #[track_caller]
    pub(crate) fn write(&self, name: impl AsRef<Path>, content: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), content).unwrap();
    }

    #[track_caller]
    pub(crate) fn create_dir(&self, name: impl AsRef<Path>) {
        std::fs::create_dir_all(self.path(name)).unwrap();
    }

    #[track_caller]
    pub(crate) fn remove(&self, name: impl AsRef<Path>) {
        std::fs::remove_file(self.path(name)).unwrap();
    }

    #[track_caller]
    pub(crate) fn bytes(&self, name: impl AsRef<Path>) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap()
    }

    #[track_caller]
    pub(crate) fn read(&self, name: impl AsRef<Path>) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    #[track_caller]
    pub(crate) fn json(&self, name: impl AsRef<Path>) -> Value {
        serde_json::from_slice(&self.bytes(name)).unwrap()
    }

    /// Reads a file with a JSON value per line.
    #[track_caller]
    pub(crate) fn json_lines(&self, name: impl AsRef<Path>) -> Vec<Value> {
        let text = self.read(name);
        let lines = text.lines().map(serde_json::from_str);
        lines.collect::<Result<_, _>>().unwrap()
    }

    /// Replaces a text that a file contains.
    #[track_caller]
    pub(crate) fn replace(&self, name: impl AsRef<Path>, from: &str, to: &str) {
        let text = self.read(&name);
        assert_contains(&text, &[from]);
        self.write(name, text.replace(from, to));
    }

    /// Changes the value in a JSON file.
    #[track_caller]
    pub(crate) fn change_json(&self, name: impl AsRef<Path>, change: impl FnOnce(&mut Value)) {
        let mut value = self.json(&name);
        change(&mut value);
        self.write(name, value.to_string());
    }

    /// Returns the sorted names in a folder below this one, or in this one if the name is empty.
    pub(crate) fn names(&self, name: impl AsRef<Path>) -> Vec<String> {
        let entries = std::fs::read_dir(self.path(name)).unwrap();
        let mut names: Vec<String> = entries
            .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    /// Returns all files below a folder, of which there are none if it does not exist.
    pub(crate) fn files(&self, name: impl AsRef<Path>) -> Files {
        let folder = self.path(name);
        let mut found = Files::new();
        let mut folders = vec![folder.clone()];
        while let Some(next) = folders.pop() {
            for entry in std::fs::read_dir(next).into_iter().flatten() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                } else if let Ok(content) = std::fs::read(&path) {
                    found.insert(path.strip_prefix(&folder).unwrap().to_owned(), content);
                }
            }
        }
        found
    }

    /// Runs the program with the words of a line.
    #[track_caller]
    pub(crate) fn command(&self, line: impl AsRef<str>) -> Run {
        run(self.root(), line.as_ref().split_whitespace())
    }
}

/// The exit code and the printed text of a run of the program.
#[derive(Debug)]
pub(crate) struct Run {
    pub(crate) code: i32,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl From<Output> for Run {
    fn from(output: Output) -> Self {
        Self {
            code: output.status.code().unwrap_or(-1),
            out: String::from_utf8(output.stdout).unwrap(),
            err: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }
}

impl Run {
    /// Asserts the exit code.
    #[track_caller]
    pub(crate) fn exits(self, code: i32) -> Self {
        assert_eq!(self.code, code, "{}\n{}", self.out, self.err);
        self
    }

    /// Asserts that standard error contains all of these texts.
    #[track_caller]
    pub(crate) fn complains(self, parts: &[&str]) -> Self {
        assert_contains(&self.err, parts);
        self
    }

    /// Returns the printed JSON.
    #[track_caller]
    pub(crate) fn json(&self) -> Value {
        serde_json::from_str(&self.out).unwrap()
    }

    /// Asserts that standard output contains all of these texts.
    #[track_caller]
    pub(crate) fn prints(&self, parts: &[&str]) {
        assert_contains(&self.out, parts);
    }

    /// Asserts success, and that standard error contains all of these texts.
    #[track_caller]
    pub(crate) fn warns(self, parts: &[&str]) -> Self {
        self.exits(0).complains(parts)
    }

    /// Asserts a failure, and that standard error contains all of these texts.
    #[track_caller]
    pub(crate) fn fails(self, parts: &[&str]) -> Self {
        self.exits(1).complains(parts)
    }

    /// Asserts that the command line is wrong, and that standard error contains all of these texts.
    #[track_caller]
    pub(crate) fn refuses(self, parts: &[&str]) -> Self {
        self.exits(2).complains(parts)
    }
}

/// Asserts that a text contains all of these parts.
#[track_caller]
pub(crate) fn assert_contains(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "no {part:?} in: {text}");
    }
}

/// Returns a command that runs the program in a folder.
pub(crate) fn program(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hybrid-icp"));
    command
        .current_dir(folder)
        .env("COLUMNS", "80")
        .env_remove("CLICOLOR_FORCE");
    command
}

/// Runs the program in a folder, and asserts that it does not panic.
#[track_caller]
pub(crate) fn run<I, S>(folder: &Path, words: I) -> Run
where
    I: IntoIterator<Item = S>,
    S: AsRef<OsStr>,
{
    let run = Run::from(program(folder).args(words).output().unwrap());
    assert!(!run.err.contains("panicked"), "{}", run.err);
    assert_ne!(run.code, -1, "ended by a signal");
    run
}

/// Runs the examples of a text in a shell that finds the program.
#[track_caller]
pub(crate) fn run_script(folder: &Path, script: &str, from: &str) {
    let program = Path::new(env!("CARGO_BIN_EXE_hybrid-icp")).parent();
    let others = std::env::var("PATH").unwrap();
    let path = format!("{}:{others}", program.unwrap().display());
    let mut shell = Command::new("sh");
    shell.args(["-e", "-c", script]).env("PATH", path);
    let run = Run::from(shell.current_dir(folder).output().unwrap());
    assert_eq!(run.code, 0, "{from}: {script}\n{}", run.err);
}

/// Sends a signal such as `-INT`, and returns whether the process still existed.
///
/// Uses the shell, because some systems have no program `kill`.
pub(crate) fn send(signal: &str, child: &Child) -> bool {
    let kill = ["-c", "kill \"$0\" \"$1\" 2>/dev/null", signal];
    let mut shell = Command::new("sh");
    let status = shell.args(kill).arg(child.id().to_string()).status();
    status.unwrap().success()
}

/// Returns the number of complete lines of a file; 0 if it does not exist.
pub(crate) fn n_lines(path: &Path) -> usize {
    let text = std::fs::read(path).unwrap_or_default();
    text.iter().filter(|byte| **byte == b'\n').count()
}

/// Waits until a running program has written some lines to a file.
#[track_caller]
pub(crate) fn wait_for_lines(child: &mut Child, path: &Path, count: usize) {
    let start = Instant::now();
    while n_lines(path) < count {
        assert!(child.try_wait().unwrap().is_none(), "finished too early");
        assert!(start.elapsed() < Duration::from_secs(300));
        std::thread::sleep(Duration::from_millis(1));
    }
}

//! Folders in which tests run studies, and errors that they expect.

use std::fmt::Display;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use hicp_experiments::{Design, ExperimentError, RunOptions, StudyOf, Subject, run};
use hicp_sim::Household;

/// Returns the mug and the book.
pub(crate) fn subjects() -> Vec<Subject> {
    Subject::household(&[Household::Mug, Household::Book]).unwrap()
}

/// A temporary folder.
pub(crate) struct Folder(tempfile::TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// Creates a folder with a finished study.
    pub(crate) fn with<D: Design>(config: &D, threads: usize) -> Self {
        let folder = Self::new();
        folder.run(config, threads, false).unwrap();
        folder
    }

    pub(crate) fn root(&self) -> &Path {
        self.0.path()
    }

    pub(crate) fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.root().join(name)
    }

    pub(crate) fn write(&self, name: impl AsRef<Path>, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), bytes).unwrap();
    }

    pub(crate) fn bytes(&self, name: impl AsRef<Path>) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap()
    }

    pub(crate) fn text(&self, name: impl AsRef<Path>) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    /// Runs a study of household objects.
    pub(crate) fn run<D: Design>(
        &self,
        config: &D,
        threads: usize,
        resume: bool,
    ) -> Result<(), ExperimentError> {
        let options = RunOptions {
            threads,
            resume,
            ..RunOptions::default()
        };
        let objects = config.layout().objects;
        let is_in = |household: &Household| objects.iter().any(|o| o.name == household.name());
        let objects: Vec<Household> = Household::ALL.into_iter().filter(is_in).collect();
        let subjects = Subject::household(&objects)?;
        run(config, &subjects, self.root(), options, &mut |_| {
            ControlFlow::Continue(())
        })
    }

    /// Reads the study.
    pub(crate) fn study<D: Design>(&self) -> StudyOf<D> {
        StudyOf::read(self.root()).unwrap()
    }
}

/// Asserts that a text contains all of these parts.
#[track_caller]
pub(crate) fn assert_contains(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "no {part:?} in: {text}");
    }
}

/// Asserts an error whose message contains all of these parts.
#[track_caller]
pub(crate) fn refused<T>(result: Result<T, impl Display>, parts: &[&str]) {
    let Err(error) = result else {
        panic!("accepted, expected an error with {parts:?}");
    };
    assert_contains(&error.to_string(), parts);
}

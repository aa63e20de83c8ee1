//! Running a study into a folder, and reading one back.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{Seek, SeekFrom, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;

use hicp_io::write_atomically;

use crate::config::Config;
use crate::error::ExperimentError;
use crate::row::{self, Row};
use crate::runner::{Reconstructions, Runner};
use crate::subject::Subject;

/// Name of the file of rows.
pub const CASES_FILE: &str = "cases.csv";
/// Name of the file of the configuration.
pub const CONFIG_FILE: &str = "config.json";

/// How a study is run; none of it changes its rows, but for the times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RunOptions {
    /// Number of threads, at least 1.
    pub threads: usize,
    /// Go on with what the folder holds.
    pub resume: bool,
}

/// A study that has been run: what it was, and its rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Study {
    /// The configuration.
    pub config: Config,
    /// The rows: objects in order, in each the cases, in each the levels, in each the variants.
    pub rows: Vec<Row>,
}

/// Runs a study into a folder: `config.json`, and `cases.csv`, which grows case by case.
///
/// The rows of a case are written whole and in order, whatever the number of threads. `progress` is told the number of cases done
/// so far, now and then; `Break` stops the study. A study that was killed or stopped goes on where it was with `resume`: rows
/// that are there stay as they are, a case that was cut in the middle is made again, and the file ends with the same bytes as
/// without the interruption, but for the column of times, which no two runs share.
///
/// # Errors
///
/// [`ExperimentError`] when the folder holds another study, a file cannot be written, or a pipeline cannot be built. A case that
/// cannot be made (a bin that cannot be filled, a reconstruction of nothing) is no error: its rows say `not_made`, and why.
pub fn run(
    config: &Config,
    subjects: &[Subject],
    folder: &Path,
    options: RunOptions,
    progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
) -> Result<(), ExperimentError> {
    std::fs::create_dir_all(folder).map_err(ExperimentError::file(folder))?;
    let path = folder.join(CASES_FILE);
    let (mut file, first) = open(config, folder, &path, options.resume)?;
    let total = config.n_cases();
    if progress(first).is_break() {
        return Err(ExperimentError::Stopped { cases: first });
    }
    let reconstructions = Reconstructions::new(subjects.len());
    let next = AtomicUsize::new(first);
    let stop = AtomicBool::new(false);
    let (sender, receiver) = mpsc::channel();
    std::thread::scope(|scope| {
        for _ in 0..options.threads.max(1) {
            let sender = sender.clone();
            let (next, stop, reconstructions) = (&next, &stop, &reconstructions);
            scope.spawn(move || {
                let mut runner = match Runner::new(config, subjects, reconstructions) {
                    Ok(runner) => runner,
                    Err(error) => {
                        let _ = sender.send(Err(error));
                        return;
                    }
                };
                loop {
                    let case = next.fetch_add(1, Ordering::Relaxed);
                    if case >= total || stop.load(Ordering::Relaxed) {
                        return;
                    }
                    let (object, index) = place(config, case);
                    let rows = runner.rows(object, index);
                    let text = row::to_csv(rows.iter().map(Row::fields));
                    if sender.send(Ok((case, text))).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        let written = write_in_order(&receiver, &mut file, &path, first, progress);
        stop.store(true, Ordering::Relaxed);
        written
    })
}

/// Writes the rows of cases as they come, in the order of the cases.
fn write_in_order(
    receiver: &mpsc::Receiver<Result<(usize, Vec<u8>), ExperimentError>>,
    file: &mut File,
    path: &Path,
    first: usize,
    progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
) -> Result<(), ExperimentError> {
    let mut early: BTreeMap<usize, Vec<u8>> = BTreeMap::new();
    let mut next = first;
    for message in receiver {
        let (case, text) = message?;
        early.insert(case, text);
        while let Some(text) = early.remove(&next) {
            file.write_all(&text).map_err(ExperimentError::file(path))?;
            next += 1;
            if progress(next).is_break() {
                return Err(ExperimentError::Stopped { cases: next });
            }
        }
    }
    file.sync_all().map_err(ExperimentError::file(path))
}

/// The object and the index of a case among all.
fn place(config: &Config, case: usize) -> (usize, u64) {
    let poses = usize::try_from(config.poses).unwrap_or(usize::MAX);
    (case / poses, (case % poses) as u64)
}

/// Opens the file of rows at its end; returns the first case that is not in it.
fn open(
    config: &Config,
    folder: &Path,
    path: &Path,
    resume: bool,
) -> Result<(File, usize), ExperimentError> {
    let stored = folder.join(CONFIG_FILE);
    if !path.exists() {
        write_atomically(&stored, |w| w.write_all(config.to_json().as_bytes()))?;
        let mut file = File::create(path).map_err(ExperimentError::file(path))?;
        file.write_all(&row::header())
            .map_err(ExperimentError::file(path))?;
        return Ok((file, 0));
    }
    if !resume {
        return Err(ExperimentError::AlreadyThere {
            path: path.to_owned(),
        });
    }
    if let Some(difference) = config.difference(&Config::read(&stored)?) {
        return Err(ExperimentError::OtherConfiguration {
            path: stored,
            difference,
        });
    }
    let bytes = std::fs::read(path).map_err(ExperimentError::file(path))?;
    let (whole, cases) = whole_cases(config, &bytes);
    let mut file = OpenOptions::new()
        .write(true)
        .open(path)
        .map_err(ExperimentError::file(path))?;
    file.set_len(whole as u64)
        .map_err(ExperimentError::file(path))?;
    if whole == 0 {
        file.write_all(&row::header())
            .map_err(ExperimentError::file(path))?;
    }
    file.seek(SeekFrom::End(0))
        .map_err(ExperimentError::file(path))?;
    Ok((file, cases))
}

/// Returns where the last whole case ends, and how many cases are whole; 0 bytes when not even the header is.
fn whole_cases(config: &Config, bytes: &[u8]) -> (usize, usize) {
    let header = row::header();
    if !bytes.starts_with(&header) {
        return (0, 0);
    }
    let mut end = header.len();
    let (mut cases, mut rows) = (0, 0);
    let mut quoted = false;
    for (position, byte) in bytes.iter().enumerate().skip(header.len()) {
        match byte {
            b'"' => quoted = !quoted,
            b'\n' if !quoted => {
                rows += 1;
                if rows % config.rows_per_case() == 0 {
                    (end, cases) = (position + 1, cases + 1);
                }
            }
            _ => {}
        }
    }
    (end, cases)
}

impl Study {
    /// Reads a study from its folder; one that is not finished may be looked at too.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] when a file is missing or is not what [`run`] wrote.
    pub fn read(folder: &Path) -> Result<Self, ExperimentError> {
        let path: PathBuf = folder.join(CASES_FILE);
        let study = Self {
            config: Config::read(&folder.join(CONFIG_FILE))?,
            rows: row::read(&path)?,
        };
        if study.rows.iter().all(|row| row.measured.is_none()) {
            return Err(ExperimentError::Empty { path });
        }
        Ok(study)
    }
}

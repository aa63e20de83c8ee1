//! Running a study into a folder.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;

use hicp_io::{IoErrorKind, ReadLimits, RowLog, is_absent, write_atomically};

use super::design::Design;
use super::fields::Fields;
use super::models::Models;
use super::row::{Columns, Row, header};
use super::stored::{CONFIG_FILE, check_order, read_config};
use crate::error::ExperimentError;
use crate::subject::Subject;

/// How a study is run. The rows do not depend on it, except for the times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RunOptions {
    /// Number of threads; 0 counts as 1.
    pub threads: usize,
    /// Continue with what the folder holds.
    pub resume: bool,
    /// Limits on what is read from the folder.
    pub limits: ReadLimits,
}

/// Runs a study into a folder: `config.json`, and the file of rows, which grows case by case.
///
/// The rows of a case are written together and in order, whatever the number of threads. `progress`
/// is called with the number of finished cases; `Break` stops the study.
///
/// A study that was killed or stopped continues with `resume`: finished cases are kept, an
/// incomplete one is computed again. The file ends with the same bytes as without the interruption,
/// except for measured times.
///
/// # Errors
///
/// [`ExperimentError`] when the configuration is invalid, the folder holds another study or rows
/// that the study cannot have, a file cannot be written, or a pipeline cannot be built. A case that
/// cannot be made (a bin that cannot be filled, an empty reconstruction) is not an error: its rows
/// have no figures, and state the reason.
pub fn run<D: Design>(
    config: &D,
    subjects: &[Subject],
    folder: &Path,
    options: RunOptions,
    progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
) -> Result<(), ExperimentError> {
    let stored = folder.join(CONFIG_FILE);
    config.check(Fields::of(&stored))?;
    let models = Models::new(subjects.len());
    // Report a pipeline that cannot be built before there is a file.
    drop(config.worker(subjects, &models)?);
    std::fs::create_dir_all(folder).map_err(ExperimentError::file(folder))?;
    let (log, first) = open(config, folder, options)?;
    let mut report = |cases| match progress(cases) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(ExperimentError::Stopped { cases }),
    };
    report(first)?;
    let layout = config.layout();
    let next = AtomicUsize::new(first);
    std::thread::scope(|scope| {
        let (sender, receiver) = mpsc::channel();
        for _ in 0..options.threads.max(1) {
            let (sender, next, layout, models) = (sender.clone(), &next, &layout, &models);
            scope.spawn(move || {
                let mut worker = match config.worker(subjects, models) {
                    Ok(worker) => worker,
                    Err(error) => return drop(sender.send(Err(error))),
                };
                loop {
                    let n = next.fetch_add(1, Ordering::Relaxed);
                    if n >= layout.n_cases() {
                        return;
                    }
                    let (object, case) = layout.case(n);
                    let rows = layout.rows(object, case, worker(object, case));
                    // The receiver is gone when the study stops.
                    if sender.send(Ok((n, rows))).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        write_in_order(D::COLUMNS, &log, receiver, first, &mut report)
    })
}

/// Writes the rows of cases in the order of the cases.
fn write_in_order(
    columns: &Columns,
    log: &RowLog,
    receiver: mpsc::Receiver<Result<(usize, Vec<Row>), ExperimentError>>,
    first: usize,
    report: &mut dyn FnMut(usize) -> Result<(), ExperimentError>,
) -> Result<(), ExperimentError> {
    let (mut early, mut cases) = (BTreeMap::new(), first);
    for message in receiver {
        let (case, rows) = message?;
        early.insert(case, rows);
        while let Some(rows) = early.remove(&cases) {
            log.append(Row::to_csv(columns, &rows).trim_end_matches('\n'))?;
            cases += 1;
            report(cases)?;
        }
    }
    Ok(log.sync()?)
}

/// Opens the file of rows; returns the number of cases in it.
fn open<D: Design>(
    config: &D,
    folder: &Path,
    options: RunOptions,
) -> Result<(RowLog, usize), ExperimentError> {
    let (path, stored) = (folder.join(D::ROWS_FILE), folder.join(CONFIG_FILE));
    let ours = serde_json::to_string_pretty(config).unwrap_or_default() + "\n";
    if is_absent(&path) {
        write_atomically(&stored, |w| w.write_all(ours.as_bytes()))?;
    } else if !options.resume {
        return Err(ExperimentError::AlreadyThere { path });
    } else {
        // Compare what this version would write.
        let theirs: D = read_config(&options.limits, &stored)?;
        let theirs = serde_json::to_string_pretty(&theirs).unwrap_or_default() + "\n";
        if let Some(difference) = difference(&ours, &theirs) {
            let path = stored;
            return Err(ExperimentError::OtherConfiguration { path, difference });
        }
    }
    let (header, rows_per_case) = (header(D::COLUMNS), config.layout().rows_per_case());
    let resumed = RowLog::resume(&path, header.trim_end(), rows_per_case, &options.limits);
    let (log, cases) = resumed.map_err(|error| match options.limits.read_text(&path) {
        Err(encoding) if encoding.kind == IoErrorKind::Encoding => encoding,
        _ => error,
    })?;
    let text = header + &cases.join("\n");
    check_order(config, &options.limits, &path, &text, cases.len())?;
    Ok((log, cases.len()))
}

/// Returns the first lines in which two configurations differ; `None` if they are equal.
fn difference(ours: &str, theirs: &str) -> Option<String> {
    let (mut ours, mut theirs) = (ours.lines(), theirs.lines());
    loop {
        let (ours, theirs) = (ours.next(), theirs.next());
        if ours != theirs {
            let text = |line: Option<&str>| match line {
                Some(line) => line.trim().trim_end_matches(',').to_owned(),
                None => "nothing".to_owned(),
            };
            return Some(format!("{} there, {} now", text(theirs), text(ours)));
        }
        ours?;
    }
}

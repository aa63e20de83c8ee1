//! Running a study into a folder.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;

use hicp_io::{IoError, IoErrorKind, Place, ReadLimits, RowLog, is_absent, write_atomically};

use super::design::Design;
use super::fields::Fields;
use super::models::Models;
use super::row::Row;
use super::stored::{CONFIG_FILE, parse_rows, read_config};
use crate::error::ExperimentError;
use crate::subject::Subject;

/// Options of a run. Except for the times, the rows do not depend on them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RunOptions {
    /// Number of threads; 0 counts as 1.
    pub threads: usize,
    /// If `true`, continues the study in the folder.
    pub resume: bool,
    /// Limits on the files that are read from the folder.
    pub limits: ReadLimits,
}

/// Runs a study and writes `config.json` and the file of rows into a folder.
///
/// The file of rows grows case by case, in the same order on any number of threads. `progress` is
/// called with the number of finished cases; `Break` stops the study.
///
/// With `resume`, a study that was killed or stopped continues: finished cases are kept, and an
/// incomplete one is computed again. Except for measured times, the file has the same bytes as
/// without the interruption.
///
/// # Errors
///
/// [`ExperimentError`] when the configuration is invalid, the folder holds another study or rows
/// that the study cannot have, a file cannot be written, or a pipeline cannot be built. A case that
/// cannot be created is not an error: its rows have no figures and state the reason, for example a
/// bin that cannot be filled or an empty reconstruction.
pub fn run<D: Design>(
    config: &D,
    subjects: &[Subject],
    folder: &Path,
    options: RunOptions,
    progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
) -> Result<(), ExperimentError> {
    let stored = folder.join(CONFIG_FILE);
    config.check(&Fields::of(&stored, config))?;
    let models = Models::new(subjects.len());
    // Report a pipeline that cannot be built before there is a file.
    drop(config.worker(subjects, &models)?);
    std::fs::create_dir_all(folder).map_err(ExperimentError::folder(folder))?;
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
                    let rows = layout.rows(n, worker(object, case));
                    // The receiver is gone when the study stops.
                    if sender.send(Ok((n, rows))).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        // Write the rows of the cases in the order of the cases.
        let (mut early, mut cases) = (BTreeMap::new(), first);
        for message in receiver {
            let (case, rows) = message?;
            early.insert(case, rows);
            while let Some(rows) = early.remove(&cases) {
                log.append(Row::to_csv(D::COLUMNS, &rows).trim_end_matches('\n'))?;
                cases += 1;
                report(cases)?;
            }
        }
        Ok(log.sync()?)
    })
}

/// Opens the file of rows, and returns the number of cases in it.
fn open<D: Design>(
    config: &D,
    folder: &Path,
    options: RunOptions,
) -> Result<(RowLog, usize), ExperimentError> {
    let (path, stored) = (folder.join(D::ROWS_FILE), folder.join(CONFIG_FILE));
    let limits = &options.limits;
    let text = |config: &D| serde_json::to_string_pretty(config).unwrap_or_default() + "\n";
    let ours = text(config);
    if is_absent(&path) {
        write_atomically(&stored, |w| w.write_all(ours.as_bytes()))?;
    } else if !options.resume {
        let (found, expected) = ("the rows of a study", "another folder, or --resume");
        return Err(IoError::new(path, None, found, expected).into());
    } else {
        // Compare both configurations as this version writes them.
        let theirs = text(&read_config(limits, &stored)?);
        let lines = theirs.lines().zip(ours.lines()).zip(1..);
        let mut different = lines.filter(|((theirs, ours), _)| theirs != ours);
        if let Some(((theirs, ours), line)) = different.next() {
            let [found, ours] = [theirs, ours].map(|line| line.trim().trim_end_matches(','));
            let expected =
                format!("{ours}, as in the command that started the study, or another folder");
            return Err(IoError::new(stored, Place::Line(line), found, expected).into());
        }
    }
    let rows_per_case = config.layout().rows_per_case();
    let resumed = RowLog::resume(&path, D::COLUMNS, rows_per_case, limits);
    let (log, cases) = resumed.map_err(|error| match limits.read_text(&path) {
        Err(encoding) if encoding.kind == IoErrorKind::Encoding => encoding,
        _ => error,
    })?;
    let text = format!("{}\n{}", D::COLUMNS, cases.join("\n"));
    let rows = parse_rows(config, limits, &path, &text)?.len();
    if rows != cases.len() * rows_per_case {
        let expected = format!("{}, one per line", cases.len() * rows_per_case);
        return Err(IoError::new(path, None, format!("{rows} rows"), expected).into());
    }
    Ok((log, cases.len()))
}

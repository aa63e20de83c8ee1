//! Running a study into a folder, and reading one back.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use hicp_io::ReadLimits;

use crate::config::Config;
use crate::error::ExperimentError;
use crate::row::{self, Row};
use crate::runner::{Reconstructions, Runner};
use crate::streaming::Sheet;
use crate::subject::Subject;

/// Name of the file of rows.
pub const CASES_FILE: &str = "cases.csv";
/// Name of the file of the configuration.
pub const CONFIG_FILE: &str = "config.json";

/// How a study is run; none of it changes its rows, but for the times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RunOptions {
    /// Number of threads; 0 counts as 1.
    pub threads: usize,
    /// Go on with what the folder holds.
    pub resume: bool,
    /// How much of what the folder holds is read.
    pub limits: ReadLimits,
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
/// [`ExperimentError`] when the configuration could not be read back, the folder holds another study or rows that the study cannot have, a
/// file cannot be written, or a pipeline cannot be built. A case that
/// cannot be made (a bin that cannot be filled, a reconstruction of nothing) is no error: its rows say `not_made`, and why.
pub fn run(
    config: &Config,
    subjects: &[Subject],
    folder: &Path,
    options: RunOptions,
    progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
) -> Result<(), ExperimentError> {
    config.check(&folder.join(CONFIG_FILE))?;
    let reconstructions = Reconstructions::new(subjects.len());
    let sheet = Sheet {
        folder,
        name: CASES_FILE,
        header: row::header(),
        rows_per_case: config.rows_per_case(),
        cases: config.n_cases(),
        config: config.to_json(),
        stored: |limits, path| Ok(Config::read(limits, path)?.to_json()),
        check: &|path, text| row::count(&options.limits, path, text, config),
    };
    sheet.fill(
        options,
        &|| Runner::new(config, subjects, &reconstructions),
        &|runner, case| {
            let (object, index) = place(config, case);
            row::to_csv(runner.rows(object, index).iter().map(Row::fields))
        },
        progress,
    )
}

/// The object and the index of a case among all.
fn place(config: &Config, case: usize) -> (usize, u64) {
    let poses = usize::try_from(config.poses).unwrap_or(usize::MAX);
    (case / poses, (case % poses) as u64)
}

impl Study {
    /// Reads a study from its folder; one that is not finished may be looked at too.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] when a file is missing, is above the default limits, or is not what [`run`] wrote: the field of the
    /// configuration or the line of the rows is named.
    pub fn read(folder: &Path) -> Result<Self, ExperimentError> {
        Self::read_within(&ReadLimits::DEFAULT, folder)
    }

    /// Reads a study from its folder, within limits of one's own.
    ///
    /// # Errors
    ///
    /// As [`Study::read`].
    pub fn read_within(limits: &ReadLimits, folder: &Path) -> Result<Self, ExperimentError> {
        let path: PathBuf = folder.join(CASES_FILE);
        let config = Config::read(limits, &folder.join(CONFIG_FILE))?;
        let rows = row::read(limits, &path, &config)?;
        let study = Self { config, rows };
        if study.rows.iter().all(|row| row.measured.is_none()) {
            return Err(ExperimentError::Empty { path });
        }
        Ok(study)
    }
}

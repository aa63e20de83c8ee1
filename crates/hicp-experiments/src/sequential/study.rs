//! Running a sequential study into a folder, and reading one back.

use std::ops::ControlFlow;
use std::path::Path;

use hicp_io::ReadLimits;

use super::config::TrajectoryConfig;
use super::row::{self, TrajectoryRow};
use super::runner::{Models, TrajectoryRunner};
use crate::analysis::Analysis;
use crate::config::{Config, VariantRecord};
use crate::error::ExperimentError;
use crate::experiment::Experiment;
use crate::row::{Measured, Row};
use crate::streaming::Sheet;
use crate::study::{CONFIG_FILE, RunOptions, Study};
use crate::subject::Subject;

/// Name of the file of rows.
pub const TRAJECTORIES_FILE: &str = "trajectories.csv";

/// A sequential study that has been run: what it was, and its rows.
#[derive(Clone, Debug, PartialEq)]
pub struct TrajectoryStudy {
    /// The configuration.
    pub config: TrajectoryConfig,
    /// The rows: trajectories in order, in each the objects, in each the underlying pipelines, in each the methods.
    pub rows: Vec<TrajectoryRow>,
}

/// Runs a sequential study into a folder: `config.json`, and `trajectories.csv`, which grows trajectory by trajectory.
///
/// The rows of a trajectory are written whole and in order, whatever the number of threads. One trajectory of every object comes
/// first, then the next of every object: what an interrupted study holds is as even as it can be. `progress` and `resume` are as
/// in [`crate::run`]; there is no clock, and the bytes are the same on every run.
///
/// # Errors
///
/// [`ExperimentError`] when the configuration could not be read back, the folder holds another study or rows that the study cannot have, a
/// file cannot be written, or a pipeline cannot be built. A trajectory that cannot be made is no error: its rows have no figures, and say why.
pub fn run_trajectories(
    config: &TrajectoryConfig,
    subjects: &[Subject],
    folder: &Path,
    options: RunOptions,
    progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
) -> Result<(), ExperimentError> {
    let models = Models::new(subjects.len());
    // What names no pipeline or method is told as such, before there is a file.
    TrajectoryRunner::new(config, subjects, &models)?;
    config.check(&folder.join(CONFIG_FILE))?;
    let sheet = Sheet {
        folder,
        name: TRAJECTORIES_FILE,
        header: row::header(),
        rows_per_case: config.rows_per_trajectory(),
        cases: config.n_trajectories(),
        config: config.to_json(),
        stored: |limits, path| Ok(TrajectoryConfig::read(limits, path)?.to_json()),
        check: &|path, text| row::count(&options.limits, path, text, config),
    };
    sheet.fill(
        options,
        &|| TrajectoryRunner::new(config, subjects, &models),
        &|runner, case| {
            let (object, index) = (case % subjects.len(), (case / subjects.len()) as u64);
            let rows = runner.rows(object, index);
            row::to_csv(rows.iter().map(TrajectoryRow::fields))
        },
        progress,
    )
}

impl TrajectoryStudy {
    /// Reads a study from its folder; one that is not finished may be looked at too.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] when a file is missing, is above the default limits, or is not what [`run_trajectories`] wrote: the field
    /// of the configuration or the line of the rows is named.
    pub fn read(folder: &Path) -> Result<Self, ExperimentError> {
        Self::read_within(&ReadLimits::DEFAULT, folder)
    }

    /// Reads a study from its folder, within limits of one's own.
    ///
    /// # Errors
    ///
    /// As [`TrajectoryStudy::read`].
    pub fn read_within(limits: &ReadLimits, folder: &Path) -> Result<Self, ExperimentError> {
        let path = folder.join(TRAJECTORIES_FILE);
        let config = TrajectoryConfig::read(limits, &folder.join(CONFIG_FILE))?;
        let rows = row::read(limits, &path, &config)?;
        let study = Self { config, rows };
        if study.rows.iter().all(|row| row.measured.is_none()) {
            return Err(ExperimentError::Empty { path });
        }
        Ok(study)
    }

    /// Analyses the study: the variants are named `underlying/method`, the groups are those of a study of initial poses. Cost:
    /// as [`Analysis::of`].
    #[must_use]
    pub fn analysis(&self) -> Analysis {
        Analysis::of(&self.by_initial_pose())
    }

    /// The study as one of initial poses, whose variants are pairs of pipeline and method: bins, intervals and differences are
    /// the same.
    fn by_initial_pose(&self) -> Study {
        let c = &self.config;
        let level = String::from("0");
        let pairs = c.underlying.iter().flat_map(|u| {
            c.methods.iter().map(|method| VariantRecord {
                name: variant(&u.name, method),
                pipeline: String::new(),
            })
        });
        let config = Config {
            experiment: Experiment::InitNoise,
            version: c.version.clone(),
            seed: c.seed,
            poses: c.trajectories.saturating_mul(c.bins as u64),
            times: false,
            bins: c.bins,
            max_translation_m: c.max_translation_m,
            translation_m: 0.0,
            rotation_deg: 0.0,
            max_distance_m: c.start_distance_m,
            axis_offset_m: c.axis_offset_m,
            camera: c.camera,
            levels: vec![level.clone()],
            variants: pairs.collect(),
            objects: c.objects.clone(),
        };
        let rows = self.rows.iter().map(|row| Row {
            object: row.object.clone(),
            case: row.trajectory,
            variant: variant(&row.underlying, &row.method),
            level: level.clone(),
            bin: row.bin,
            measured: row.measured.as_ref().map(|m| Measured {
                vsd_initial: m.vsd_initial,
                vsd_final: m.vsd_final,
                add_final_mm: m.add_final_mm,
                iterations: m.n_estimates,
                termination: String::new(),
                cpu_ms: None,
            }),
            note: row.note.clone(),
        });
        Study {
            rows: rows.collect(),
            config,
        }
    }
}

/// The name of a pair in an analysis.
pub(crate) fn variant(underlying: &str, method: &str) -> String {
    format!("{underlying}/{method}")
}

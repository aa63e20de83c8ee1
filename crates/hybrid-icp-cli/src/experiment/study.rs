//! The options, the progress and the report of every study.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use clap::Args;
use hicp_experiments::{
    Design, ExperimentError, ReportOf, Reported, RunOptions, StudyOf, Subject, run,
};
use hicp_sim::Household;

use crate::interrupt;
use crate::limits::limits;
use crate::terminal::{progress_bar, say};

/// The options of every study.
#[derive(Debug, Args)]
pub(super) struct StudyOptions {
    /// A folder of meshes in meters (OBJ, OFF, PLY or STL) instead of the ten household objects.
    /// Can be repeated.
    #[arg(long, value_name = "DIR")]
    objects: Vec<PathBuf>,
    /// Seed of all random numbers.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub(super) seed: u64,
    /// Number of threads; by default one for `timing`, otherwise one per processor. Except for
    /// times, the results do not depend on it.
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// The output folder, which is created if it does not exist; by default study/NAME.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Change a field of config.json, to a JSON value or a text. For example, normal_window=1 takes
    /// normals from 3 × 3 pixels, and speed_m_s=0.2 doubles the speed of the camera in sequential.
    /// Can be repeated.
    #[arg(long = "set", value_name = "FIELD=VALUE")]
    set: Vec<String>,
    /// Continue a study that was interrupted.
    #[arg(long)]
    resume: bool,
}

impl StudyOptions {
    /// Reads the meshes, or creates the household objects.
    pub(super) fn subjects(
        &self,
        household: &[Household],
    ) -> Result<Vec<Subject>, ExperimentError> {
        if self.objects.is_empty() {
            return Subject::household(household);
        }
        let read = self
            .objects
            .iter()
            .map(|folder| Subject::read_folder(folder));
        Ok(read.collect::<Result<Vec<_>, _>>()?.concat())
    }

    /// Returns a configuration with the changes of `--set`.
    pub(super) fn changed<D: Design>(&self, config: D) -> Result<D, hicp_io::IoError> {
        let mut changes = self.set.iter();
        changes.try_fold(config, |config, change| config.with(change))
    }

    /// Returns the folder of the study `name`.
    pub(super) fn folder(&self, name: &str) -> PathBuf {
        let out = self.out.clone();
        out.unwrap_or_else(|| Path::new("study").join(name))
    }

    /// Runs a study with a progress bar, until it is finished or interrupted.
    pub(super) fn run<D: Design>(
        &self,
        config: &D,
        subjects: &[Subject],
        out: &Path,
        [name, unit]: [&str; 2],
        default_threads: Option<usize>,
    ) -> Result<(), ExperimentError> {
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        let options = RunOptions {
            threads: self.threads.or(default_threads).unwrap_or_else(cores),
            resume: self.resume,
            limits: limits(),
        };
        let bar = progress_bar(config.layout().n_cases(), unit);
        bar.set_message(name.to_owned());
        let mut has_started = false;
        interrupt::can_resume("--resume");
        let ran = run(config, subjects, out, options, &mut |done| {
            bar.set_position(done as u64);
            if !has_started {
                bar.reset_eta();
                has_started = true;
            }
            match interrupt::asked() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        });
        bar.finish_and_clear();
        ran
    }
}

/// Writes the report of named studies, and prints their claims and the path of the page.
pub(super) fn report<D: Reported>(studies: &[(&str, &Path)], out: &Path) -> anyhow::Result<()> {
    let read = |(name, folder): &(&str, &Path)| -> anyhow::Result<_> {
        Ok((
            (*name).to_owned(),
            StudyOf::<D>::read_within(&limits(), folder)?,
        ))
    };
    let studies = studies.iter().map(read).collect::<anyhow::Result<_>>()?;
    let report = ReportOf::of(studies);
    report.write(out)?;
    for (study, claim) in report.claims() {
        let (verdict, text, figures) = (claim.verdict.words(), &claim.text, &claim.figures);
        say(format_args!("{study}: {verdict}: {text} ({figures})"))?;
    }
    let page = out.join("report.html");
    say(format_args!("{} contains all results", page.display()))
}

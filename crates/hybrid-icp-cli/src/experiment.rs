//! `hybrid-icp experiment`.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::{Args, Subcommand, ValueEnum};
use hicp_experiments::{
    Config, Design, Experiment, Report, RunOptions, Study, Subject, Variant, run as run_rows,
};
use hicp_sim::Household;
use hybrid_icp::{Preset, UnknownPreset};
use indicatif::{ProgressBar, ProgressStyle};

use crate::interrupt;
use crate::limits::{limits, pipeline_limits};
use crate::terminal::say;

/// Rerun the paper's studies, on its kind of objects or on any meshes.
///
/// A study writes into its folder: `config.json` (exactly what was run), `cases.csv` (one row per case, level and variant, as it
/// goes), and from these a summary: `report.html`, `figure.svg`, `figure.png`, `summary.csv`, `differences.csv`, `claims.csv`. All
/// variants see the same images and initial poses.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Robustness to the initial pose: ten equal bins of the initial VSD (§VI-B.1).
    InitNoise(Arguments),
    /// Robustness to depth noise of 0 to 5 % (§VI-B.2).
    DepthNoise(Arguments),
    /// Robustness to reconstructed models, levels 0 to 4 (§VI-B.3).
    ModelNoise(Arguments),
    /// Time per refinement under the conditions of those three studies (Table I).
    Timing(Arguments),
    /// The threshold of Dynamic Switching from 0 to 1, on the tuning objects (§IV-A).
    Alpha(Arguments),
    /// The presets that go beyond the paper: every start under depth noise, model noise and imperfect masks.
    Beyond(Arguments),
    Sequential(crate::sequential::Arguments),
    Report(ReportArguments),
}

#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// A folder of meshes in metres (OBJ, PLY, STL) instead of the ten household objects.
    #[arg(long, value_name = "DIR")]
    objects: Option<PathBuf>,
    /// The household objects to run on: those that everything was chosen on, or those that results are reported on; each
    /// study has its own unless told otherwise.
    #[arg(long, value_enum, conflicts_with = "objects")]
    household: Option<HouseholdSet>,
    /// Cases per object, spread evenly over the bins where there are bins.
    #[arg(long, value_name = "N", default_value_t = 30)]
    poses: u64,
    /// Which pipelines: names (`hybrid-icp pipelines` lists them) and TOML files, separated by commas, or all; alpha takes those
    /// that switch, hybrid unless told otherwise; beyond takes hybrid, two baselines and what goes beyond the paper.
    #[arg(long, value_name = "LIST|all", value_delimiter = ',')]
    variants: Vec<Choice>,
    /// Seed of everything random.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Number of threads; the results are the same for any. Timing takes one unless told otherwise, the others all processors.
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// The folder to write to; made when it is not there. Unless given, study/NAME.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Go on with a study that was interrupted.
    #[arg(long)]
    resume: bool,
    /// Leave the column of times empty: two runs then give the same bytes.
    #[arg(long)]
    no_times: bool,
}

/// Put finished studies into one report, with a figure like the paper's Figure 6.
#[derive(Debug, Args)]
pub(crate) struct ReportArguments {
    /// The folders of the studies.
    #[arg(required = true, value_name = "DIR")]
    studies: Vec<PathBuf>,
    /// The folder to write to; made when it is not there.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Half of the household objects.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum HouseholdSet {
    Tuning,
    Test,
}

/// What `--variants` names.
#[derive(Clone, Debug)]
enum Choice {
    All,
    Preset(Preset),
    File(PathBuf),
}

impl FromStr for Choice {
    type Err = UnknownPreset;

    fn from_str(text: &str) -> Result<Self, UnknownPreset> {
        match text {
            "all" => Ok(Self::All),
            file if file.ends_with(".toml") => Ok(Self::File(file.into())),
            name => name.parse().map(Self::Preset),
        }
    }
}

/// Runs the command.
pub(crate) fn run(command: &Command) -> anyhow::Result<()> {
    match command {
        Command::InitNoise(arguments) => study(Experiment::InitNoise, arguments),
        Command::DepthNoise(arguments) => study(Experiment::DepthNoise, arguments),
        Command::ModelNoise(arguments) => study(Experiment::ModelNoise, arguments),
        Command::Timing(arguments) => study(Experiment::Timing, arguments),
        Command::Alpha(arguments) => study(Experiment::Alpha, arguments),
        Command::Beyond(arguments) => study(Experiment::Beyond, arguments),
        Command::Sequential(arguments) => crate::sequential::run(arguments),
        Command::Report(arguments) => report(&arguments.studies, &arguments.out),
    }
}

fn study(experiment: Experiment, arguments: &Arguments) -> anyhow::Result<()> {
    let subjects = match &arguments.objects {
        Some(folder) => Subject::read_folder(folder)?,
        None => Subject::household(&match arguments.household {
            None => experiment.household(),
            Some(HouseholdSet::Tuning) => Household::TUNING,
            Some(HouseholdSet::Test) => Household::TEST,
        })?,
    };
    let variants = variants(experiment, &arguments.variants)?;
    let mut config = Config::new(
        experiment,
        &subjects,
        &variants,
        arguments.poses,
        arguments.seed,
    )?;
    config.times = !arguments.no_times;
    let out = arguments
        .out
        .clone()
        .unwrap_or_else(|| Path::new("study").join(experiment.name()));
    let threads = arguments.threads.unwrap_or_else(|| match experiment {
        Experiment::Timing => 1,
        _ => std::thread::available_parallelism().map_or(1, usize::from),
    });
    let options = RunOptions {
        threads,
        resume: arguments.resume,
        limits: limits(),
    };
    run_study(
        &config,
        &subjects,
        &out,
        options,
        [experiment.name(), "cases"],
    )?;
    report(std::slice::from_ref(&out), &out)
}

/// Runs a study with a progress bar, until it is finished or interrupted.
pub(crate) fn run_study<D: Design>(
    config: &D,
    subjects: &[Subject],
    out: &Path,
    options: RunOptions,
    [name, unit]: [&str; 2],
) -> anyhow::Result<()> {
    let bar = ProgressBar::new(config.layout().n_cases() as u64);
    let template = format!("{{msg}} {{bar:40}} {{pos}}/{{len}} {unit}, {{eta}} left");
    if let Ok(style) = ProgressStyle::with_template(&template) {
        bar.set_style(style);
    }
    bar.set_message(name.to_owned());
    let mut has_started = false;
    interrupt::can_resume();
    let ran = run_rows(config, subjects, out, options, &mut |done| {
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
    Ok(ran?)
}

fn variants(experiment: Experiment, choices: &[Choice]) -> anyhow::Result<Vec<Variant>> {
    if choices.is_empty() {
        return Ok(match experiment {
            Experiment::Alpha => vec![Variant::preset(Preset::Hybrid)],
            Experiment::Beyond => Variant::beyond(),
            _ => Variant::paper(),
        });
    }
    let mut variants = Vec::new();
    for choice in choices {
        match choice {
            Choice::All => variants.extend(Variant::paper()),
            Choice::Preset(preset) => variants.push(Variant::preset(*preset)),
            Choice::File(path) => variants.push(Variant::read_within(&pipeline_limits(), path)?),
        }
    }
    Ok(variants)
}

fn report(folders: &[PathBuf], out: &Path) -> anyhow::Result<()> {
    let mut studies = Vec::new();
    for folder in folders {
        let name = folder.file_name().unwrap_or(folder.as_os_str());
        let study = Study::read_within(&limits(), folder)?;
        studies.push((name.to_string_lossy().into_owned(), study));
    }
    let report = Report::of(studies);
    report.write(out)?;
    for (study, claim) in report.claims() {
        say(format_args!(
            "{study}: {}: {} ({})",
            claim.verdict.name(),
            claim.text,
            claim.figures
        ))?;
    }
    say(format_args!(
        "{} holds it all",
        out.join("report.html").display()
    ))
}

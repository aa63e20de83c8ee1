//! `hybrid-icp experiment`.

mod sequential;
mod study;

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::{Args, Subcommand, ValueEnum};
use hicp_experiments::{Config, Experiment, Variant};
use hicp_sim::Household;
use hybrid_icp::Preset;
use hybrid_icp::core::UnknownName;

use self::study::{StudyOptions, report};
use crate::choice::Source;
use crate::limits::pipeline_limits;
use crate::options::file_name;
use crate::terminal::warn;

/// Rerun the paper's studies, on household objects or on custom meshes.
///
/// All variants get the same images and initial poses. A study writes its exact configuration to
/// `config.json`, and one row per case, level and variant to `cases.csv` as soon as a case is
/// finished. At the end it summarizes them in `report.html`, `figure.svg`, `figure.png`,
/// `summary.csv`, `switches.csv`, `differences.csv` and `claims.csv`.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Robustness to the initial pose: ten equal bins of the initial VSD (§VI-B.1).
    InitNoise(Arguments),
    /// Robustness to depth noise of 0 to 5 % (§VI-B.2).
    DepthNoise(Arguments),
    /// Robustness to the errors of reconstructed models, levels 0 to 4 (§VI-B.3).
    ModelNoise(Arguments),
    /// Time per refinement under the conditions of the three studies of robustness (Table I).
    Timing(Arguments),
    /// Thresholds of Dynamic Switching from 0 to 1, on the tuning objects (§IV-A).
    Alpha(Arguments),
    /// The presets beyond the paper: all starts, with depth noise, model noise and imperfect masks.
    Beyond(Arguments),
    Sequential(sequential::Arguments),
    Report(ReportArguments),
}

#[derive(Debug, Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    study: StudyOptions,
    /// The household objects: those for tuning parameters, or those for reporting results. By
    /// default, `alpha` uses the tuning objects and every other study uses the test objects.
    #[arg(long, value_enum, conflicts_with = "objects")]
    household: Option<HouseholdSet>,
    /// Cases per object. If the study has bins, cases are spread evenly over them.
    #[arg(long, value_name = "N", default_value_t = 30)]
    poses: u64,
    /// The pipelines, separated by commas: presets (`hybrid-icp pipelines` lists them), TOML files,
    /// or all, the nine variants of the paper. The default is all; for `alpha`, which needs
    /// pipelines that switch, it is hybrid; for `beyond`, it is hybrid, two baselines and the
    /// presets beyond the paper.
    #[arg(long, value_name = "LIST|all", value_delimiter = ',')]
    variants: Vec<Choice>,
    /// Leave the column of times empty, so that two runs give the same bytes.
    #[arg(long)]
    no_times: bool,
}

/// Combine finished studies in one report, with a figure like the paper's Figure 6.
#[derive(Debug, Args)]
pub(crate) struct ReportArguments {
    /// The folders of the studies.
    #[arg(required = true, value_name = "DIR")]
    studies: Vec<PathBuf>,
    /// The output folder, which is created if it does not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Half of the household objects.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum HouseholdSet {
    Tuning,
    Test,
}

/// A value of `--variants`.
#[derive(Clone, Debug)]
enum Choice {
    All,
    One(Source),
}

impl FromStr for Choice {
    type Err = UnknownName;

    fn from_str(text: &str) -> Result<Self, UnknownName> {
        match text {
            "all" => Ok(Self::All),
            one => one.parse().map(Self::One),
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
        Command::Sequential(arguments) => sequential::run(arguments),
        Command::Report(arguments) => report_folders(&arguments.studies, &arguments.out),
    }
}

fn study(experiment: Experiment, arguments: &Arguments) -> anyhow::Result<()> {
    let household = match arguments.household {
        None => experiment.household(),
        Some(HouseholdSet::Tuning) => Household::TUNING,
        Some(HouseholdSet::Test) => Household::TEST,
    };
    let options = &arguments.study;
    let subjects = options.subjects(&household)?;
    let variants = variants(experiment, &arguments.variants)?;
    let (poses, seed) = (arguments.poses, options.seed);
    let mut config = Config::new(experiment, &subjects, &variants, poses, seed)?;
    config.times = !arguments.no_times;
    let config = options.changed(config)?;
    let out = options.folder(experiment.name());
    // Several threads would disturb each other's times.
    let threads = matches!(experiment, Experiment::Timing).then_some(1);
    let names = [experiment.name(), "cases"];
    options.run(&config, &subjects, &out, names, threads)?;
    if experiment.is_binned() && !poses.is_multiple_of(config.bins as u64) {
        warn(format_args!(
            "--poses is {poses}, expected a multiple of the {0} bins of the initial VSD: figures \
             over all bins weigh some of them more",
            config.bins
        ));
    }
    report_folders(std::slice::from_ref(&out), &out)
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
            Choice::One(Source::Preset(preset)) => variants.push(Variant::preset(*preset)),
            Choice::One(Source::File(path)) => {
                variants.push(Variant::read_within(&pipeline_limits(), path)?);
            }
        }
    }
    Ok(variants)
}

/// Writes the report of studies, which are named after their folders.
fn report_folders(folders: &[PathBuf], out: &Path) -> anyhow::Result<()> {
    let names: Vec<String> = folders.iter().map(|folder| file_name(folder)).collect();
    let studies = names.iter().zip(folders);
    let studies: Vec<_> = studies.map(|(name, folder)| (&**name, &**folder)).collect();
    report::<Config>(&studies, out)
}

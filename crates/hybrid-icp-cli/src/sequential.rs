//! `hybrid-icp experiment sequential`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use hicp_experiments::{
    Experiment, RunOptions, Subject, TrajectoryClock, TrajectoryConfig, TrajectoryReport,
    TrajectoryStudy,
};
use hybrid_icp::Preset;

use crate::experiment::run_study;
use crate::limits::limits;
use crate::terminal::say;

/// Fusing estimates while the camera moves: trajectories toward an object, six methods and more (§VI-C).
///
/// Writes `config.json`, `trajectories.csv` (one row per trajectory, pipeline and method, as it goes), and from these
/// `report.html`, `figure.svg`, `figure.png`, `summary.csv`, `differences.csv` and `claims.csv`. The time of an estimate is the
/// mean of the paper's Table I: all methods of a pipeline see the same images, and two runs give the same bytes; see --clock.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// The pipeline that makes the estimates; both that the paper uses unless told otherwise.
    #[arg(long, value_name = "NAME", value_delimiter = ',', default_values = ["hybrid", "projective-cascade-point-plane"])]
    underlying: Vec<Preset>,
    /// The methods, separated by commas: names of the paper (last-estimate, average, weighted-average, filtering-constant, filtering,
    /// most-confident), and gated- or calibrated- before one; all of the study unless told otherwise. Claims about others are left out.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    methods: Vec<String>,
    /// What an estimate takes: cost, the mean of the paper's Table I, or real, the processor time that it took here, from depth
    /// image to fused pose. By a real clock no two runs are the same, and a trajectory has thousands of images.
    #[arg(long, value_enum, value_name = "CLOCK", default_value_t = Clock::Cost)]
    clock: Clock,
    /// A folder of meshes in metres (OBJ, PLY, STL) instead of the ten household objects.
    #[arg(long, value_name = "DIR")]
    objects: Option<PathBuf>,
    /// Trajectories per object and bin of the initial VSD.
    #[arg(long, value_name = "N", default_value_t = 1)]
    poses: u64,
    /// Seed of everything random.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Number of threads, all processors unless told otherwise; the results are the same for any.
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// The folder to write to; made when it is not there.
    #[arg(long, value_name = "DIR", default_value = "study/sequential")]
    out: PathBuf,
    /// Go on with a study that was interrupted.
    #[arg(long)]
    resume: bool,
}

/// What `--clock` names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Clock {
    Cost,
    Real,
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let subjects = match &arguments.objects {
        Some(folder) => Subject::read_folder(folder)?,
        None => Subject::household(&Experiment::InitNoise.household())?,
    };
    let mut config = TrajectoryConfig::new(
        &subjects,
        &arguments.underlying,
        arguments.poses,
        arguments.seed,
    )?;
    if !arguments.methods.is_empty() {
        config.methods.clone_from(&arguments.methods);
    }
    config.clock = match arguments.clock {
        Clock::Cost => TrajectoryClock::Cost,
        Clock::Real => TrajectoryClock::Real,
    };
    let options = RunOptions {
        threads: arguments
            .threads
            .unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from)),
        resume: arguments.resume,
        limits: limits(),
    };
    let out = &arguments.out;
    run_study(
        &config,
        &subjects,
        out,
        options,
        ["sequential", "trajectories"],
    )?;
    let study = TrajectoryStudy::read_within(&limits(), out)?;
    let report = TrajectoryReport::of(vec![("sequential".to_owned(), study)]);
    report.write(out)?;
    for (_, claim) in report.claims() {
        say(format_args!(
            "{}: {} ({})",
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

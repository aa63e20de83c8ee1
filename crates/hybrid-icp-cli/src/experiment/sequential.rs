//! `hybrid-icp experiment sequential`.

use clap::{Args, ValueEnum};
use hicp_experiments::{Experiment, TrajectoryClock, TrajectoryConfig};
use hybrid_icp::Preset;

use super::study::{StudyOptions, report};

/// Fusing estimates while the camera moves: trajectories toward an object, six methods and more (§VI-C).
///
/// Writes `config.json`, `trajectories.csv` (one row per trajectory, pipeline and method, as it goes), and from these
/// `report.html`, `figure.svg`, `figure.png`, `summary.csv`, `differences.csv` and `claims.csv`. The time of an estimate is the
/// mean of the paper's Table I: all methods of a pipeline see the same images, and two runs give the same bytes; see --clock.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// The pipeline that makes the estimates; by default both that the paper uses.
    #[arg(long, value_name = "NAME", value_delimiter = ',', default_values = ["hybrid", "projective-cascade-point-plane"])]
    underlying: Vec<Preset>,
    /// The methods, separated by commas: names of the paper (last-estimate, average, weighted-average, filtering-constant, filtering,
    /// most-confident), and gated- or calibrated- before one; by default all of the study. Claims about others are left out.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    methods: Vec<String>,
    /// What an estimate takes: cost, the mean of the paper's Table I, or real, the processor time that it took here, from depth
    /// image to fused pose. By a real clock no two runs are the same, and a trajectory has thousands of images.
    #[arg(long, value_enum, value_name = "CLOCK", default_value_t = Clock::Cost)]
    clock: Clock,
    #[command(flatten)]
    study: StudyOptions,
    /// Trajectories per object and bin of the initial VSD.
    #[arg(long, value_name = "N", default_value_t = 1)]
    poses: u64,
}

/// What `--clock` names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Clock {
    Cost,
    Real,
}

/// Runs the command.
pub(super) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let options = &arguments.study;
    let subjects = options.subjects(&Experiment::InitNoise.household())?;
    let (underlying, poses) = (&arguments.underlying, arguments.poses);
    let mut config = TrajectoryConfig::new(&subjects, underlying, poses, options.seed)?;
    if !arguments.methods.is_empty() {
        config.methods.clone_from(&arguments.methods);
    }
    config.clock = match arguments.clock {
        Clock::Cost => TrajectoryClock::Cost,
        Clock::Real => TrajectoryClock::Real,
    };
    let out = options.folder("sequential");
    let names = ["sequential", "trajectories"];
    options.run(&config, &subjects, &out, names, None)?;
    report::<TrajectoryConfig>(&[("sequential", &out)], &out)
}

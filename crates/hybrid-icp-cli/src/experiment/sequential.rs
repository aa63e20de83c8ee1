//! `hybrid-icp experiment sequential`.

use clap::{Args, ValueEnum};
use hicp_experiments::{Experiment, TrajectoryClock, TrajectoryConfig};
use hybrid_icp::Preset;

use super::study::{StudyOptions, report};

/// Fusion of estimates while the camera moves toward an object, by ten methods (§VI-C).
///
/// Writes `config.json`, and one row per trajectory, pipeline and method to `trajectories.csv` as
/// soon as a trajectory is finished. At the end it summarizes them in `report.html`, `figure.svg`,
/// `figure.png`, `summary.csv`, `differences.csv`, `calibration.csv` and `claims.csv`. By default,
/// two runs give the same bytes, and methods of a pipeline get the same images if their estimates
/// take equally long; see --clock.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// The pipelines that compute the estimates; by default both that the paper uses.
    #[arg(long, value_name = "NAME", value_delimiter = ',', default_values = ["hybrid", "projective-cascade-point-plane"])]
    underlying: Vec<Preset>,
    /// The methods, separated by commas; by default all ten of the study. The methods of the paper
    /// are last-estimate, average, weighted-average, filtering-constant, filtering and
    /// most-confident. A name may have gated- or calibrated- before it.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    methods: Vec<String>,
    /// The protocol: the paper's (§VI-C), or one with improved covariances and models. config.json
    /// lists what differs.
    #[arg(long, value_enum, value_name = "PROTOCOL", default_value_t = Protocol::Paper)]
    protocol: Protocol,
    /// The time of an estimate. With cost, it is the mean of the paper's Table I, plus the share of
    /// an MVE for methods that need one. With real, it is the measured processor time from depth
    /// image to fused pose. Then no two runs are the same, and a trajectory has thousands of
    /// images.
    #[arg(long, value_enum, value_name = "CLOCK", default_value_t = Clock::Cost)]
    clock: Clock,
    #[command(flatten)]
    study: StudyOptions,
    /// Trajectories per object and bin of the initial VSD.
    #[arg(long, value_name = "N", default_value_t = 1)]
    poses: u64,
}

/// A value of `--protocol`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Protocol {
    Paper,
    Improved,
}

/// A value of `--clock`.
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
    if arguments.protocol == Protocol::Improved {
        config = config.improved();
    }
    if !arguments.methods.is_empty() {
        config.methods.clone_from(&arguments.methods);
    }
    config.clock = match arguments.clock {
        Clock::Cost => TrajectoryClock::Cost,
        Clock::Real => TrajectoryClock::Real,
    };
    let config = options.changed(config)?;
    let out = options.folder("sequential");
    let names = ["sequential", "trajectories"];
    options.run(&config, &subjects, &out, names, None)?;
    report::<TrajectoryConfig>(&[("sequential", &out)], &out)
}

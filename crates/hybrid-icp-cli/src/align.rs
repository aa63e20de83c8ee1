//! `hybrid-icp align`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::RangedU64ValueParser;
use hicp_io::{LengthUnit, PointCloud};
use hybrid_icp::core::{Isometry3, Matrix6};
use hybrid_icp::icp::Verdict;
use hybrid_icp::{CloudOptions, CloudSide, CloudWarning, Registration, align};
use serde_json::json;

use crate::limits::limits;
use crate::options::positive;
use crate::outputs::{Files, write_json};
use crate::pose_json::add_pose;
use crate::terminal::{check_stdout, say, say_beside, warn};

/// Register two point clouds: find the pose that moves one onto the other.
///
/// The result is JSON. It has the pose, from source to target, as matrix (4x4, meters) and as
/// cam_R_m2c and cam_t_m2c (mm), so that it can be the --init of another run. It also has the
/// outcome (refined or kept_initial), termination, iterations, fitness (share of the source points
/// with a counterpart), rmse_m, the 6x6 covariance (translation first, meters and radians; null if
/// a direction is not determined), and the warnings that are also on standard error.
///
/// Fitness and RMSE do not prove the pose: a can slides around its axis, and a box on its wrong
/// side can fit better than the truth. Start from a rough pose, and read the warning about
/// directions that the clouds do not determine. Points at exactly (0, 0, 0) are skipped.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  hybrid-icp align a.ply b.pcd --init pose.json --output moved.json")]
pub(crate) struct Arguments {
    /// The cloud to move: PLY, PCD, XYZ, CSV, NPY or NPZ.
    #[arg(value_name = "SOURCE")]
    source: PathBuf,
    /// The cloud that stands still.
    #[arg(value_name = "TARGET")]
    target: PathBuf,
    /// Unit of the coordinates of both clouds: m, mm or cm.
    #[arg(long, value_name = "UNIT", default_value_t = LengthUnit::Meters)]
    unit: LengthUnit,
    /// Unit of the coordinates of the target, if it is another one.
    #[arg(long, value_name = "UNIT")]
    target_unit: Option<LengthUnit>,
    /// The rough pose, source to target, in the forms of `refine`. If not given, the clouds start
    /// where they are.
    #[arg(long, value_name = "FILE")]
    init: Option<PathBuf>,
    /// Unit of the translation of --init: m, mm or cm. If not given: mm for cam_t_m2c, m for all
    /// other forms.
    #[arg(long, value_name = "UNIT", requires = "init")]
    init_unit: Option<LengthUnit>,
    /// The error to minimize: point-to-point, point-to-plane or gicp.
    #[arg(long, value_name = "NAME", default_value = Registration::default().name())]
    method: Registration,
    /// Largest distance of a pair, meters whatever --unit is. If not given: a tenth of the source's
    /// diameter, then a fiftieth.
    #[arg(long, value_name = "METERS", value_parser = positive)]
    max_distance: Option<f64>,
    /// Replace the points in cubic cells of this edge by their mean first, meters whatever --unit
    /// is.
    #[arg(long, value_name = "METERS", value_parser = positive)]
    voxel: Option<f64>,
    /// Number of neighbors from which normals are estimated if a file has none, at least 3.
    #[arg(long, value_name = "N", default_value_t = CloudOptions::default().neighbors)]
    #[arg(value_parser = RangedU64ValueParser::<usize>::new().range(3..))]
    neighbors: usize,
    /// The file for the JSON result; standard output if not given.
    #[arg(long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let Arguments { init, output, .. } = arguments;
    if output.is_none() {
        check_stdout()?;
    }
    Files::default()
        .writes("--output", output)
        .reads("SOURCE", [&arguments.source])
        .reads("TARGET", [&arguments.target])
        .reads("--init", init)
        .check_in_place("--output", "--init")?;
    let method = arguments.method;
    let options = CloudOptions {
        voxel_meters: arguments.voxel,
        neighbors: arguments.neighbors,
    };
    let (mut warnings, mut lengths) = (Vec::new(), Vec::new());
    let mut read = |path: &PathBuf, unit, side| -> anyhow::Result<_> {
        let PointCloud {
            points,
            normals,
            n_skipped,
        } = limits().read_cloud(path, unit)?;
        if n_skipped > 0 {
            warnings.push(format!(
                "{}: {n_skipped} of {} points were skipped: they are not finite, or have no normal",
                path.display(),
                points.len() + n_skipped
            ));
        }
        let limit = arguments.max_distance.filter(|_| side == CloudSide::Target);
        for (name, length) in [("--voxel", options.voxel_meters), ("--max-distance", limit)] {
            lengths.extend(CloudWarning::of_length(name, length, side, &points));
        }
        let normals = normals.as_deref();
        Ok(match side {
            CloudSide::Source => options.for_source_of(method).cloud(&points, normals)?,
            CloudSide::Target => options.target_of(method, &points, normals)?,
        })
    };
    let unit = arguments.unit;
    let source = read(&arguments.source, unit, CloudSide::Source)?;
    let target_unit = arguments.target_unit.unwrap_or(unit);
    let target = read(&arguments.target, target_unit, CloudSide::Target)?;
    let init = match init {
        Some(path) => {
            limits()
                .read_pose(path, arguments.init_unit)?
                .camera_from_object
        }
        None => Isometry3::identity(),
    };
    let mut pipeline = method.build(arguments.max_distance);
    let found = align(&source, &target, &init, &mut pipeline);

    let in_words = |warning: &CloudWarning| match warning {
        CloudWarning::Extents { .. } => {
            format!("{warning}: check --unit {unit} and --target-unit {target_unit}")
        }
        // A length that is too long is the reason.
        CloudWarning::LittleOverlap { .. }
            if lengths.is_empty() && found.outcome.n_pairs() == 0 =>
        {
            format!("{warning}: check --init and its unit, --unit {unit} and --max-distance")
        }
        _ => warning.to_string(),
    };
    warnings.extend(lengths.iter().chain(&found.warnings).map(in_words));
    let (pose, termination) = (found.target_from_source(), found.outcome.termination);
    let rows = |m: Matrix6<f64>| [0, 1, 2, 3, 4, 5].map(|i| [0, 1, 2, 3, 4, 5].map(|j| m[(i, j)]));
    let matrix = pose.to_homogeneous();
    let matrix = [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j| matrix[(i, j)]));
    let mut report = json!({
        "method": method.name(),
        "matrix": matrix,
        "outcome": found.outcome.verdict.name(),
        "termination": termination.name(),
        "reason": termination.explain(),
        "iterations": found.outcome.iterations,
        "n_pairs": found.outcome.n_pairs(),
        "fitness": found.fitness(),
        "rmse_m": found.rmse(),
        "covariance": found.covariance().map(rows),
        "source_points": source.surfels().len(),
        "target_points": target.surfels().len(),
        "warnings": warnings,
    });
    add_pose(&mut report, &pose);
    warnings.iter().for_each(warn);
    let Some(path) = output else {
        return say(serde_json::to_string_pretty(&report)?);
    };
    write_json(path, &report)?;
    let fit = match found.rmse() {
        Some(rmse) => format!("fitness {:.3}, RMSE {rmse:.3e} m", found.fitness()),
        None => "no pairs".to_owned(),
    };
    let verdict = match found.outcome.verdict {
        Verdict::Refined => "refined",
        Verdict::KeptInitial(_) => "kept the initial pose",
    };
    let (iterations, reason) = (found.outcome.iterations, termination.explain());
    let text = format!("{verdict}: {fit}, {iterations} iterations: {reason}");
    say_beside(&[Some(path)], text)
}

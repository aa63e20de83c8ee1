//! `hybrid-icp bop estimate`.

use std::borrow::Borrow;
use std::path::PathBuf;

use clap::Args;
use hicp_bop::MaskSource;
use hicp_io::bop::{Detection, ResultRow};
use hybrid_icp::core::Isometry3;

use super::options::DatasetOptions;
use super::refine::JobOptions;
use crate::limits::limits;
use crate::outputs::Files;

/// Estimate the pose of every detection, without initial poses.
///
/// The detections are a JSON array of the BOP benchmark, as CNOS, SAM-6D and other segmenters write
/// them. Each has scene_id, image_id, category_id, score and a segmentation: a run-length code, as
/// a list or compressed. A detection without a segmentation needs a bbox.
///
/// The output has one row per detection, in their order, with the score of the detection.
/// Detections without a pose are left out and counted by reason at the end. The time column has the
/// seconds spent on all rows of the image, added to the time of the detections. The journal is that
/// of `bop refine`.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
pub(crate) struct Arguments {
    #[command(flatten)]
    dataset: DatasetOptions,
    /// The detections file.
    #[arg(long, value_name = "FILE.json")]
    detections: PathBuf,
    #[command(flatten)]
    job: JobOptions,
}

const USAGE: &str = "\
hybrid-icp bop estimate --dataset <DIR> [--split <NAME>]
           --detections <FILE.json> --output <OUT.csv> [OPTIONS]";

const EXAMPLE: &str = "\
Example:
  hybrid-icp bop estimate --dataset bop/ycbv --split test \\
      --detections detections.json --output estimated_ycbv-test.csv

Exit codes are those of `bop refine`.";

/// A detection and the row of its pose.
struct Detected {
    row: ResultRow,
    detection: Detection,
}

impl Borrow<ResultRow> for Detected {
    fn borrow(&self) -> &ResultRow {
        &self.row
    }
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let Arguments {
        dataset,
        detections: path,
        job,
    } = arguments;
    let files = Files::default().reads("--detections", [path]);
    job.check_files(files, "", dataset)?;
    let pipeline = job.choose_pipeline(dataset, false)?;
    let detections = limits().read_detections(path)?.into_iter();
    let detected = detections.map(|detection| {
        let (scene, image, object) = (
            detection.scene_id,
            detection.image_id,
            detection.category_id,
        );
        let mut row = ResultRow::new(scene, image, object, Isometry3::identity());
        (row.score, row.time_s) = (detection.score, detection.time_s);
        Detected { row, detection }
    });
    let chosen = job.choice.choose(detected.collect(), path)?;
    let (rows, detections) = chosen.into_iter().map(|d| (d.row, d.detection)).unzip();
    let masks = MaskSource::OfRows(detections);
    job.job(dataset, path, masks, pipeline)
        .run(rows)
        .map(|_| ())
}

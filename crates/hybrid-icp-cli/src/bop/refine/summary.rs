//! The report at the end of `bop refine`.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::bail;
use hicp_bop::{Fault, FaultKind, FrameResult, MaskSource, Models, RowResult, RowStatus};
use hybrid_icp::Warning;
use hybrid_icp::checks::{ACCEPTED, EXPLAINS_NOTHING};
use hybrid_icp::switch::PAPER_ALPHA;

use super::job::RefineJob;
use crate::bop::statistics::median;
use crate::bop::{faults, models};
use crate::terminal::{counted, warn};

fn rows_of(results: &[FrameResult]) -> impl Iterator<Item = &RowResult> {
    results.iter().flat_map(|result| &result.rows)
}

/// Returns the words for the status of a row, or of a detection whose pose is estimated.
pub(super) fn status_text(status: RowStatus, estimated: bool) -> String {
    match (estimated, status) {
        (true, RowStatus::Refined) => "estimated".to_owned(),
        (true, RowStatus::NothingMeasured) => "left out: nothing measured inside".to_owned(),
        (true, _) => status.to_string().replacen("kept", "left out", 1),
        _ => status.to_string(),
    }
}

/// Counts the rows by status, one line each.
pub(super) fn summary(
    job: &RefineJob<'_>,
    results: &[FrameResult],
    models: &Models,
    distrust: &Distrust,
) -> String {
    let mut text = String::new();
    let mut counts: BTreeMap<RowStatus, usize> = BTreeMap::new();
    for row in rows_of(results) {
        *counts.entry(row.status).or_default() += 1;
    }
    for (status, count) in &counts {
        let status_text = status_text(*status, job.estimates());
        text.push_str(&format!("\n  {count:>7}  {status_text}"));
        if *status == RowStatus::MissingModel {
            text.push_str(&format!(" (object {})", models::ids(&models.missing)));
        }
    }
    let (mut before, mut after): (Vec<f64>, Vec<f64>) =
        rows_of(results).filter_map(|row| row.mve).unzip();
    if let (Some(before), Some(after)) = (median(&mut before), median(&mut after)) {
        text.push_str(&match job.estimates() {
            true => format!("\n  median MVE {after:.3}"),
            false => format!("\n  median MVE {before:.3} -> {after:.3}"),
        });
        let confident = rows_of(results).filter(|row| row.confidence >= Some(ACCEPTED));
        let count = confident.count();
        text.push_str(&format!(
            "\n  {count:>7}  with a confidence of {ACCEPTED} or more"
        ));
    }
    if distrust.unexplained > 0 {
        let count = distrust.unexplained;
        text.push_str(&format!(
            "\n  {count:>7}  with an MVE of {PAPER_ALPHA} or more and a confidence below {ACCEPTED}: do not trust them"
        ));
    }
    text
}

/// The poses in the output that should not be trusted.
pub(super) struct Distrust {
    /// The number of rows whose pose does not explain the image.
    unexplained: usize,
    /// Warnings, one for each reason.
    texts: Vec<String>,
}

impl Distrust {
    pub(super) fn of(results: &[FrameResult]) -> Self {
        let rows = rows_of(results).filter(|row| row.mve.is_some());
        let warnings: Vec<Vec<Warning>> = rows.map(RowResult::warnings).collect();
        let count = |is: fn(&Warning) -> bool| {
            let of_kind = warnings.iter().filter(|of_row| of_row.iter().any(is));
            of_kind.count()
        };
        let rows = warnings.len();
        let other = "the result may be another object";
        let unexplained = count(|w| matches!(w, Warning::Unexplained { .. }));
        let elsewhere = count(|w| matches!(w, Warning::FoundElsewhere { .. }));
        let flat = count(|w| matches!(w, Warning::Flat { .. }));
        let texts = [
            (
                unexplained,
                format!(
                    "{unexplained} of {rows} rows have an MVE of {PAPER_ALPHA} or more after refinement and a confidence below {ACCEPTED}: do not trust them"
                ),
            ),
            (
                elsewhere,
                format!(
                    "in {elsewhere} of {rows} rows the initial pose explained nothing of the mask (MVE {EXPLAINS_NOTHING} or more): {other}"
                ),
            ),
            (
                flat,
                format!(
                    "in {flat} of {rows} rows the surface inside the mask is flat, but the model at the pose is not: {other}"
                ),
            ),
        ];
        let texts = texts.into_iter().filter(|(count, _)| *count > 0);
        let texts = texts.map(|(_, text)| text).collect();
        Self { unexplained, texts }
    }

    /// Warns of these poses.
    pub(super) fn warn(&self, job: &RefineJob<'_>) {
        let which = match (job.rows, job.listed_by) {
            (Some(path), _) => format!(" ({} lists them)", path.display()),
            (None, Some(option)) => format!(" ({option} lists them)"),
            (None, None) => String::new(),
        };
        for text in &self.texts {
            warn(format_args!("{}: {text}{which}", job.output.display()));
        }
    }
}

/// Returns the mean seconds per pose that reached the pipeline; `None` without any.
pub(super) fn mean_seconds(results: &[FrameResult]) -> Option<f64> {
    let spent: f64 = results.iter().filter_map(|result| result.seconds).sum();
    let poses = rows_of(results).filter(|row| row.mve.is_some()).count();
    (poses > 0).then(|| spent / poses as f64)
}

/// Warns of missing files. Fails if a file is damaged, or no image or no detection was found.
pub(super) fn report_faults(
    job: &RefineJob<'_>,
    (models, models_dir): (&Models, &Path),
    results: &[FrameResult],
) -> anyhow::Result<()> {
    let unused = match job.estimates() {
        true => "left out",
        false => "unchanged",
    };
    if let Some(text) = models::missing(models, models_dir) {
        warn(format_args!("{text}; its rows are {unused}"));
    }
    let faults = results.iter().flat_map(|result| &result.faults);
    let is_of_mask = |fault: &Fault| fault.kind == FaultKind::MissingMask;
    let lacks_masks = matches!(job.masks, MaskSource::Visible) && faults.clone().any(is_of_mask);
    let damaged = faults::report(faults, models.broken.values());
    if lacks_masks {
        warn("rows without a mask of the ground truth need --detections FILE or --mask none");
    }
    if let Some(damaged) = damaged {
        let of_damaged = rows_of(results).filter(|row| row.status == RowStatus::Damaged);
        bail!(
            "{damaged}; {} {unused} in {}",
            counted(of_damaged.count(), "row"),
            job.output.display()
        );
    }
    let is_missing = |row: &RowResult| row.status == RowStatus::MissingFrame;
    if !results.is_empty() && rows_of(results).all(is_missing) {
        bail!(
            "{}: no image of its rows can be read in {}, expected --dataset, --split and --sensor to name their cameras and depth images",
            job.results.display(),
            job.dataset.root.join(&job.dataset.split).display()
        );
    }
    let is_empty = |row: &RowResult| row.status == RowStatus::NothingMeasured;
    if rows_of(results).all(|row| row.pose.is_none())
        && job.estimates()
        && rows_of(results).any(is_empty)
    {
        warn(format_args!(
            "{}: no pose is estimated: check that bbox is x, y, width, height in pixels of the depth image, and segmentation of its size",
            job.results.display()
        ));
    }
    let is_undetected = |row: &RowResult| row.status == RowStatus::NoMask;
    if matches!(job.masks, MaskSource::Detections(_))
        && !results.is_empty()
        && rows_of(results).all(is_undetected)
    {
        bail!(
            "{}: none of its rows has a detection, expected --detections with a segmentation or bbox of their scene_id, image_id and category_id",
            job.results.display()
        );
    }
    Ok(())
}

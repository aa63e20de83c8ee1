//! What a `bop refine` tells at its end.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use anyhow::bail;
use hicp_bop::{FrameResult, Models, RowStatus};
use hybrid_icp::{EXPLAINS_NOTHING, PAPER_ALPHA, Warning};

use super::{median, models, problem};
use crate::terminal::warn;

/// What the summary says of the run.
pub(super) struct Told<'a> {
    pub(super) output: &'a Path,
    pub(super) seconds: f64,
    pub(super) threads: usize,
    /// Images whose results were in the journal.
    pub(super) resumed: usize,
}

impl Told<'_> {
    /// Counts the rows by what became of them.
    pub(super) fn summary(
        &self,
        results: &[FrameResult],
        models: &Models,
        doubted: &Doubted,
    ) -> String {
        let rows = || results.iter().flat_map(|result| &result.rows);
        let mut text = format!(
            "{}: {} rows of {} frames in {:.1} s on {} threads",
            self.output.display(),
            rows().count(),
            results.len(),
            self.seconds,
            self.threads,
        );
        // Writing to a string does not fail.
        if self.resumed > 0 {
            let _ = write!(text, ", {} frames from the journal", self.resumed);
        }
        let mut counts: BTreeMap<RowStatus, usize> = BTreeMap::new();
        for row in rows() {
            *counts.entry(row.status).or_default() += 1;
        }
        for (status, count) in &counts {
            let _ = write!(text, "\n  {count:>7}  {status}");
            if *status == RowStatus::MissingModel {
                let ids: Vec<String> = models.missing.iter().map(u32::to_string).collect();
                let _ = write!(text, " (object {})", ids.join(", "));
            }
        }
        let (mut before, mut after): (Vec<f64>, Vec<f64>) =
            rows().filter_map(|row| row.mve).unzip();
        if let (Some(before), Some(after)) = (median(&mut before), median(&mut after)) {
            let _ = write!(text, "\n  median MVE {before:.3} -> {after:.3}");
        }
        if doubted.unexplained > 0 {
            let _ = write!(
                text,
                "\n  {:>7}  with an MVE of {PAPER_ALPHA} or more: not to be trusted",
                doubted.unexplained
            );
        }
        text
    }
}

/// How many rows that got as far as the pipeline have a pose that is not to be trusted.
pub(super) struct Doubted {
    rows: usize,
    unexplained: usize,
    elsewhere: usize,
    flat: usize,
}

impl Doubted {
    pub(super) fn of(results: &[FrameResult]) -> Self {
        let rows = results.iter().flat_map(|result| &result.rows);
        let mut doubted = Self {
            rows: 0,
            unexplained: 0,
            elsewhere: 0,
            flat: 0,
        };
        for row in rows.filter(|row| row.mve.is_some()) {
            doubted.rows += 1;
            for warning in row.warnings() {
                match warning {
                    Warning::Unexplained { .. } => doubted.unexplained += 1,
                    Warning::FoundElsewhere { .. } => doubted.elsewhere += 1,
                    Warning::Flat { .. } => doubted.flat += 1,
                    // Of single rows: a few that got a little worse are no reason to look at the whole.
                    _ => {}
                }
            }
        }
        doubted
    }
}

/// Warns of poses in the output that are not to be trusted; `which` says what tells them from the others.
pub(super) fn warn_of_distrust(output: &Path, doubted: &Doubted, which: &str) {
    let (output, rows) = (output.display(), doubted.rows);
    if doubted.unexplained > 0 {
        warn(format_args!(
            "{output}: {} of {rows} rows have an MVE of {PAPER_ALPHA} or more after refinement: they are not to be trusted{which}",
            doubted.unexplained
        ));
    }
    if doubted.elsewhere > 0 {
        warn(format_args!(
            "{output}: in {} of {rows} rows the initial pose explained nothing of the mask (MVE {EXPLAINS_NOTHING} or more): what was found there may be another object{which}",
            doubted.elsewhere
        ));
    }
    if doubted.flat > 0 {
        warn(format_args!(
            "{output}: in {} of {rows} rows the surface inside the mask is flat, and that of the model at the pose is not: what was found there may be another object{which}",
            doubted.flat
        ));
    }
}

/// Mean seconds per pose that got as far as the pipeline, `None` without any.
pub(super) fn mean_seconds(results: &[FrameResult]) -> Option<f64> {
    let spent: f64 = results.iter().filter_map(|result| result.seconds).sum();
    let rows = results.iter().flat_map(|result| &result.rows);
    let poses = rows.filter(|row| row.mve.is_some()).count();
    (poses > 0).then(|| spent / poses as f64)
}

/// Warns of what is missing, and fails where something is damaged or nothing is there.
///
/// `files` are the input, the output, and the folder of the images; with the models comes the folder that they are in.
pub(super) fn report_faults(
    (input, output, images): (&Path, &Path, &Path),
    (models, models_dir): (&Models, &Path),
    results: &[FrameResult],
) -> anyhow::Result<()> {
    let faults = results.iter().flat_map(|result| &result.faults);
    if let Some(text) = models::tell_missing(models, models_dir) {
        warn(format_args!("{text}; its rows are unchanged"));
    }
    let damaged = problem::tell(faults, models.broken.values());
    if damaged > 0 {
        bail!(
            "{damaged} files could not be used; their rows are in {} unchanged",
            output.display()
        );
    }
    let mut rows = results.iter().flat_map(|result| &result.rows);
    if !results.is_empty() && rows.all(|row| row.status == RowStatus::MissingFrame) {
        bail!(
            "{}: none of its frames is in {}, expected --dataset and --split to name the images that it was made for",
            input.display(),
            images.display()
        );
    }
    Ok(())
}

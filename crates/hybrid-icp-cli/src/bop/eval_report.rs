//! What an evaluation found: a table for people, JSON for programs.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use hybrid_icp::Recalls;
use serde::Serialize;

use super::calibration::Calibration;
use super::judge::Judged;
use super::median;

/// The recalls of a part of the dataset.
#[derive(Debug, Serialize)]
pub(crate) struct Summary {
    /// Instances asked for and judged.
    pub(super) targets: usize,
    /// Those of them beyond the number of estimates.
    missing: usize,
    pub(super) ar: f64,
    pub(super) ar_vsd: f64,
    pub(super) ar_mssd: f64,
    pub(super) ar_mspd: f64,
    /// Recall of ADD, of ADI for symmetric objects, below a tenth of the diameter.
    ad_recall: f64,
    /// Median ADI of the estimates that are matched to an instance, millimetres; `null` without any.
    pub(super) median_adi_mm: Option<f64>,
}

impl Summary {
    fn of<'a>(targets: impl Iterator<Item = &'a Judged>) -> Self {
        let (mut recalls, mut adi) = (Recalls::default(), Vec::new());
        for target in targets {
            recalls.count(&target.errors);
            let found = target.errors.adi_of_instances();
            adi.extend(found.into_iter().flatten().map(|m| 1e3 * m));
        }
        Self {
            targets: recalls.instances(),
            missing: recalls.missing(),
            ar: recalls.average(),
            ar_vsd: recalls.vsd(),
            ar_mssd: recalls.mssd(),
            ar_mspd: recalls.mspd(),
            ad_recall: recalls.ad(),
            median_adi_mm: median(&mut adi),
        }
    }
}

/// The recalls of a dataset.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    results: String,
    dataset: String,
    split: String,
    /// Visibility tolerance of VSD, millimetres.
    delta_mm: f64,
    /// Instances asked for that could not be judged: no image, no model, no ground truth.
    left_out: usize,
    #[serde(flatten)]
    pub(super) all: Summary,
    pub(super) objects: BTreeMap<u32, Summary>,
    warnings: Vec<String>,
    /// Whether the scores tell right from wrong, where asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) calibration: Option<Calibration>,
}

/// What was evaluated.
#[derive(Debug)]
pub(crate) struct Subject {
    pub(crate) results: String,
    pub(crate) dataset: String,
    pub(crate) split: String,
    pub(crate) delta_mm: f64,
}

impl Report {
    pub(crate) fn new(
        subject: Subject,
        targets: &[&Judged],
        left_out: usize,
        warnings: Vec<String>,
    ) -> Self {
        let mut by_object: BTreeMap<u32, Vec<&Judged>> = BTreeMap::new();
        for target in targets {
            by_object.entry(target.obj_id).or_default().push(target);
        }
        let objects = by_object.into_iter();
        Self {
            results: subject.results,
            dataset: subject.dataset,
            split: subject.split,
            delta_mm: subject.delta_mm,
            left_out,
            all: Summary::of(targets.iter().copied()),
            objects: objects
                .map(|(id, targets)| (id, Summary::of(targets.into_iter())))
                .collect(),
            warnings,
            calibration: None,
        }
    }

    /// Returns whether nothing was judged.
    pub(crate) fn is_empty(&self) -> bool {
        self.all.targets == 0
    }

    /// Instances that could not be judged.
    pub(crate) fn left_out(&self) -> usize {
        self.left_out
    }

    /// Returns a table of the recalls, objects first.
    pub(crate) fn table(&self) -> String {
        let mut text = format!(
            "{:>6} {:>7} {:>7} {:>6} {:>6} {:>6} {:>6} {:>13} {:>13}",
            "object",
            "targets",
            "missing",
            "AR",
            "VSD",
            "MSSD",
            "MSPD",
            "AD(D/I)<0.1d",
            "median ADI mm"
        );
        let named = self.objects.iter().map(|(id, part)| (id.to_string(), part));
        for (name, part) in named.chain([("all".to_owned(), &self.all)]) {
            let median = part.median_adi_mm;
            let median = median.map_or("-".to_owned(), |mm| format!("{mm:.2}"));
            // Writing to a string does not fail.
            let _ = write!(
                text,
                "\n{name:>6} {:>7} {:>7} {:>6.3} {:>6.3} {:>6.3} {:>6.3} {:>13.3} {median:>13}",
                part.targets,
                part.missing,
                part.ar,
                part.ar_vsd,
                part.ar_mssd,
                part.ar_mspd,
                part.ad_recall
            );
        }
        if self.left_out > 0 {
            let _ = write!(
                text,
                "\n{} targets could not be judged and are in no figure",
                self.left_out
            );
        }
        if let Some(calibration) = &self.calibration {
            let _ = write!(text, "\n{}", calibration.table());
        }
        text
    }
}

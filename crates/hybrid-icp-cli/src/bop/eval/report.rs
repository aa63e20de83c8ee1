//! The report of an evaluation: a table for people, JSON for programs.

use std::collections::BTreeMap;

use hicp_bop::Judged;
use hybrid_icp::score::{MSSD_MM, N_THRESHOLDS, Recalls};
use serde::Serialize;

use super::calibration::Calibration;
use crate::bop::statistics::median;
use crate::terminal::{row, table};

/// The recalls of a part of the dataset.
#[derive(Debug, Serialize)]
pub(crate) struct Summary {
    /// Number of evaluated instances.
    pub(crate) targets: usize,
    /// Number of evaluated instances without an estimate.
    missing: usize,
    pub(crate) ar: f64,
    pub(crate) ar_vsd: f64,
    pub(crate) ar_mssd: f64,
    pub(crate) ar_mspd: f64,
    /// Recall of ADD(-S) below a tenth of the diameter.
    ad_recall: f64,
    /// Median ADI in millimeters of the estimates that match an instance; `null` without any.
    pub(crate) median_adi_mm: Option<f64>,
    /// Recall of MSSD below a tenth of the diameter.
    pub(crate) mssd_recall: f64,
    /// Recall of ADD below a tenth of the diameter, without symmetric objects; `null` without
    /// others.
    pub(crate) add_recall: Option<f64>,
    /// Recalls of MSSD below 2, 4, …, 20 mm.
    mssd_mm_recalls: [f64; N_THRESHOLDS],
}

impl Summary {
    /// Summarizes targets.
    pub(super) fn of(targets: &[&Judged]) -> Self {
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
            mssd_recall: recalls.mssd_below_tenth(),
            add_recall: recalls.add(),
            mssd_mm_recalls: recalls.mssd_mm(),
        }
    }

    /// Summarizes the targets of each object.
    pub(super) fn by_object(targets: &[&Judged]) -> BTreeMap<u32, Self> {
        let mut by_object: BTreeMap<u32, Vec<&Judged>> = BTreeMap::new();
        for target in targets {
            by_object.entry(target.obj_id).or_default().push(target);
        }
        let objects = by_object.iter();
        objects
            .map(|(id, of_object)| (*id, Self::of(of_object)))
            .collect()
    }

    fn cells(&self, name: String) -> Vec<String> {
        let recalls = [
            self.ar,
            self.ar_vsd,
            self.ar_mssd,
            self.ar_mspd,
            self.ad_recall,
        ];
        let mut cells = vec![name, self.targets.to_string(), self.missing.to_string()];
        cells.extend(recalls.map(|recall| format!("{recall:.3}")));
        let median = self.median_adi_mm;
        cells.push(median.map_or("-".to_owned(), |mm| format!("{mm:.2}")));
        cells.push(format!("{:.3}", self.mssd_recall));
        let add = self.add_recall;
        cells.push(add.map_or("-".to_owned(), |recall| format!("{recall:.3}")));
        cells
    }
}

/// The recalls of a dataset.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    pub(super) results: String,
    pub(super) dataset: String,
    pub(super) split: String,
    /// Visibility tolerance of VSD in millimeters.
    pub(super) delta_mm: f64,
    /// Requested instances that could not be evaluated: no image, no model, or no ground truth.
    pub(super) left_out: usize,
    #[serde(flatten)]
    pub(crate) all: Summary,
    pub(crate) objects: BTreeMap<u32, Summary>,
    pub(super) warnings: Vec<String>,
    /// Reports whether the scores rank correct poses first, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) calibration: Option<Calibration>,
    /// ADI of the evaluated estimates to the nearest instance of their target in meters, by row.
    #[serde(skip)]
    pub(crate) adi_m: BTreeMap<usize, f64>,
    /// The AR of each image, times the number of its instances, and that number.
    #[serde(skip)]
    pub(crate) ar_by_image: Vec<(f64, usize)>,
}

const HEADS: &str = "object|targets|missing|AR|VSD|MSSD|MSPD|AD(D/I)<0.1d|median ADI mm|\
    MSSD<0.1d|ADD<0.1d";

impl Report {
    /// Returns a table of the recalls, objects first.
    pub(super) fn table(&self) -> String {
        let mut rows = vec![row(HEADS)];
        let objects = self.objects.iter();
        rows.extend(objects.map(|(id, summary)| summary.cells(id.to_string())));
        rows.push(self.all.cells("all".to_owned()));
        let mut text = table(&rows, 0);
        let recalls = MSSD_MM.iter().zip(self.all.mssd_mm_recalls);
        let recalls = recalls.map(|(mm, recall)| format!("{mm} mm {recall:.3}"));
        let recalls: Vec<String> = recalls.collect();
        text.push_str(&format!("\nrecall of MSSD below {}", recalls.join(", ")));
        if let Some(left_out) = self.left_out() {
            text.push_str(&format!("\n{left_out}"));
        }
        if let Some(calibration) = &self.calibration {
            text.push_str(&format!("\n{}", calibration.table()));
        }
        text
    }

    /// Reports the targets that could not be evaluated, if there are any.
    pub(crate) fn left_out(&self) -> Option<String> {
        let count = self.left_out;
        (count > 0).then(|| format!("{count} targets could not be evaluated and are left out"))
    }
}

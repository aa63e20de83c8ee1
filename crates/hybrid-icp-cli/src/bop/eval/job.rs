//! The evaluation of a result file, for every command that needs one.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use anyhow::bail;
use clap::Args;
use hicp_bop::{EvaluatedObject, FrameKey, Judge, Judged, JudgedFrame, Renders, Scenes, Targets};
use hicp_io::bop::ResultRow;
use rayon::prelude::*;

use super::calibration::Calibration;
use super::errors;
use super::report::{Report, Summary};
use crate::bop::options::{DatasetOptions, ThreadOptions};
use crate::bop::{faults, models, targets};
use crate::limits::limits;
use crate::options::positive;
use crate::outputs::write_json;
use crate::terminal::{progress_bar, say_beside, warn};

/// The benchmark's visibility tolerance in millimeters.
pub(crate) const DELTA_MM: f64 = 15.0;

/// Largest number of messages about images that are reported one by one.
const MISFITS_SHOWN: usize = 10;

/// An evaluation of a result file.
#[derive(Debug, Args)]
pub(crate) struct EvalJob {
    #[command(flatten)]
    pub(crate) dataset: DatasetOptions,
    /// The result file: CSV with scene_id, im_id, obj_id, score, R, t and time.
    #[arg(long, value_name = "FILE.csv")]
    pub(crate) results: PathBuf,
    /// The file of targets; test_targets_bop19.json of the dataset if not given. Without both,
    /// every visible instance is a target.
    #[arg(long, value_name = "FILE.json")]
    pub(crate) targets: Option<PathBuf>,
    /// Ids of the objects whose ADD(-S) is ADI; those with declared symmetries if not given.
    #[arg(long, value_name = "ID,…", value_delimiter = ',')]
    pub(crate) symmetric: Option<Vec<u32>>,
    /// Visibility tolerance of VSD in millimeters; the benchmark uses 5 for ITODD.
    #[arg(long = "delta", value_name = "MM", default_value_t = DELTA_MM, value_parser = positive)]
    pub(crate) delta_mm: f64,
    /// Also write the recalls as JSON.
    #[arg(long, value_name = "FILE.json")]
    pub(crate) json: Option<PathBuf>,
    /// Also write the errors of every estimate against every instance of its target as CSV.
    #[arg(long, value_name = "FILE.csv")]
    pub(crate) errors: Option<PathBuf>,
    /// Also report whether the scores, from 0 to 1, rank correct rows first: the area under the ROC
    /// curve, and the share of correct rows by range of the score. A row is correct if its MSSD
    /// is below a tenth of the diameter; ADI is reported, too.
    #[arg(long)]
    pub(crate) calibration: bool,
    #[command(flatten)]
    pub(crate) threads: ThreadOptions,
    /// If `true`, prints no table.
    #[arg(skip)]
    pub(crate) quiet: bool,
}

impl EvalJob {
    /// Evaluates the file, prints the table, and writes the outputs.
    pub(crate) fn run(&self) -> anyhow::Result<Report> {
        let rows = limits().read_results(&self.results)?;
        let dataset = self.dataset.open()?;
        let split = &self.dataset.split;
        let wanted = targets::choose(&dataset, split, self.targets.as_deref())?;
        let has_target = |row: &ResultRow| {
            let of_frame = wanted.get(&(row.scene_id, row.im_id));
            of_frame.is_some_and(|objects| objects.contains_key(&row.obj_id))
        };
        if let Some(first) = rows.first().filter(|_| !rows.iter().any(has_target)) {
            bail!(
                "{}: none of {} rows has a target; the first is object {} in image {} of scene {}: expected the --dataset, --split and --targets of these results",
                self.results.display(),
                rows.len(),
                first.obj_id,
                first.im_id,
                first.scene_id
            );
        }
        let objects: BTreeSet<u32> = wanted.values().flat_map(|t| t.keys().copied()).collect();
        let pool = self.threads.pool(wanted.len())?;
        let scenes = Scenes::new(&dataset, split, pool.current_num_threads() + 1);
        let models_dir = dataset.eval_models_dir()?;
        let models = pool.install(|| models::read(&models_dir, &objects))?;
        let info = models_dir.join("models_info.json");
        let diameters = pool.install(|| models::wrong_diameters(&models, &info));
        let objects = EvaluatedObject::of_models(&models, self.symmetric.as_deref());
        let judge = Judge::new(objects, &scenes, &rows, 1e-3 * self.delta_mm);
        let progress = progress_bar(wanted.len(), "images");
        let images: Vec<(&FrameKey, &BTreeMap<u32, u32>)> = wanted.iter().collect();
        let judged: Vec<JudgedFrame> = pool.install(|| {
            let images = images.par_iter().with_max_len(1);
            let judged = images.map_init(Renders::default, |renders, (image, wanted)| {
                let judged = judge.frame(renders, **image, wanted);
                progress.inc(1);
                judged
            });
            judged.collect()
        });
        progress.finish_and_clear();
        let calibration = pool.install(|| {
            let calibration = || Calibration::of(&rows, &scenes, &judge.objects);
            self.calibration.then(calibration)
        });

        let mut warnings: Vec<String> = diameters.into_values().collect();
        warnings.extend(models::undescribed(&models, &info));
        warnings.extend(models::wrong_symmetries(&models, &info));
        warnings.extend(self.misfits(&rows, &wanted));
        let missing = models::missing(&models, &models_dir);
        warnings.extend(missing.map(|text| format!("{text}; its targets are left out")));
        let misfits = judged.iter().flat_map(|image| image.misfits.clone());
        let misfits: BTreeSet<String> = misfits.collect();
        let mut misfits: Vec<String> = misfits.into_iter().collect();
        let more = misfits.len().saturating_sub(MISFITS_SHOWN);
        misfits.truncate(MISFITS_SHOWN);
        warnings.append(&mut misfits);
        if more > 0 {
            warnings.push(format!("{more} more files that do not match"));
        }
        warnings.iter().for_each(warn);
        let targets: Vec<&Judged> = judged.iter().flat_map(|image| &image.targets).collect();
        let evaluated = judged.iter().filter(|image| !image.targets.is_empty());
        let ar_by_image = evaluated.map(|image| {
            let of_image = Summary::of(&image.targets.iter().collect::<Vec<_>>());
            (of_image.ar * of_image.targets as f64, of_image.targets)
        });
        let errors = targets
            .iter()
            .flat_map(|t| t.rows.iter().zip(&t.errors.estimates));
        let adi_m = errors.map(|(row, against)| {
            let adi = against.iter().map(|errors| errors.adi_m);
            (*row, adi.fold(f64::INFINITY, f64::min))
        });
        let report = Report {
            results: self.results.display().to_string(),
            dataset: self.dataset.root.display().to_string(),
            split: split.clone(),
            delta_mm: self.delta_mm,
            left_out: judged.iter().map(|image| image.left_out).sum(),
            all: Summary::of(&targets),
            objects: Summary::by_object(&targets),
            warnings,
            calibration,
            adi_m: adi_m.collect(),
            ar_by_image: ar_by_image.collect(),
        };
        if let Some(path) = &self.errors {
            errors::write(path, &targets, &rows)?;
        }
        if let Some(path) = &self.json {
            write_json(path, &report)?;
        }
        let is_empty = report.all.targets == 0;
        if !is_empty && !self.quiet {
            let outputs = [&self.json, &self.errors].map(Option::as_deref);
            say_beside(&outputs, report.table())?;
        }
        let faults = judged.iter().flat_map(|image| &image.faults);
        if let Some(damaged) = faults::report(faults, models.broken.values()) {
            bail!("{damaged}; their targets are left out of the results");
        }
        if is_empty {
            bail!(
                "none of the {} targets could be evaluated, expected --dataset and --split to name images with ground truth, depth and models",
                report.left_out
            );
        }
        Ok(report)
    }

    /// Returns warnings about rows without a target and rows beyond the instances of their target.
    fn misfits(&self, rows: &[ResultRow], wanted: &Targets) -> Vec<String> {
        let results = self.results.display();
        let mut warnings = Vec::new();
        let (mut strangers, mut beyond) = (Vec::new(), 0);
        let mut counts: BTreeMap<(u32, u32, u32), u32> = BTreeMap::new();
        for row in rows {
            let of_frame = wanted.get(&(row.scene_id, row.im_id));
            let Some(wanted) = of_frame.and_then(|objects| objects.get(&row.obj_id)) else {
                strangers.push(row);
                continue;
            };
            let count = counts.entry((row.scene_id, row.im_id, row.obj_id));
            let count = count.and_modify(|count| *count += 1).or_insert(1);
            beyond += usize::from(*count > *wanted);
        }
        if rows.is_empty() {
            warnings.push(format!("{results} has no rows"));
        }
        // No camera sees an object that is nearer than 2 cm.
        let nearest = |row: &ResultRow| row.camera_from_object().translation.vector.norm() < 0.02;
        if !rows.is_empty() && rows.iter().all(nearest) {
            warnings.push(format!(
                "{results}: all translations are below 20 mm: expected the unit mm, they may be in m"
            ));
        }
        if let Some(first) = strangers.first() {
            warnings.push(format!(
                "{results}: {} of {} rows have no target and are ignored; the first is object {} in image {} of scene {}",
                strangers.len(),
                rows.len(),
                first.obj_id,
                first.im_id,
                first.scene_id
            ));
        }
        if beyond > 0 {
            warnings.push(format!(
                "{results}: {beyond} rows are ignored, because their target has fewer instances than rows; they have the lowest scores, or are the last of equal ones"
            ));
        }
        warnings
    }
}

//! `hybrid-icp bop eval`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use clap::Args;
use hicp_bop::{FrameKey, Models, Scenes, Targets, frames_of};
use hicp_io::bop::{Dataset, ResultRow};
use rayon::prelude::*;

use super::calibration::Calibration;
use super::eval_report::{Report, Subject, Summary};
use super::judge::{EvaluatedObject, Judge, Judged, JudgedFrame, Renders};
use super::{errors_csv, models, problem, progress_bar, targets, thread_pool};
use crate::limits::limits;
use crate::outputs;
use crate::terminal::{say, warn};

/// Compare a result file with the ground truth, as the BOP benchmark does.
///
/// The table has, per object and in all, the average recalls of VSD, MSSD and MSPD, their mean AR, the recall of ADD below a
/// tenth of the diameter (of ADI for symmetric objects), and the median ADI. Of every target the estimates with the best
/// scores are matched greedily to the most visible instances; an instance without an estimate counts as not found.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
pub(crate) struct Arguments {
    /// The dataset's folder, with models_eval/ (or models/) and the split's folder.
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// The split's folder: test, test_primesense, train_pbr, …
    #[arg(long, value_name = "NAME", default_value = "test")]
    split: String,
    /// The result file: CSV with scene_id, im_id, obj_id, score, R, t and time.
    #[arg(long, value_name = "FILE.csv")]
    results: PathBuf,
    /// The targets; test_targets_bop19.json of the dataset if not given, every visible instance if there is none.
    #[arg(long, value_name = "FILE.json")]
    targets: Option<PathBuf>,
    /// Objects whose AD is ADI; those with declared symmetries if not given.
    #[arg(long, value_name = "ID,…", value_delimiter = ',')]
    symmetric: Option<Vec<u32>>,
    /// Visibility tolerance of VSD in millimetres; the benchmark takes 5 for ITODD.
    #[arg(long, value_name = "MM", default_value_t = DELTA_MM, value_parser = super::positive)]
    delta: f64,
    /// Also write the recalls as JSON.
    #[arg(long, value_name = "FILE.json")]
    json: Option<PathBuf>,
    /// Also write the errors of every estimate against every instance of its target as CSV.
    #[arg(long, value_name = "FILE.csv")]
    errors: Option<PathBuf>,
    /// Also tell whether the scores of all rows, from 0 to 1, rank the correct ones (ADI below a tenth of the diameter) first:
    /// the area under the ROC curve, and the share that is correct by range of the score.
    #[arg(long)]
    calibration: bool,
    /// Threads; the number of cores if not given. Nothing but the time depends on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..), allow_negative_numbers = true)]
    threads: Option<u16>,
}

const USAGE: &str = "\
hybrid-icp bop eval --dataset <DIR> [--split <NAME>]
           --results <FILE.csv> [OPTIONS]";

const EXAMPLE: &str = "\
Example:
  hybrid-icp bop eval --dataset bop/ycbv --split test \\
      --results cosypose_ycbv-test.csv --errors errors.csv

Exit codes: 0 done, with warnings of targets and rows that do not fit; 1 a file
is damaged or nothing could be judged (what could be judged is still told);
2 the command line is wrong.";

/// The benchmark's visibility tolerance.
pub(super) const DELTA_MM: f64 = 15.0;

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    evaluate(arguments).map(|_| ())
}

/// What an evaluation found.
pub(super) struct Evaluation {
    pub(super) all: Summary,
    pub(super) objects: BTreeMap<u32, Summary>,
    /// ADI of the estimates that were looked at to the nearest instance of their target, metres, by their row.
    pub(super) adi_m: BTreeMap<usize, f64>,
}

impl Arguments {
    /// The command without options, with its report as JSON.
    pub(super) fn plain(
        (dataset, split): (&Path, &str),
        results: &Path,
        json: PathBuf,
        threads: Option<u16>,
    ) -> Self {
        Self {
            dataset: dataset.to_owned(),
            split: split.to_owned(),
            results: results.to_owned(),
            targets: None,
            symmetric: None,
            delta: DELTA_MM,
            json: Some(json),
            errors: None,
            calibration: false,
            threads,
        }
    }
}

/// Runs the command.
pub(super) fn evaluate(arguments: &Arguments) -> anyhow::Result<Evaluation> {
    let written: Vec<outputs::Named<'_>> = [
        ("--json", arguments.json.as_deref()),
        ("--errors", arguments.errors.as_deref()),
    ]
    .into_iter()
    .filter_map(|(option, path)| Some((option, path?)))
    .collect();
    let mut read = vec![("--results", arguments.results.as_path())];
    read.extend(arguments.targets.as_deref().map(|p| ("--targets", p)));
    outputs::check(&written, &read, &[])?;
    outputs::check_dataset(&written, (&arguments.dataset, &arguments.split))?;

    let rows = limits().read_results(&arguments.results)?;
    let dataset = Dataset::open(&arguments.dataset)?.with_limits(limits());
    dataset.scene_ids(&arguments.split)?;
    let targets = targets::choose(&dataset, &arguments.split, arguments.targets.as_deref())?;
    let objects: BTreeSet<u32> = targets.values().flat_map(|t| t.keys().copied()).collect();
    let pool = thread_pool(arguments.threads, targets.len())?;
    let scenes = Scenes::new(&dataset, &arguments.split, pool.current_num_threads() + 1);
    let models_dir = dataset.eval_models_dir()?;
    let models = pool.install(|| models::read(&models_dir, &objects))?;
    let diameters = pool.install(|| models::diameter_warnings(&models, &models_dir));

    let judge = Judge {
        objects: EvaluatedObject::of_models(&models, arguments.symmetric.as_deref()),
        scenes: &scenes,
        rows: &rows,
        rows_of: frames_of(&rows).into_iter().collect(),
        delta: 1e-3 * arguments.delta,
    };
    let frames: Vec<(&FrameKey, &BTreeMap<u32, u32>)> = targets.iter().collect();
    let progress = progress_bar(frames.len(), "images");
    let judged: Vec<JudgedFrame> = pool.install(|| {
        let frames = frames.par_iter().with_max_len(1);
        frames
            .map_init(Renders::default, |renders, (frame, wanted)| {
                let judged = judge.frame(renders, **frame, wanted);
                progress.inc(1);
                judged
            })
            .collect()
    });
    progress.finish_and_clear();
    let calibration = arguments
        .calibration
        .then(|| pool.install(|| Calibration::of(&rows, &scenes, &judge.objects)));
    report(
        arguments,
        &rows,
        (&targets, &models, &models_dir),
        diameters.into_values().collect(),
        &judged,
        calibration,
    )
}

/// Tells and writes what was found; `warnings` are those that there were before.
fn report(
    arguments: &Arguments,
    rows: &[ResultRow],
    (wanted, models, models_dir): (&Targets, &Models, &Path),
    mut warnings: Vec<String>,
    frames: &[JudgedFrame],
    calibration: Option<Calibration>,
) -> anyhow::Result<Evaluation> {
    warnings.extend(misfits(
        arguments,
        rows,
        wanted,
        (models, models_dir),
        frames,
    ));
    for text in &warnings {
        warn(text);
    }
    let targets: Vec<&Judged> = frames.iter().flat_map(|frame| &frame.targets).collect();
    let left_out = frames.iter().map(|frame| frame.left_out).sum();
    let subject = Subject {
        results: arguments.results.display().to_string(),
        dataset: arguments.dataset.display().to_string(),
        split: arguments.split.clone(),
        delta_mm: arguments.delta,
    };
    let mut report = Report::new(subject, &targets, left_out, warnings);
    report.calibration = calibration;
    if let Some(path) = &arguments.errors {
        errors_csv::write(path, &targets, rows)?;
    }
    if let Some(path) = &arguments.json {
        let text = serde_json::to_string_pretty(&report).context("cannot write JSON")?;
        hicp_io::write_atomically(path, |file| writeln!(file, "{text}"))?;
    }
    if !report.is_empty() {
        say(report.table())?;
    }
    let faults = frames.iter().flat_map(|frame| &frame.faults);
    let damaged = problem::tell(faults, models.broken.values());
    if damaged > 0 {
        bail!("{damaged} files could not be used; their targets are in no figure");
    }
    if report.is_empty() {
        bail!(
            "none of the {} targets could be judged, expected --dataset and --split to name images with ground truth, depth and models",
            report.left_out()
        );
    }
    let mut adi_m = BTreeMap::new();
    for target in targets {
        for (row, against) in target.rows.iter().zip(&target.errors.estimates) {
            let adi = against.iter().map(|errors| errors.adi_m);
            adi_m.insert(*row, adi.fold(f64::INFINITY, f64::min));
        }
    }
    Ok(Evaluation {
        all: report.all,
        objects: report.objects,
        adi_m,
    })
}

/// Returns what does not fit between results, targets and dataset.
fn misfits(
    arguments: &Arguments,
    rows: &[ResultRow],
    wanted: &Targets,
    (models, models_dir): (&Models, &Path),
    frames: &[JudgedFrame],
) -> Vec<String> {
    let mut warnings = Vec::new();
    let results = arguments.results.display();
    let count = |row: &ResultRow| {
        let of_frame = wanted.get(&(row.scene_id, row.im_id));
        of_frame
            .and_then(|objects| objects.get(&row.obj_id))
            .copied()
    };
    let of_no_target: Vec<&ResultRow> = rows.iter().filter(|row| count(row).is_none()).collect();
    if let Some(first) = of_no_target.first() {
        warnings.push(format!(
            "{results}: {} of {} rows are of no target and not looked at, the first of object {} in image {} of scene {}",
            of_no_target.len(),
            rows.len(),
            first.obj_id,
            first.im_id,
            first.scene_id
        ));
    }
    let mut estimates: BTreeMap<(FrameKey, u32), usize> = BTreeMap::new();
    for row in rows {
        let target = ((row.scene_id, row.im_id), row.obj_id);
        *estimates.entry(target).or_default() += 1;
    }
    let beyond = |((frame, obj_id), n): (&(FrameKey, u32), &usize)| {
        let count = wanted.get(frame).and_then(|objects| objects.get(obj_id));
        count.map_or(0, |count| n.saturating_sub(*count as usize))
    };
    let beyond: usize = estimates.iter().map(beyond).sum();
    if beyond > 0 {
        warnings.push(format!(
            "{results}: {beyond} rows beyond the number of instances of their target are not looked at, those with the lowest scores"
        ));
    }
    if let Some(text) = models::tell_missing(models, models_dir) {
        warnings.push(format!("{text}; its targets are left out"));
    }
    let of_frames: Vec<&String> = frames.iter().flat_map(|frame| &frame.misfits).collect();
    warnings.extend(
        of_frames
            .iter()
            .take(MISFITS_SHOWN)
            .map(|&text| text.clone()),
    );
    if of_frames.len() > MISFITS_SHOWN {
        warnings.push(format!(
            "{} more files that do not fit",
            of_frames.len() - MISFITS_SHOWN
        ));
    }
    warnings
}

/// Most misfits of frames that are told one by one.
const MISFITS_SHOWN: usize = 10;

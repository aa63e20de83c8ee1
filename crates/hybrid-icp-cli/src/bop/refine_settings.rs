//! What the results of a `bop refine` depend on.

use std::collections::BTreeSet;
use std::io::ErrorKind;
use std::path::Path;
use std::time::UNIX_EPOCH;

use clap::ValueEnum as _;
use hicp_bop::MaskSource;
use hicp_io::bop::{Dataset, ResultRow};

use super::digest;
use super::refine::Arguments;
use crate::choice::Pipeline;

/// What is set, and to what.
pub(super) type Setting = (String, String);

/// Returns what the results depend on, by option and by file of the dataset: a run goes on only with the work of one that has the
/// same. Images are not looked at, there are too many.
pub(super) fn of(
    arguments: &Arguments,
    pipeline: &Pipeline,
    rows: &[ResultRow],
    masks: &MaskSource,
    models_dir: &Path,
) -> Vec<Setting> {
    let mut settings: Vec<Setting> = options(arguments, pipeline, rows, masks)
        .into_iter()
        .map(|(option, value)| (option.to_owned(), value))
        .collect();
    settings.extend(files(arguments, rows, models_dir));
    settings
}

fn options(
    arguments: &Arguments,
    pipeline: &Pipeline,
    rows: &[ResultRow],
    masks: &MaskSource,
) -> Vec<(&'static str, String)> {
    let stated = |value: Option<String>| value.unwrap_or_else(|| "not given".to_owned());
    let dataset = arguments.dataset.canonicalize();
    let dataset = dataset.unwrap_or_else(|_| arguments.dataset.clone());
    let mask = arguments.mask.to_possible_value();
    let targets = arguments.targets.as_ref();
    let detections = match masks {
        MaskSource::Detections(by_frame) => Some(digest::of_value(by_frame)),
        _ => None,
    };
    vec![
        ("hybrid-icp", env!("CARGO_PKG_VERSION").to_owned()),
        ("--dataset", dataset.display().to_string()),
        ("--split", arguments.split.clone()),
        ("--limit", stated(arguments.limit.map(|n| n.to_string()))),
        ("--top-k", stated(arguments.top_k.map(|k| k.to_string()))),
        (
            "--targets",
            stated(targets.map(|path| path.display().to_string())),
        ),
        ("--shard", stated(arguments.shard.map(|s| s.to_string()))),
        ("--results with the digest", digest::of_value(&rows)),
        (
            "--mask",
            mask.map_or_else(String::new, |m| m.get_name().to_owned()),
        ),
        ("--detections with the digest", stated(detections)),
        ("--pipeline", pipeline.name().to_owned()),
        (
            "--pipeline with the digest",
            digest::of_value(&(pipeline.toml(), pipeline.overrides())),
        ),
    ]
}

/// The files that say what the models are and what is in the images of the scenes that rows name, each with its state.
///
/// Two files of one size and time of change are taken for the same: reading them all would take as long as some runs.
fn files(arguments: &Arguments, rows: &[ResultRow], models_dir: &Path) -> Vec<Setting> {
    let objects: BTreeSet<u32> = rows.iter().map(|row| row.obj_id).collect();
    let scenes: BTreeSet<u32> = rows.iter().map(|row| row.scene_id).collect();
    let mut paths = vec![models_dir.join("models_info.json")];
    paths.extend(
        objects
            .iter()
            .map(|id| Dataset::model_path_in(models_dir, *id)),
    );
    let split = arguments.dataset.join(&arguments.split);
    for scene in scenes {
        let names = ["scene_camera.json", "scene_gt.json", "scene_gt_info.json"];
        paths.extend(names.map(|name| split.join(format!("{scene:06}")).join(name)));
    }
    let named = |path: &Path| {
        let inside = path.strip_prefix(&arguments.dataset).unwrap_or(path);
        (inside.display().to_string(), state(path))
    };
    paths.iter().map(|path| named(path)).collect()
}

/// The size of a file and when it was changed, seconds since 1970.
fn state(path: &Path) -> String {
    let metadata = match std::fs::metadata(path) {
        Ok(metadata) => metadata,
        Err(error) if error.kind() == ErrorKind::NotFound => return "not there".to_owned(),
        Err(error) => return error.to_string(),
    };
    let changed = metadata.modified().ok();
    let changed = changed.and_then(|time| time.duration_since(UNIX_EPOCH).ok());
    let changed = changed.map_or_else(
        || "a time that is not known".to_owned(),
        |since| format!("{}.{:09}", since.as_secs(), since.subsec_nanos()),
    );
    format!("of {} bytes, changed at {changed}", metadata.len())
}

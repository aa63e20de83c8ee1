//! Warnings about the models and the images of a dataset, once per object.

use std::collections::{BTreeMap, BTreeSet};

use hicp_bop::{FrameResult, ModelFolder, Models};
use hicp_io::bop::ResultRow;
use hybrid_icp::{Warning, warnings_of_model};

use crate::bop::advice::{advice, is_about_diameter};
use crate::bop::models;
use crate::terminal::warn;

/// Largest number of objects with the same advice that are reported one by one.
const OBJECTS_SHOWN: usize = 3;

/// Largest number of scenes that a message names.
const SCENES_SHOWN: usize = 5;

/// Warns of models that seem to have another unit and of diameters that differ from the meshes.
pub(super) fn about_models(models: &Models, folder: &ModelFolder) {
    let diameters = models::wrong_diameters(models, folder.info_path());
    for (obj_id, model) in &models.by_id {
        let diameter = diameters.get(obj_id);
        diameter.into_iter().for_each(warn);
        for warning in warnings_of_model(model) {
            // One warning about the same number is enough.
            if diameter.is_none() || !is_about_diameter(&warning) {
                warn(format_args!(
                    "object {obj_id}: {warning}: check that {} is in mm",
                    folder.dir().display()
                ));
            }
        }
    }
}

/// A scene, its number of images with the warning, its number of images, and the first warning.
type OfScene = (u32, usize, usize, Warning);

/// Returns warnings about flaws in most images of an object in a scene.
///
/// Each scene has its own files. `poses` says how to check the poses, if there are any.
/// If only a few images have the flaw, their poses are wrong, and the files are right.
pub(super) fn about_images(
    results: &[FrameResult],
    rows: &[ResultRow],
    poses: Option<&str>,
) -> Vec<String> {
    let mut images: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    // The advice identifies the kind of warning.
    let mut warned: BTreeMap<(u32, String, u32), (usize, Warning)> = BTreeMap::new();
    for result in results {
        // All rows of a result are of one image.
        let Some(scene_id) = result.rows.first().map(|row| rows[row.index].scene_id) else {
            continue;
        };
        let refined = result.rows.iter().filter(|row| row.mve.is_some());
        let objects: BTreeSet<u32> = refined.map(|row| rows[row.index].obj_id).collect();
        for obj_id in objects {
            *images.entry((obj_id, scene_id)).or_default() += 1;
        }
        for (obj_id, warning) in &result.warnings {
            if let Some(advice) = advice(warning, poses) {
                let of_scene = warned.entry((*obj_id, advice, scene_id));
                of_scene.or_insert((0, *warning)).0 += 1;
            }
        }
    }
    let mut by_object: BTreeMap<(u32, String), Vec<OfScene>> = BTreeMap::new();
    for ((obj_id, advice, scene_id), (count, first)) in warned {
        let all = images.get(&(obj_id, scene_id)).copied().unwrap_or(count);
        if 2 * count > all {
            let of_object = by_object.entry((obj_id, advice)).or_default();
            of_object.push((scene_id, count, all, first));
        }
    }
    let mut texts = Vec::new();
    let mut objects: BTreeMap<String, usize> = BTreeMap::new();
    for ((obj_id, advice), scenes) in by_object {
        let number = objects.entry(advice.clone()).or_default();
        *number += 1;
        if *number > OBJECTS_SHOWN {
            continue;
        }
        let first = scenes[0].3;
        let count: usize = scenes.iter().map(|(_, count, ..)| count).sum();
        let all: usize = scenes.iter().map(|(_, _, all, _)| all).sum();
        let scenes: Vec<u32> = scenes.iter().map(|(scene_id, ..)| *scene_id).collect();
        let scenes = name_scenes(&scenes);
        texts.push(format!(
            "object {obj_id}: {first} ({count} of {all} images of {scenes}): {advice}"
        ));
    }
    for (advice, number) in objects {
        if number > OBJECTS_SHOWN {
            let more = number - OBJECTS_SHOWN;
            texts.push(format!("{more} more objects like this: {advice}"));
        }
    }
    texts
}

/// Names scenes by their ids, the first few of many.
fn name_scenes(scenes: &[u32]) -> String {
    let shown = models::ids(scenes.iter().take(SCENES_SHOWN));
    match scenes.len() {
        1 => format!("scene {shown}"),
        count if count <= SCENES_SHOWN => format!("scenes {shown}"),
        count => format!("scenes {shown} and {} more", count - SCENES_SHOWN),
    }
}

//! Warnings about the models and the images of a dataset, once per object.

use std::collections::{BTreeMap, BTreeSet};

use hicp_bop::FrameResult;
use hicp_io::bop::ResultRow;
use hybrid_icp::Warning;

use crate::bop::advice::advice;
use crate::bop::models;

/// Largest number of objects with the same advice that are described one by one.
const OBJECTS_SHOWN: usize = 3;
/// Largest number of scenes or of further objects that a message names.
const IDS_SHOWN: usize = 5;

/// A scene, its number of images with the warning, its number of images, and the first warning.
type OfScene = (u32, usize, usize, Warning);

/// Returns warnings about flaws in most images of an object in a scene.
///
/// Each scene has its own files. `poses` is the advice to check the poses, if there are any. If
/// only a few images have the flaw, their poses are wrong, and the files are right.
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
    let mut objects: BTreeMap<String, Vec<u32>> = BTreeMap::new();
    for ((obj_id, advice), scenes) in by_object {
        let alike = objects.entry(advice.clone()).or_default();
        alike.push(obj_id);
        if alike.len() > OBJECTS_SHOWN {
            continue;
        }
        let first = scenes[0].3;
        let count: usize = scenes.iter().map(|(_, count, ..)| count).sum();
        let all: usize = scenes.iter().map(|(_, _, all, _)| all).sum();
        let scenes: Vec<u32> = scenes.iter().map(|(scene_id, ..)| *scene_id).collect();
        let scenes = named("scene", &scenes);
        texts.push(format!(
            "object {obj_id}: {first} ({count} of {all} images of {scenes}): {advice}"
        ));
    }
    for (advice, alike) in objects {
        if let Some(others @ [_, ..]) = alike.get(OBJECTS_SHOWN..) {
            texts.push(format!("{} likewise: {advice}", named("object", others)));
        }
    }
    texts
}

/// Names scenes or objects by their ids, the first few of many.
fn named(noun: &str, all: &[u32]) -> String {
    let shown = models::ids(all.iter().take(IDS_SHOWN));
    match all.len() {
        1 => format!("{noun} {shown}"),
        count if count <= IDS_SHOWN => format!("{noun}s {shown}"),
        count => format!("{noun}s {shown} and {} more", count - IDS_SHOWN),
    }
}

#[cfg(test)]
mod tests {
    use hicp_bop::{RowResult, RowStatus};
    use hybrid_icp::core::Isometry3;

    use super::*;

    #[test]
    fn three_objects_with_the_same_advice_are_described_and_the_others_named() {
        let rows = (0..5).map(|id| ResultRow::new(1, id, id, Isometry3::identity()));
        let rows: Vec<_> = rows.collect();
        let result = |index: usize| FrameResult {
            rows: vec![RowResult::unrefined(index, RowStatus::NoMask)],
            warnings: vec![(rows[index].obj_id, Warning::NoDepth)],
            ..FrameResult::default()
        };
        let results: Vec<_> = (0..5).map(result).collect();
        let texts = about_images(&results, &rows, None);
        assert_eq!(texts.len(), 4, "{texts:?}");
        assert!(texts[2].starts_with("object 2: "), "{texts:?}");
        assert!(texts[3].starts_with("objects 3, 4 likewise: "), "{texts:?}");
    }
}

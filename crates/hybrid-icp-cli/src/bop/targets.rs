//! The targets of an evaluation.

use std::path::Path;

use anyhow::bail;
use hicp_bop::{MIN_VISIBLE_FRACTION, Targets, chain, states_visibility, visible_objects};
use hicp_io::IoErrorKind;
use hicp_io::bop::Dataset;

use crate::limits::limits;
use crate::terminal::warn;

/// Name of the benchmark's file of targets.
const TARGETS_FILE: &str = "test_targets_bop19.json";

/// Reads the targets from `given`, or for a split of the test images from the dataset's file.
///
/// Without both, every visible instance is a target.
pub(crate) fn choose(
    dataset: &Dataset,
    split: &str,
    given: Option<&Path>,
) -> anyhow::Result<Targets> {
    let of_dataset = dataset.root().join(TARGETS_FILE);
    let is_test = split.starts_with("test");
    let path = match given {
        Some(path) => path,
        None if is_test && !hicp_io::is_absent(&of_dataset) => &of_dataset,
        None => {
            let why = match is_test {
                true => format!("{} does not exist", of_dataset.display()),
                false => format!("{TARGETS_FILE} is not about the split {split}"),
            };
            warn(format_args!(
                "{why}: every instance of the split with a visible fraction of {MIN_VISIBLE_FRACTION} or more is a target",
            ));
            return of_ground_truth(dataset, split);
        }
    };
    read(path)
}

/// Reads a file of targets, and checks that it has each target once.
pub(crate) fn read(path: &Path) -> anyhow::Result<Targets> {
    let mut targets = Targets::new();
    for target in limits().read_targets(path)? {
        let (scene_id, im_id, obj_id) = (target.scene_id, target.im_id, target.obj_id);
        let of_frame = targets.entry((scene_id, im_id)).or_default();
        if of_frame.insert(obj_id, target.inst_count).is_some() {
            bail!(
                "{}: object {obj_id} in image {im_id} of scene {scene_id} appears twice, expected once with its inst_count",
                path.display()
            );
        }
    }
    if targets.is_empty() {
        bail!("{} has no target, expected at least one", path.display());
    }
    Ok(targets)
}

/// Returns the visible instances of all scenes. Warns of scenes without cameras.
fn of_ground_truth(dataset: &Dataset, split: &str) -> anyhow::Result<Targets> {
    let (mut targets, mut unstated) = (Targets::new(), None);
    for scene_id in dataset.scene_ids(split)? {
        let scene = match dataset.scene(split, scene_id) {
            Ok(scene) => scene,
            Err(error) if error.kind == IoErrorKind::Missing => {
                warn(format_args!("{}; the scene is left out", chain(&error)));
                continue;
            }
            Err(error) => return Err(error.into()),
        };
        for im_id in scene.image_ids() {
            if unstated.is_none() && !states_visibility(&scene, im_id) {
                unstated = Some(scene.file("scene_gt_info"));
            }
            for obj_id in visible_objects(&scene, im_id) {
                let of_image = targets.entry((scene_id, im_id)).or_default();
                *of_image.entry(obj_id).or_default() += 1;
            }
        }
    }
    if let Some(path) = unstated {
        warn(format_args!(
            "{}: no visib_fract of some instances, which count as fully visible",
            path.display()
        ));
    }
    if targets.is_empty() {
        bail!(
            "{}: no scene has a visible instance in scene_gt.json, expected ground truth to evaluate against",
            dataset.root().join(split).display()
        );
    }
    Ok(targets)
}

//! What looks wrong about a dataset, its models and the rows together, told once per object.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use hicp_bop::{FrameResult, Models};
use hicp_io::bop::ResultRow;
use hybrid_icp::{Warning, warnings_of_model};

use super::models;
use crate::terminal::warn;

/// Most scenes that are named one by one.
const SCENES_SHOWN: usize = 5;

/// What a warning that needs an image is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    NoDepth,
    Depth,
    Mask,
    Sliver,
}

impl Kind {
    pub(super) fn of(warning: &Warning) -> Option<Self> {
        match warning {
            Warning::NoDepth => Some(Self::NoDepth),
            Warning::Depth { .. } => Some(Self::Depth),
            Warning::Mask { .. } => Some(Self::Mask),
            Warning::Sliver { .. } => Some(Self::Sliver),
            // Models are looked at by themselves, and a pose behind the camera is a matter of its row.
            _ => None,
        }
    }

    /// Where to look for the cause; `poses` is the option that states them.
    pub(super) fn advice(self, poses: &str) -> String {
        match self {
            Self::NoDepth => "check depth_scale in scene_camera.json".to_owned(),
            Self::Depth => {
                format!(
                    "check depth_scale in scene_camera.json, and that {poses} states millimetres"
                )
            }
            Self::Mask => {
                format!("check that models are in mm, and that {poses} states millimetres")
            }
            Self::Sliver => "check that models are in mm, and what the masks are of".to_owned(),
        }
    }
}

/// Warns of models that look as if they were in another unit, and of diameters that are not those of their meshes.
pub(super) fn about_models(models: &Models, models_dir: &Path) {
    let diameters = models::diameter_warnings(models, models_dir);
    for (obj_id, model) in &models.by_id {
        let diameter = diameters.get(obj_id);
        if let Some(text) = diameter {
            warn(text);
        }
        // One warning about the same number is enough.
        let told =
            |warning: &Warning| diameter.is_some() && matches!(warning, Warning::Diameter { .. });
        for warning in warnings_of_model(model)
            .iter()
            .filter(|warning| !told(warning))
        {
            warn(format_args!(
                "object {obj_id}: {warning}: check that {} is in mm",
                models_dir.display()
            ));
        }
    }
}

/// A warning about an object: how often it was had in the scenes where it was had of most images.
#[derive(Debug)]
struct Told {
    first: Warning,
    doubted: usize,
    images: usize,
    scenes: Vec<u32>,
}

/// Warns of what looks wrong in most images of an object in a scene, for each scene has its own files; in a few images it is the rows' poses
/// that are far off.
pub(super) fn about_images(results: &[FrameResult], rows: &[ResultRow]) {
    let mut images: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    let mut doubted: BTreeMap<(u32, Kind, u32), (usize, Warning)> = BTreeMap::new();
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
            if let Some(kind) = Kind::of(warning) {
                let entry = doubted.entry((*obj_id, kind, scene_id));
                entry.or_insert((0, *warning)).0 += 1;
            }
        }
    }
    let mut told: BTreeMap<(u32, Kind), Told> = BTreeMap::new();
    for ((obj_id, kind, scene_id), (count, first)) in doubted {
        let all = images.get(&(obj_id, scene_id)).copied().unwrap_or(count);
        if 2 * count > all {
            let told = told.entry((obj_id, kind)).or_insert(Told {
                first,
                doubted: 0,
                images: 0,
                scenes: Vec::new(),
            });
            told.doubted += count;
            told.images += all;
            told.scenes.push(scene_id);
        }
    }
    for ((obj_id, kind), told) in told {
        warn(format_args!(
            "object {obj_id}: {} ({} of {} images of {}): {}",
            told.first,
            told.doubted,
            told.images,
            name_scenes(&told.scenes),
            kind.advice("--results")
        ));
    }
}

/// Scenes by their ids, a few of them.
fn name_scenes(scenes: &[u32]) -> String {
    let ids: Vec<String> = scenes.iter().map(u32::to_string).collect();
    match ids.as_slice() {
        [one] => format!("scene {one}"),
        few if few.len() <= SCENES_SHOWN => format!("scenes {}", few.join(", ")),
        many => format!(
            "scenes {} and {} more",
            many[..SCENES_SHOWN].join(", "),
            many.len() - SCENES_SHOWN
        ),
    }
}

//! What looks wrong about a dataset, its models and the rows together, told once per object.

use std::collections::BTreeMap;
use std::path::Path;

use hicp_bop::{FrameResult, Models};
use hicp_io::bop::ResultRow;
use hybrid_icp::{Doubt, doubts_of_model};

use crate::terminal::warn;

/// What a doubt that needs an image is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    NoDepth,
    Depth,
    Mask,
    Sliver,
}

impl Kind {
    fn of(doubt: &Doubt) -> Option<Self> {
        match doubt {
            Doubt::NoDepth => Some(Self::NoDepth),
            Doubt::Depth { .. } => Some(Self::Depth),
            Doubt::Mask { .. } => Some(Self::Mask),
            Doubt::Sliver { .. } => Some(Self::Sliver),
            // Models are looked at by themselves, and a pose behind the camera is a matter of its row.
            _ => None,
        }
    }

    fn advice(self) -> &'static str {
        match self {
            Self::NoDepth => "check depth_scale in scene_camera.json",
            Self::Depth => {
                "check depth_scale in scene_camera.json, and that --results states millimetres"
            }
            Self::Mask => "check that models are in mm, and that --results states millimetres",
            Self::Sliver => "check that models are in mm, and what the masks are of",
        }
    }
}

/// Warns of models that look as if they were in another unit.
pub(super) fn about_models(models: &Models, models_dir: &Path) {
    for (obj_id, model) in &models.by_id {
        for doubt in doubts_of_model(model) {
            warn(format_args!(
                "object {obj_id}: {doubt}: check that {} is in mm",
                models_dir.display()
            ));
        }
    }
}

/// Warns of what looks wrong in most images of an object; in a few it is the rows' poses that are far off.
pub(super) fn about_images(results: &[FrameResult], rows: &[ResultRow]) {
    let mut images: BTreeMap<u32, usize> = BTreeMap::new();
    let mut doubted: BTreeMap<(u32, Kind), (usize, Doubt)> = BTreeMap::new();
    for result in results {
        let refined = result.rows.iter().filter(|row| row.mve.is_some());
        let mut objects: Vec<u32> = refined.map(|row| rows[row.index].obj_id).collect();
        objects.sort_unstable();
        objects.dedup();
        for obj_id in objects {
            *images.entry(obj_id).or_default() += 1;
        }
        for (obj_id, doubt) in &result.doubts {
            if let Some(kind) = Kind::of(doubt) {
                doubted.entry((*obj_id, kind)).or_insert((0, *doubt)).0 += 1;
            }
        }
    }
    for ((obj_id, kind), (count, first)) in doubted {
        let all = images.get(&obj_id).copied().unwrap_or(count);
        if 2 * count > all {
            warn(format_args!(
                "object {obj_id}: {first} ({count} of {all} images): {}",
                kind.advice()
            ));
        }
    }
}

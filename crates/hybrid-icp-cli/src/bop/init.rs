//! The images of an object that is followed, and its initial pose.

use std::path::Path;

use anyhow::{Context as _, bail};
use hicp_io::bop::{ResultRow, Scene};
use hybrid_icp::core::Isometry3;

use crate::limits::limits;

/// Returns the ids of a scene's images in ascending order, from the first or from `first`.
pub(super) fn images(scene: &Scene, first: Option<u32>) -> anyhow::Result<Vec<u32>> {
    let file = scene.dir().join("scene_camera.json");
    if let Some(first) = first
        && !scene.image_ids().any(|id| id == first)
    {
        bail!(
            "--first {first} is not an image of {}, expected one of its {}",
            file.display(),
            scene.image_ids().count()
        );
    }
    let images: Vec<u32> = scene.image_ids().filter(|id| Some(*id) >= first).collect();
    if images.is_empty() {
        bail!("{} has no image, expected at least one", file.display());
    }
    Ok(images)
}

/// Reads the pose from a pose file or a result file (`.csv`).
///
/// Of a result file, returns the row with the highest score for `place`: a scene, image and object.
pub(super) fn read(path: &Path, place: (u32, u32, u32)) -> anyhow::Result<Isometry3<f64>> {
    if path.extension().is_none_or(|extension| extension != "csv") {
        let pose = limits()
            .read_pose_json(path)
            .context("cannot read --init")?;
        return Ok(pose.camera_from_object);
    }
    let (scene_id, im_id, obj_id) = place;
    let rows = limits().read_results(path).context("cannot read --init")?;
    let of_place = |row: &&ResultRow| (row.scene_id, row.im_id, row.obj_id) == place;
    // Of rows with equal scores, the first is used.
    let best = rows.iter().filter(of_place).reduce(
        |best, row| {
            if row.score > best.score { row } else { best }
        },
    );
    match best {
        Some(row) => Ok(row.camera_from_object()),
        None => bail!(
            "--init {}: none of its {} rows is for scene {scene_id}, image {im_id}, object {obj_id}, expected at least one: start from another image with --first",
            path.display(),
            rows.len()
        ),
    }
}

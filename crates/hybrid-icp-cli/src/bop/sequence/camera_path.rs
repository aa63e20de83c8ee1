//! The motion of the camera through a scene.

use anyhow::{Context as _, bail};
use hicp_io::bop::Scene;
use hybrid_icp::fusion::CameraMotion;

/// Returns the images of a scene by ascending id, each with the camera's motion since the last.
///
/// The path starts with the scene's first image or with `first`. Each image needs a camera pose.
pub(super) fn camera_path(
    scene: &Scene,
    first: Option<u32>,
) -> anyhow::Result<Vec<(u32, CameraMotion)>> {
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
    let mut path = Vec::new();
    let mut before = None;
    for im_id in scene.image_ids().filter(|id| Some(*id) >= first) {
        let now = scene.camera_from_world(im_id)?;
        let motion = before.map_or(Ok(CameraMotion::none()), |before| {
            CameraMotion::new(now * before)
        });
        let motion = motion.with_context(|| format!("{}, $.{im_id}.cam_t_w2c", file.display()))?;
        path.push((im_id, motion));
        before = Some(now.inverse());
    }
    if path.is_empty() {
        bail!("{} has no image, expected at least one", file.display());
    }
    Ok(path)
}

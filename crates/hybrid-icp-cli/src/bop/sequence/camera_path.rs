//! The motion of the camera through a scene.

use anyhow::Context as _;
use hicp_io::bop::Scene;
use hybrid_icp::fusion::CameraMotion;

/// Returns images of a scene in the given order, each with the camera's motion since the last.
///
/// Each image needs a camera pose.
pub(super) fn camera_path(
    scene: &Scene,
    images: &[u32],
) -> anyhow::Result<Vec<(u32, CameraMotion)>> {
    let file = scene.file("scene_camera");
    let mut path = Vec::new();
    let mut before = None;
    for im_id in images.iter().copied() {
        let now = scene.camera_from_world(im_id)?;
        let motion = before.map_or(Ok(CameraMotion::none()), |before| {
            CameraMotion::new(now * before)
        });
        let motion = motion.with_context(|| format!("{}, $.{im_id}.cam_t_w2c", file.display()))?;
        path.push((im_id, motion));
        before = Some(now.inverse());
    }
    Ok(path)
}

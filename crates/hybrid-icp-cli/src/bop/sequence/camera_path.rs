//! How the camera moves through a scene.

use anyhow::{Context as _, bail};
use hicp_io::bop::Scene;
use hybrid_icp::fusion::CameraMotion;

use super::motion_between;

/// Images by ascending id with the motion of the camera since the one before.
#[derive(Debug)]
pub(super) struct CameraPath(Vec<(u32, CameraMotion)>);

impl CameraPath {
    /// The images of a scene, from its first or from the one named; each needs a camera pose.
    pub(super) fn of(scene: &Scene, first: Option<u32>) -> anyhow::Result<Self> {
        let file = scene.dir().join("scene_camera.json");
        if let Some(first) = first
            && !scene.image_ids().any(|id| id == first)
        {
            bail!(
                "--first {first} is no image of {}, expected one of its {}",
                file.display(),
                scene.image_ids().count()
            );
        }
        let mut motions = Vec::new();
        let mut before = None;
        for im_id in scene.image_ids().filter(|id| Some(*id) >= first) {
            let camera_from_world = scene.camera_from_world(im_id)?;
            let motion = motion_between(before.as_ref(), &camera_from_world)
                .with_context(|| format!("{}, $.{im_id}.cam_t_w2c", file.display()))?;
            motions.push((im_id, motion));
            before = Some(camera_from_world);
        }
        if motions.is_empty() {
            bail!("{} has no image, expected at least one", file.display());
        }
        Ok(Self(motions))
    }

    /// The image that the path begins with.
    pub(super) fn first(&self) -> u32 {
        self.0.first().map_or(0, |(im_id, _)| *im_id)
    }

    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    pub(super) fn image_ids(&self) -> impl Iterator<Item = u32> {
        self.0.iter().map(|(im_id, _)| *im_id)
    }

    pub(super) fn motions(&self) -> impl Iterator<Item = (u32, CameraMotion)> {
        self.0.iter().copied()
    }
}

//! What the JSON files of a scene state, by image.

use std::collections::BTreeMap;
use std::path::Path;

use hicp_core::{CameraError, Isometry3, Matrix3, PinholeCamera};

use crate::camera::{calibration, depth_scale};
use crate::error::IoError;
use crate::json::{Document, Node};
use crate::limits::ReadLimits;
use crate::pose::pose_of;
use crate::source::is_absent;

/// The camera of an image.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneCamera {
    /// Calibration matrix K, pixels; pixel centres at integers.
    pub matrix: Matrix3<f64>,
    /// Width and height of its images, where stated: a `cam_model` may, a `cam_K` does not.
    pub image_size: Option<(u32, u32)>,
    /// Millimetres per unit of the depth image, where stated.
    pub depth_scale: Option<f64>,
    /// Pose of the world in the camera frame, metres, where stated.
    pub camera_from_world: Option<Isometry3<f64>>,
}

/// The true pose of an object instance in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundTruth {
    /// The object.
    pub obj_id: u32,
    /// Its pose, metres.
    pub camera_from_object: Isometry3<f64>,
}

/// What is known of the visibility of an instance. Boxes are x, y, width, height in pixels, −1 where nothing is seen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GroundTruthInfo {
    /// Visible part of the silhouette, 0 to 1.
    pub visible_fraction: Option<f64>,
    /// Box of the whole silhouette.
    pub bbox_object: Option<[f64; 4]>,
    /// Box of the visible part.
    pub bbox_visible: Option<[f64; 4]>,
    /// Pixels of the visible part.
    pub visible_pixels: Option<u32>,
}

impl SceneCamera {
    /// Returns the camera for images of a size; the files rarely state it ([`SceneCamera::image_size`]).
    ///
    /// # Errors
    ///
    /// As [`PinholeCamera::from_matrix`].
    pub fn pinhole(&self, width: u32, height: u32) -> Result<PinholeCamera, CameraError> {
        PinholeCamera::from_matrix(&self.matrix, width, height)
    }
}

/// Reads a `scene_camera.json`.
pub(super) fn read_cameras(
    limits: &ReadLimits,
    path: &Path,
) -> Result<BTreeMap<u32, SceneCamera>, IoError> {
    by_image(limits, path, scene_camera)
}

/// Instances by image, in the order of the file.
type Instances<T> = BTreeMap<u32, Vec<T>>;

/// Reads a `scene_gt.json`, or returns `None` when there is none.
pub(super) fn read_ground_truth(
    limits: &ReadLimits,
    path: &Path,
) -> Result<Option<Instances<GroundTruth>>, IoError> {
    instances(limits, path, ground_truth)
}

/// Reads a `scene_gt_info.json`, or returns `None` when there is none.
pub(super) fn read_info(
    limits: &ReadLimits,
    path: &Path,
) -> Result<Option<Instances<GroundTruthInfo>>, IoError> {
    instances(limits, path, ground_truth_info)
}

fn by_image<T>(
    limits: &ReadLimits,
    path: &Path,
    read: impl Fn(&Node<'_>) -> Result<T, IoError>,
) -> Result<BTreeMap<u32, T>, IoError> {
    Document::read(limits, path)?
        .root()
        .numbered()?
        .into_iter()
        .map(|(im_id, node)| Ok((im_id, read(&node)?)))
        .collect()
}

/// Reads a list per image, or `None` when there is no such file.
fn instances<T>(
    limits: &ReadLimits,
    path: &Path,
    read: impl Fn(&Node<'_>) -> Result<T, IoError>,
) -> Result<Option<Instances<T>>, IoError> {
    if is_absent(path) {
        return Ok(None);
    }
    by_image(limits, path, |node| {
        node.items()?.iter().map(&read).collect()
    })
    .map(Some)
}

fn scene_camera(node: &Node<'_>) -> Result<SceneCamera, IoError> {
    // Half a pose is damage: reading it says what is missing.
    let has_pose = ["cam_R_w2c", "cam_t_w2c"]
        .iter()
        .any(|key| node.optional(key).is_some());
    let calibration = calibration(node)?;
    Ok(SceneCamera {
        matrix: calibration.matrix,
        image_size: calibration.image_size,
        depth_scale: depth_scale(node)?,
        camera_from_world: has_pose
            .then(|| pose_of(node, "cam_R_w2c", "cam_t_w2c"))
            .transpose()?
            .map(|pose| pose.camera_from_object),
    })
}

fn ground_truth(node: &Node<'_>) -> Result<GroundTruth, IoError> {
    Ok(GroundTruth {
        obj_id: node.get("obj_id")?.unsigned()?,
        camera_from_object: pose_of(node, "cam_R_m2c", "cam_t_m2c")?.camera_from_object,
    })
}

fn ground_truth_info(node: &Node<'_>) -> Result<GroundTruthInfo, IoError> {
    let optional = |key: &str| node.optional(key);
    Ok(GroundTruthInfo {
        visible_fraction: optional("visib_fract").map(|n| n.number()).transpose()?,
        bbox_object: optional("bbox_obj").map(|n| n.numbers()).transpose()?,
        bbox_visible: optional("bbox_visib").map(|n| n.numbers()).transpose()?,
        visible_pixels: optional("px_count_visib")
            .map(|n| n.unsigned())
            .transpose()?,
    })
}

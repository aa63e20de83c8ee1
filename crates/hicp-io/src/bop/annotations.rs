//! The content of a scene's JSON files, per image.

use std::collections::BTreeMap;
use std::path::Path;

use hicp_core::{CameraError, Isometry3, Matrix3, PinholeCamera};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::camera::CameraRecord;
use crate::error::IoError;
use crate::json::{self, ById, Numbers, Positive, optional_numbers};
use crate::limits::{Limit, ReadLimits};
use crate::pose::Rotation;
use crate::source::is_absent;

/// The camera of an image.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(try_from = "CameraRecord")]
pub struct SceneCamera {
    /// Calibration matrix K, pixels; pixel centers at integers.
    pub matrix: Matrix3<f64>,
    /// Width and height of its images in pixels, if stated.
    pub image_size: Option<(u32, u32)>,
    /// Millimeters per unit of the depth image, if stated.
    pub depth_scale: Option<f64>,
    /// Pose of the world in the camera frame, meters, if stated.
    pub camera_from_world: Option<Isometry3<f64>>,
}

impl TryFrom<CameraRecord> for SceneCamera {
    type Error = String;

    fn try_from(record: CameraRecord) -> Result<Self, String> {
        let calibration = record.calibration();
        let (matrix, image_size, _) =
            calibration.map_err(|(found, expected)| format!("{found}, expected {expected}"))?;
        let camera_from_world = match (&record.rotation, &record.translation_mm) {
            (None, None) => None,
            (Some(rotation), Some(translation)) => Some(rotation.with_translation(translation)),
            _ => return Err("half a pose, expected `cam_R_w2c` and `cam_t_w2c`".to_owned()),
        };
        let depth_scale = record.depth_scale.map(|Positive(scale)| scale);
        Ok(Self {
            matrix,
            image_size,
            depth_scale,
            camera_from_world,
        })
    }
}

/// The true pose of an object instance in the camera frame of an image.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(from = "TruthRecord")]
pub struct GroundTruth {
    /// The object.
    pub obj_id: u32,
    /// Pose of the object in the camera frame, meters.
    pub camera_from_object: Isometry3<f64>,
}

#[derive(Deserialize)]
struct TruthRecord {
    obj_id: u32,
    #[serde(rename = "cam_R_m2c")]
    rotation: Rotation,
    #[serde(rename = "cam_t_m2c")]
    translation_mm: Numbers<3>,
}

impl From<TruthRecord> for GroundTruth {
    fn from(record: TruthRecord) -> Self {
        Self {
            obj_id: record.obj_id,
            camera_from_object: record.rotation.with_translation(&record.translation_mm),
        }
    }
}

/// The visibility of an instance.
///
/// Boxes are x, y, width and height in pixels. All are −1 if no pixel is visible.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct GroundTruthInfo {
    /// Visible fraction of the silhouette, 0 to 1.
    #[serde(rename = "visib_fract", skip_serializing_if = "Option::is_none")]
    pub visible_fraction: Option<f64>,
    /// Box of the whole silhouette.
    #[serde(rename = "bbox_obj", skip_serializing_if = "Option::is_none")]
    #[serde(deserialize_with = "optional_numbers")]
    pub bbox_object: Option<[f64; 4]>,
    /// Box of the visible part of the silhouette.
    #[serde(rename = "bbox_visib", skip_serializing_if = "Option::is_none")]
    #[serde(deserialize_with = "optional_numbers")]
    pub bbox_visible: Option<[f64; 4]>,
    /// Number of pixels of the visible part.
    #[serde(rename = "px_count_visib", skip_serializing_if = "Option::is_none")]
    pub visible_pixels: Option<u32>,
}

impl SceneCamera {
    /// Returns the camera for images of a size, in pixels.
    ///
    /// The files rarely state the size ([`SceneCamera::image_size`]).
    ///
    /// # Errors
    ///
    /// As for [`PinholeCamera::from_matrix`].
    pub fn pinhole(&self, width: u32, height: u32) -> Result<PinholeCamera, CameraError> {
        PinholeCamera::from_matrix(&self.matrix, width, height)
    }
}

/// Reads a file with one value per image, or returns `None` if there is no such file.
pub(super) fn by_image<T: DeserializeOwned>(
    limits: &ReadLimits,
    path: &Path,
) -> Result<Option<BTreeMap<u32, T>>, IoError> {
    if is_absent(path) {
        return Ok(None);
    }
    let ById(values) = json::read(limits, path, Limit::JSON_BYTES)?;
    Ok(Some(values))
}

//! Camera models of BOP's `cam_model`, as in the dataset HOT3D.

use hicp_core::Matrix3;
use serde::de::{Deserialize, Deserializer, Error};

use crate::error::quote;

/// A camera model without distortion.
#[derive(Debug, serde::Deserialize)]
pub(crate) struct CameraModel {
    #[serde(rename = "projection_model_type", deserialize_with = "undistorted")]
    _name: (),
    /// fx, fy, cx and cy, in pixels.
    #[serde(deserialize_with = "intrinsics")]
    projection_params: [f64; 4],
    image_width: Option<u32>,
    image_height: Option<u32>,
}

impl CameraModel {
    /// Returns the calibration matrix, pixels.
    pub(crate) fn matrix(&self) -> Matrix3<f64> {
        let [fx, fy, cx, cy] = self.projection_params;
        Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0)
    }

    /// Returns the width and height of its images in pixels, if stated.
    pub(crate) fn image_size(&self) -> Option<(u32, u32)> {
        self.image_width.zip(self.image_height)
    }
}

/// Reads the name of a model and refuses models with distortion.
fn undistorted<'de, D: Deserializer<'de>>(deserializer: D) -> Result<(), D::Error> {
    let name = String::deserialize(deserializer)?;
    // HOT3D writes the prefix.
    let short = name.strip_prefix("CameraModelType.").unwrap_or(&name);
    if ["PinholePlane", "PINHOLE", "LINEAR"].contains(&short) {
        return Ok(());
    }
    Err(D::Error::custom(format!(
        "the model {}, expected a model without distortion (PinholePlane, PINHOLE or LINEAR): depth images of other \
         models must be undistorted first, and their camera stated by `cam_K`",
        quote(&name)
    )))
}

/// Reads fx, fy, cx, cy, or f, cx, cy if both focal lengths are equal.
fn intrinsics<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; 4], D::Error> {
    let numbers = Vec::deserialize(deserializer)?;
    match numbers[..] {
        [fx, fy, cx, cy] => Ok([fx, fy, cx, cy]),
        [f, cx, cy] => Ok([f, f, cx, cy]),
        _ => {
            let count = numbers.len();
            let text = format!("{count} numbers, expected fx, fy, cx and cy, or f, cx and cy");
            Err(D::Error::custom(text))
        }
    }
}

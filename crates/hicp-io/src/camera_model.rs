//! Camera models by name: BOP's `cam_model`, as HOT3D has it.

use hicp_core::Matrix3;
use serde::Deserialize;

use crate::error::quote;

/// A camera without distortion.
#[derive(Debug, Deserialize)]
pub(crate) struct CameraModel {
    #[serde(rename = "projection_model_type")]
    _name: Pinhole,
    projection_params: Intrinsics,
    image_width: Option<u32>,
    image_height: Option<u32>,
}

impl CameraModel {
    /// Returns the calibration matrix, pixels.
    pub(crate) fn matrix(&self) -> Matrix3<f64> {
        let Intrinsics([fx, fy, cx, cy]) = self.projection_params;
        Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0)
    }

    /// Returns the width and height of its images, if stated.
    pub(crate) fn image_size(&self) -> Option<(u32, u32)> {
        self.image_width.zip(self.image_height)
    }
}

/// The name of a model without distortion.
#[derive(Debug, Deserialize)]
#[serde(try_from = "String")]
struct Pinhole;

impl TryFrom<String> for Pinhole {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        // HOT3D writes the prefix.
        let short = name.strip_prefix("CameraModelType.").unwrap_or(&name);
        if ["PinholePlane", "PINHOLE", "LINEAR"].contains(&short) {
            return Ok(Self);
        }
        Err(format!(
            "the model {}, expected a model without distortion (PinholePlane, PINHOLE or LINEAR): depth images of other \
             models must be undistorted first, and their camera stated by `cam_K`",
            quote(&name)
        ))
    }
}

/// fx, fy, cx, cy; in files also f, cx, cy if both focal lengths are the same.
#[derive(Debug, Deserialize)]
#[serde(try_from = "Vec<f64>")]
struct Intrinsics([f64; 4]);

impl TryFrom<Vec<f64>> for Intrinsics {
    type Error = String;

    fn try_from(numbers: Vec<f64>) -> Result<Self, String> {
        match numbers[..] {
            [fx, fy, cx, cy] => Ok(Self([fx, fy, cx, cy])),
            [f, cx, cy] => Ok(Self([f, f, cx, cy])),
            _ => Err(format!(
                "{} numbers, expected fx, fy, cx and cy, or f, cx and cy",
                numbers.len()
            )),
        }
    }
}

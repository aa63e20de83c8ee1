//! Camera models by name: BOP's `cam_model`, as HOT3D has it.

use hicp_core::Matrix3;

use crate::error::IoError;
use crate::json::Node;

/// What a `cam_model` states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CameraModel {
    /// Calibration matrix, pixels.
    pub(crate) matrix: Matrix3<f64>,
    /// Width and height of its images, where stated.
    pub(crate) image_size: Option<(u32, u32)>,
}

/// Names of models without distortion, without the prefix that HOT3D gives them.
const PINHOLES: [&str; 3] = ["PinholePlane", "PINHOLE", "LINEAR"];

const EXPECTED: &str = "a model without distortion (PinholePlane, PINHOLE or LINEAR): depth images of other models must be undistorted first, and stated by `cam_K`";

/// Reads `{"projection_model_type", "projection_params", "image_width", "image_height"}`; the size is optional, further keys are ignored.
///
/// The parameters of a pinhole are fx, fy, cx, cy, or f, cx, cy where both focal lengths are one.
///
/// # Errors
///
/// [`IoError::JsonValue`] naming the key; for a model with distortion it names the model.
pub(crate) fn camera_model(node: &Node<'_>) -> Result<CameraModel, IoError> {
    let kind = node.get("projection_model_type")?;
    let Some(name) = kind.text() else {
        return Err(kind.refuse("the name of a camera model"));
    };
    let short = name.strip_prefix("CameraModelType.").unwrap_or(name);
    if !PINHOLES.contains(&short) {
        return Err(kind.refuse_found(format!("the model {name:?}"), EXPECTED));
    }
    let parameters = node.get("projection_params")?;
    let numbers = parameters.items()?;
    let [fx, fy, cx, cy] = match numbers.len() {
        4 => parameters.numbers()?,
        3 => {
            let [f, cx, cy] = parameters.numbers()?;
            [f, f, cx, cy]
        }
        count => {
            let found = format!("{count} numbers");
            return Err(parameters.refuse_found(found, "fx, fy, cx and cy, or f, cx and cy"));
        }
    };
    let side = |key: &str| node.optional(key).map(|n| n.unsigned()).transpose();
    Ok(CameraModel {
        matrix: Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0),
        image_size: side("image_width")?.zip(side("image_height")?),
    })
}

//! Reading of cameras from JSON files of BOP.

use std::collections::BTreeMap;
use std::path::Path;

use hicp_core::{CameraError, Matrix3, PinholeCamera};
use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::Value;

use super::distortion::{COEFFICIENTS, Distortion, is_distortion};
use super::model::CameraModel;
use crate::error::{IoError, IoErrorKind, Place};
use crate::json::{self, ById, Numbers, Positive};
use crate::limits::{Limit, ReadLimits};
use crate::pose::Rotation;
use crate::source::text_bytes;

/// The content of a camera file: the camera, its distortion, and the unit of its depth images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraFile {
    /// The camera.
    pub camera: PinholeCamera,
    /// Millimeters per unit of its depth images, if stated.
    pub depth_scale: Option<f64>,
    /// The distortion of its images, if any.
    pub distortion: Option<Distortion>,
}

/// Returns whether a JSON value has the form of BOP's cameras, which are without distortion.
pub(super) fn is_bop(root: &Value) -> bool {
    let Value::Object(members) = root else {
        return false;
    };
    let is_id = |key: &String| key.parse::<u32>().is_ok();
    let of_images = !members.is_empty() && members.keys().all(is_id);
    let camera = match members.values().next() {
        Some(Value::Object(first)) if of_images => first,
        _ => members,
    };
    if camera.contains_key("cam_model") {
        return true;
    }
    let is_stated = |key: &&str| camera.get(*key).is_some_and(|value| !value.is_null());
    let is_distorted = COEFFICIENTS.iter().any(is_stated)
        || camera.iter().any(|(key, value)| is_distortion(key, value));
    let flat = ["fx", "fy", "cx", "cy", "width", "height"];
    let is_flat = flat.iter().all(|key| camera.contains_key(*key)) && !camera.contains_key("ppx");
    !is_distorted && (camera.contains_key("cam_K") || is_flat)
}

/// The keys of all supported forms of a camera.
#[derive(Debug, Deserialize)]
pub(crate) struct CameraRecord {
    #[serde(rename = "cam_K")]
    cam_k: Option<Numbers<9>>,
    cam_model: Option<CameraModel>,
    fx: Option<f64>,
    fy: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    width: Option<u32>,
    height: Option<u32>,
    pub(crate) depth_scale: Option<Positive>,
    #[serde(rename = "cam_R_w2c")]
    pub(crate) rotation: Option<Rotation>,
    #[serde(rename = "cam_t_w2c")]
    pub(crate) translation_mm: Option<Numbers<3>>,
    #[serde(
        default,
        alias = "dist",
        alias = "D",
        alias = "coeffs",
        alias = "dist_coeffs",
        alias = "distCoeffs",
        alias = "distortion_coeffs",
        alias = "distortion_coefficients"
    )]
    distortion: Option<Value>,
    k1: Option<Value>,
}

/// A calibration matrix in pixels, the width and height of the images, and the key of the matrix.
///
/// The size is optional. The key starts with a dot.
type Calibration = (Matrix3<f64>, Option<(u32, u32)>, &'static str);

impl CameraRecord {
    /// Returns whether a coefficient of a distortion is not 0.
    fn is_distorted(&self) -> bool {
        self.distortion.iter().chain(&self.k1).any(has_number)
    }

    /// Returns the calibration. The error consists of the found and the expected text.
    pub(crate) fn calibration(&self) -> Result<Calibration, (&'static str, &'static str)> {
        let size = self.width.zip(self.height);
        let flat = [self.fx, self.fy, self.cx, self.cy];
        if self.is_distorted() {
            return Err((
                "the distortion of a lens",
                "images without distortion: undistort depth images and masks first",
            ));
        }
        match (&self.cam_k, &self.cam_model, flat, size) {
            (Some(_), Some(_), ..) => Err(("`cam_K` and `cam_model`", "one of them")),
            (Some(Numbers(k)), None, ..) => Ok((Matrix3::from_row_slice(k), size, ".cam_K")),
            (None, Some(model), ..) => {
                Ok((model.matrix(), model.image_size().or(size), ".cam_model"))
            }
            (None, None, [Some(fx), Some(fy), Some(cx), Some(cy)], Some(_)) => {
                let matrix = Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0);
                Ok((matrix, size, ""))
            }
            _ => Err((
                "an object without a camera",
                "the key `cam_K` or `cam_model`, or all of `fx`, `fy`, `cx`, `cy`, `width` and `height`",
            )),
        }
    }
}

/// Returns whether a value contains a number that is not 0.
fn has_number(value: &Value) -> bool {
    match value {
        Value::Array(items) => items.iter().any(has_number),
        Value::Object(members) => members.values().any(has_number),
        value => value.as_f64().is_some_and(|number| number != 0.0),
    }
}

/// Reads a camera from a JSON file, for images of `image_size` (width, height) in pixels.
///
/// Supports four forms and ignores unknown keys:
///
/// - `{"cam_K": [9 numbers, row-major], "depth_scale": ...}`, BOP's form without a size. A stated
///   size must match.
/// - `{"cam_model": {...}, "depth_scale": ...}`, BOP's newer form. The model has a
///   `projection_model_type` such as `"PinholePlane"`, and `projection_params`
///   `[fx, fy, cx, cy]` or `[f, cx, cy]`. Models with distortion are refused.
/// - `{"fx", "fy", "cx", "cy", "width", "height", "depth_scale"}`, the form of BOP's `camera.json`.
///   Its size must match.
/// - `{"7": {...}}`, a `scene_camera.json` of exactly one image in any of these forms.
///
/// `depth_scale` is optional in all forms. Distortion coefficients that are not 0 are refused;
/// [`read_camera`](crate::read_camera) accepts them next to `cam_K`.
///
/// # Errors
///
/// [`IoError`] names the JSON key of the fault. It is of the kind [`IoErrorKind::CameraSize`] if
/// the camera is for images of another size.
pub fn read_camera_json(
    path: impl AsRef<Path>,
    image_size: (u32, u32),
) -> Result<CameraFile, IoError> {
    ReadLimits::DEFAULT.read_camera_json(path, image_size)
}

impl ReadLimits {
    /// Reads a camera as [`read_camera_json`] does, from a file of at most `max_small_json_bytes`.
    ///
    /// # Errors
    ///
    /// As for [`read_camera_json`].
    pub fn read_camera_json(
        &self,
        path: impl AsRef<Path>,
        image_size: (u32, u32),
    ) -> Result<CameraFile, IoError> {
        let path = path.as_ref();
        let content = self.read(path, Limit::SMALL_JSON_BYTES)?;
        let text = text_bytes(path, &content)?;
        let keys: BTreeMap<String, IgnoredAny> = json::parse(path, text)?;
        if keys.is_empty() || keys.keys().any(|key| key.parse::<u32>().is_err()) {
            return camera_of(path, "$", &json::parse(path, text)?, image_size);
        }
        let ById(images) = json::parse(path, text)?;
        match images.iter().next() {
            Some((id, camera)) if images.len() == 1 => {
                camera_of(path, &format!("$.{id}"), camera, image_size)
            }
            _ => {
                let found = format!("cameras of {} images", images.len());
                let place = Place::Field("$".to_owned());
                Err(IoError::new(path, place, found, "a single camera"))
            }
        }
    }
}

/// Returns the name of the number that is wrong: fx, fy, cx or cy.
pub(super) fn number_of(error: &CameraError) -> Option<&'static str> {
    match error {
        CameraError::FocalLength { name, .. } | CameraError::PrincipalPoint { name, .. } => {
            Some(name)
        }
        _ => None,
    }
}

fn camera_of(
    path: &Path,
    key: &str,
    record: &CameraRecord,
    (width, height): (u32, u32),
) -> Result<CameraFile, IoError> {
    let refuse = |name: &str, found: &str, expected: &str| {
        IoError::new(path, Place::Field(format!("{key}{name}")), found, expected)
    };
    let calibration = record.calibration();
    let (matrix, size, name) =
        calibration.map_err(|(found, expected)| refuse("", found, expected))?;
    if let Some((w, h)) = size.filter(|size| *size != (width, height)) {
        let found = format!("a camera for {w}x{h} images");
        let error = refuse("", &found, &format!("one for {width}x{height}"));
        return Err(error.with_kind(IoErrorKind::CameraSize));
    }
    let camera = PinholeCamera::from_matrix(&matrix, width, height).map_err(|error| {
        let (found, expected) = ("numbers that are not a camera", "those of a pinhole camera");
        let number = number_of(&error).filter(|_| name.is_empty());
        let name = number.map_or(name.to_owned(), |number| format!(".{number}"));
        refuse(&name, found, expected).with_source(error)
    })?;
    let depth_scale = record.depth_scale.map(|Positive(scale)| scale);
    Ok(CameraFile {
        camera,
        depth_scale,
        distortion: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<CameraFile, IoError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("camera.json");
        std::fs::write(&path, text).unwrap();
        read_camera_json(&path, (640, 480))
    }

    const K: &str = r#""cam_K": [600.0, 0, 320.5, 0, 610, 240.25, 0, 0, 1]"#;
    const FLAT: &str =
        r#"{"fx": 600, "fy": 610, "cx": 320.5, "cy": 240.25, "width": 640, "height": 480}"#;

    #[test]
    fn all_forms_give_the_same_camera() {
        let camera = PinholeCamera::new(600.0, 610.0, 320.5, 240.25, 640, 480).unwrap();
        for (text, depth_scale) in [
            (format!("{{{K}}}"), None),
            (
                format!(r#"{{{K}, "depth_scale": 0.1, "note": "x"}}"#),
                Some(0.1),
            ),
            (format!(r#"{{"7": {{{K}, "depth_scale": 1}}}}"#), Some(1.0)),
            (format!(r#"{{"7": {FLAT}}}"#), None),
            (FLAT.to_owned(), None),
            (format!(r#"{{{K}, "dist": [[0, 0.0, 0, 0]]}}"#), None),
        ] {
            assert_eq!(
                read(&text).unwrap(),
                CameraFile {
                    camera,
                    depth_scale,
                    distortion: None
                }
            );
        }
    }

    #[test]
    fn a_distortion_is_refused() {
        for member in [
            r#""distortion": [0, 0.1, 0, 0]"#,
            r#""dist_coeffs": [[0.1, 0, 0, 0, 0]]"#,
            r#""dist": {"k1": 0.1}"#,
            r#""k1": 0.1"#,
        ] {
            let error = read(&format!(r#"{{"7": {{{K}, {member}}}}}"#)).unwrap_err();
            assert_eq!(error.found, "the distortion of a lens", "{error}");
        }
    }

    const MODEL: &str = r#"{"cam_model": {"projection_model_type": "PinholePlane", "label": "x",
        "projection_params": [600, 610, 320.5, 240.25], "image_width": 640, "image_height": 480}}"#;

    #[test]
    fn camera_models_without_distortion_are_pinholes() {
        let camera = |text: &str| read(text).map(|file| file.camera);
        let expected = camera(FLAT).unwrap();
        let linear = MODEL.replace("PinholePlane", "CameraModelType.LINEAR");
        let unsized_ = MODEL.replace(r#""image_width": 640, "image_height": 480"#, r#""x": 1"#);
        for text in [MODEL, &linear, &unsized_, &format!(r#"{{"7": {MODEL}}}"#)] {
            assert_eq!(camera(text).unwrap(), expected, "{text}");
        }
        let single = MODEL.replace("600, 610,", "600,");
        assert_eq!(camera(&single).unwrap().fy(), 600.0);

        let refused = |text: &str| match read(text) {
            Err(IoError {
                found,
                expected,
                place: Some(Place::Field(key)),
                ..
            }) => (key, found, expected),
            other => panic!("{other:?}"),
        };
        let fisheye = MODEL.replace("PinholePlane", "CameraModelType.FISHEYE624");
        let (key, found, expected) = refused(&fisheye);
        assert_eq!(key, "$.cam_model.projection_model_type");
        assert!(found.contains("FISHEYE624") && expected.contains("undistorted"));
        let (key, found, _) = refused(&MODEL.replace("[600,", "[0, 600,"));
        assert_eq!(
            (key.as_str(), found.as_str()),
            ("$.cam_model.projection_params", "5 numbers")
        );
        let (key, ..) = refused(&MODEL.replace("\"PinholePlane\"", "7"));
        assert_eq!(key, "$.cam_model.projection_model_type");
        let both = refused(&MODEL.replacen('{', &format!("{{{K}, "), 1));
        let (key, found, expected) = both;
        assert_eq!((&*key, &*expected), ("$", "one of them"));
        assert_eq!(found, "`cam_K` and `cam_model`");
        assert!(matches!(
            read(&MODEL.replace("640", "1408")),
            Err(IoError { kind: IoErrorKind::CameraSize, found, .. })
                if found == "a camera for 1408x480 images"
        ));
    }

    #[test]
    fn errors_name_the_field() {
        let key = |text: &str| match read(text) {
            Err(IoError {
                place: Some(Place::Field(key)),
                ..
            }) => key,
            other => panic!("{other:?}"),
        };
        assert_eq!(key(&format!(r#"{{"1": {{{K}}}, "2": {{{K}}}}}"#)), "$");
        assert_eq!(key("{}"), "$");
        assert_eq!(key("[1]"), "$");
        assert_eq!(key(r#"{"1": {"cam_model": {}}}"#), "$.1.cam_model");
        assert_eq!(key(r#"{"cam_K": [1, 2]}"#), "$.cam_K");
        assert_eq!(
            key(&format!(r#"{{{K}, "depth_scale": 0}}"#)),
            "$.depth_scale"
        );
        assert_eq!(key(&FLAT.replace("600", "\"600\"")), "$.fx");
        assert_eq!(key(&FLAT.replace("600", "-600")), "$.fx");
        assert_eq!(key(&format!("{{{}}}", K.replace("600", "0"))), "$.cam_K");
        assert_eq!(key(&FLAT.replace("640", "64.5")), "$.width");
        let skewed = read(&format!("{{{}}}", K.replace("600.0, 0", "600.0, 3")));
        let error = skewed.unwrap_err();
        let cause = std::error::Error::source(&error).unwrap().to_string();
        assert!(cause.contains("[0][1] is 3, expected 0"), "{cause}");
        for text in [
            FLAT.replace("640", "320"),
            format!(r#"{{{K}, "width": 320, "height": 480}}"#),
        ] {
            assert!(matches!(
                read(&text),
                Err(IoError { kind: IoErrorKind::CameraSize, found, expected, .. })
                    if found == "a camera for 320x480 images" && expected == "one for 640x480"
            ));
        }
    }
}

//! Cameras in JSON files.

use std::path::Path;

use hicp_core::{CameraError, Matrix3, PinholeCamera};

use crate::camera_model::{CameraModel, camera_model};
use crate::error::IoError;
use crate::json::{Document, Node};
use crate::limits::ReadLimits;

/// A camera file: the camera, and what its depth images count in where the file says so.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraFile {
    /// The camera.
    pub camera: PinholeCamera,
    /// Millimetres per unit of its depth images.
    pub depth_scale: Option<f64>,
}

/// Reads a camera from a JSON file, for images of `image_size` (width, height).
///
/// Four forms are understood; further keys are ignored:
/// - `{"cam_K": [9 numbers, row-major], "depth_scale": ...}`, BOP's, which states no size (one that is there must match);
/// - `{"cam_model": {"projection_model_type": "PinholePlane", "projection_params": [fx, fy, cx, cy]}, "depth_scale": ...}`, BOP's
///   newer one; models with distortion are refused;
/// - `{"fx", "fy", "cx", "cy", "width", "height", "depth_scale"}`, of BOP's `camera.json`, whose size must match;
/// - `{"7": {...}}`, a `scene_camera.json` of exactly one image in any of these forms.
///
/// `depth_scale` is optional everywhere.
///
/// # Errors
///
/// [`IoError::JsonSyntax`], [`IoError::JsonValue`] naming the key, [`IoError::CameraSize`] naming both sizes,
/// [`IoError::Camera`], or [`IoError::Limit`].
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
    /// As [`read_camera_json`].
    pub fn read_camera_json(
        &self,
        path: impl AsRef<Path>,
        image_size: (u32, u32),
    ) -> Result<CameraFile, IoError> {
        camera_of(&Document::read_small(self, path.as_ref())?, image_size)
    }
}

fn camera_of(document: &Document, image_size: (u32, u32)) -> Result<CameraFile, IoError> {
    let root = document.root();
    let is_camera = |node: &Node<'_>| {
        ["cam_K", "cam_model", "fx"]
            .iter()
            .any(|key| node.optional(key).is_some())
    };
    let node = match root.numbered() {
        Ok(images) if !is_camera(&root) && !images.is_empty() => {
            let count = images.len();
            match <[_; 1]>::try_from(images) {
                Ok([(_, node)]) => node,
                Err(_) => {
                    let found = format!("cameras of {count} images");
                    return Err(root.refuse_found(found, "a single camera"));
                }
            }
        }
        _ => root,
    };
    if !is_camera(&node) {
        return Err(node.refuse(
            "an object with the key `cam_K` or `cam_model`, or with `fx`, `fy`, `cx` and `cy`",
        ));
    }
    let (width, height) = image_size;
    let matrix = node
        .optional("cam_K")
        .or_else(|| node.optional("cam_model"));
    let states_size = ["width", "height"]
        .iter()
        .all(|key| node.optional(key).is_some());
    if matrix.is_none() || states_size {
        check_size(&node, image_size)?;
    }
    let camera = match matrix {
        Some(place) => {
            let stated = calibration(&node)?;
            if let Some(found) = stated.image_size {
                same_size(&place, found, image_size)?;
            }
            PinholeCamera::from_matrix(&stated.matrix, width, height)
                .map_err(|source| camera_error(&place, source))?
        }
        None => {
            let value = |key: &str| node.get(key)?.number();
            let (fx, fy, cx, cy) = (value("fx")?, value("fy")?, value("cx")?, value("cy")?);
            PinholeCamera::new(fx, fy, cx, cy, width, height)
                .map_err(|source| camera_error(&node, source))?
        }
    };
    Ok(CameraFile {
        camera,
        depth_scale: depth_scale(&node)?,
    })
}

/// Checks the size that a camera states.
fn check_size(node: &Node<'_>, image_size: (u32, u32)) -> Result<(), IoError> {
    let side = |key: &str| node.get(key)?.unsigned();
    same_size(node, (side("width")?, side("height")?), image_size)
}

fn same_size(
    node: &Node<'_>,
    (found_width, found_height): (u32, u32),
    (width, height): (u32, u32),
) -> Result<(), IoError> {
    if (found_width, found_height) == (width, height) {
        return Ok(());
    }
    Err(IoError::CameraSize {
        path: node.path().to_owned(),
        found_width,
        found_height,
        expected_width: width,
        expected_height: height,
    })
}

/// Reads the calibration matrix of a camera, from `cam_K` or from a `cam_model` without distortion, and the size of its images
/// where the latter states one.
pub(crate) fn calibration(node: &Node<'_>) -> Result<CameraModel, IoError> {
    match (node.optional("cam_K"), node.optional("cam_model")) {
        (None, Some(model)) => camera_model(&model),
        (Some(_), Some(model)) => {
            let found = "`cam_K` and `cam_model`".to_owned();
            Err(model.refuse_found(found, "one of them"))
        }
        _ => {
            let numbers: [f64; 9] = node.get("cam_K")?.numbers()?;
            Ok(CameraModel {
                matrix: Matrix3::from_row_slice(&numbers),
                image_size: None,
            })
        }
    }
}

/// Reads `depth_scale`, millimetres per unit, where it is there.
pub(crate) fn depth_scale(node: &Node<'_>) -> Result<Option<f64>, IoError> {
    let Some(scale) = node.optional("depth_scale") else {
        return Ok(None);
    };
    match scale.number()? {
        value if value > 0.0 => Ok(Some(value)),
        _ => Err(scale.refuse("a number above 0, in mm per unit")),
    }
}

pub(crate) fn camera_error(node: &Node<'_>, source: CameraError) -> IoError {
    IoError::Camera {
        path: node.path().to_owned(),
        key: node.key().to_owned(),
        source,
    }
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
        ] {
            assert_eq!(
                read(&text).unwrap(),
                CameraFile {
                    camera,
                    depth_scale
                }
            );
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
            Err(IoError::JsonValue {
                key,
                found,
                expected,
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
        let (key, _, expected) = refused(&MODEL.replacen('{', &format!("{{{K}, "), 1));
        assert_eq!(
            (key.as_str(), expected.as_str()),
            ("$.cam_model", "one of them")
        );
        assert!(matches!(
            read(&MODEL.replace("640", "1408")),
            Err(IoError::CameraSize {
                found_width: 1408,
                ..
            })
        ));
    }

    #[test]
    fn every_fault_is_named() {
        let key = |text: &str| match read(text) {
            Err(IoError::JsonValue { key, .. } | IoError::Camera { key, .. }) => key,
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
        assert_eq!(key(&FLAT.replace("600", "-600")), "$");
        assert_eq!(key(&format!("{{{}}}", K.replace("600", "0"))), "$.cam_K");
        assert_eq!(key(&FLAT.replace("640", "64.5")), "$.width");
        for text in [
            FLAT.replace("640", "320"),
            format!(r#"{{{K}, "width": 320, "height": 480}}"#),
        ] {
            assert!(matches!(
                read(&text),
                Err(IoError::CameraSize {
                    found_width: 320,
                    expected_width: 640,
                    ..
                })
            ));
        }
    }
}

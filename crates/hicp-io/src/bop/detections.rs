//! Detected objects, in COCO's format.

use std::path::Path;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use serde_json::Value;

use super::rle::Rle;
use crate::error::{IoError, Place};
use crate::json::{self, optional_numbers};
use crate::limits::{Limit, ReadLimits};

/// An object instance detected in an image.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(expecting = "an object with `scene_id`, `image_id`, `category_id` and `score`")]
pub struct Detection {
    /// Id of the scene.
    pub scene_id: u32,
    /// Id of the image.
    pub image_id: u32,
    /// Id of the object.
    pub category_id: u32,
    /// Confidence; higher is better.
    pub score: f64,
    /// Box in pixels: x, y, width, height.
    #[serde(default, deserialize_with = "optional_numbers")]
    pub bbox: Option<[f64; 4]>,
    /// Run-length code of the mask, decoded by [`Rle::to_mask`].
    ///
    /// An empty array, as box detectors write it, becomes `None`.
    #[serde(default, deserialize_with = "not_empty")]
    pub segmentation: Option<Rle>,
    /// Time spent on the image in seconds, if known.
    #[serde(rename = "time", default, deserialize_with = "known_time")]
    pub time_s: Option<f64>,
}

/// The expected value, for files of COCO with `images` and `annotations`, which have no scene.
const FROM_COCO: &str = "an array of detections; of the annotations of COCO for scene 1, it is made by \
    python3 -c \"import json, sys; \
    print(json.dumps([{'scene_id': 1, 'score': 1, **a} for a in json.load(sys.stdin)['annotations']]))\" \
    < coco.json > detections.json";

/// Reads a run-length code. Detectors of boxes write an empty array.
fn not_empty<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Rle>, D::Error> {
    let code = Value::deserialize(deserializer)?;
    if code.is_null() || code.as_array().is_some_and(Vec::is_empty) {
        return Ok(None);
    }
    Rle::deserialize(code).map(Some).map_err(D::Error::custom)
}

/// Reads a time in seconds. BOP writes −1 for an unknown time.
fn known_time<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    let time = Option::deserialize(deserializer)?;
    Ok(time.filter(|seconds| *seconds >= 0.0))
}

/// Reads the detections of a BOP dataset from a JSON array, in the file's order.
///
/// Segmentations are run-length codes, as lists of runs or as compressed text. Polygons are not
/// supported.
///
/// # Errors
///
/// [`IoError`] names the JSON key of the fault, also if a run-length code does not fit its image.
pub fn read_detections(path: impl AsRef<Path>) -> Result<Vec<Detection>, IoError> {
    ReadLimits::DEFAULT.read_detections(path)
}

impl ReadLimits {
    /// Reads a file as [`read_detections`] does, within these limits.
    ///
    /// # Errors
    ///
    /// As for [`read_detections`].
    pub fn read_detections(&self, path: impl AsRef<Path>) -> Result<Vec<Detection>, IoError> {
        read(self, path.as_ref())
    }
}

fn read(limits: &ReadLimits, path: &Path) -> Result<Vec<Detection>, IoError> {
    json::read(limits, path, Limit::JSON_BYTES).map_err(|mut error: IoError| {
        let at_root = error.place == Some(Place::Field("$".to_owned()));
        if at_root && error.found == "an object" {
            error.expected = FROM_COCO.to_owned();
        }
        error
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(segmentation: &str) -> Result<Vec<Detection>, IoError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("detections.json");
        let text = format!(
            r#"[{{"scene_id": 1, "image_id": 2, "category_id": 3, "score": 0.9, "bbox": [1, 2.5, 3, 4],
                 "segmentation": {segmentation}, "time": -1, "id": 4}}]"#
        );
        std::fs::write(&path, text).unwrap();
        read_detections(&path)
    }

    #[test]
    fn listed_and_compressed_runs_give_the_same_mask() {
        for counts in ["[1, 1, 1, 1, 2]", "\"11101\""] {
            let detections = read(&format!(r#"{{"size": [3, 2], "counts": {counts}}}"#)).unwrap();
            let detection = &detections[0];
            assert_eq!(detection.bbox, Some([1.0, 2.5, 3.0, 4.0]));
            assert_eq!(detection.time_s, None);
            let mask = detection.segmentation.as_ref().unwrap().to_mask();
            assert_eq!((mask.width(), mask.height()), (2, 3));
            assert_eq!(mask.pixels(), [false, true, true, false, false, false]);
        }
        for none in ["null", "[]"] {
            assert_eq!(read(none).unwrap()[0].segmentation, None);
        }
    }

    #[test]
    fn errors_name_the_field_and_the_value() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("coco.json");
        std::fs::write(&path, r#"{"images": [], "annotations": []}"#).unwrap();
        let error = read_detections(&path).unwrap_err();
        assert_eq!(error.found, "an object");
        assert!(error.expected.contains("['annotations']"), "{error}");
        let error = read(r#"{"size": [3, 2], "counts": [4, 5]}"#).unwrap_err();
        assert_eq!(
            error.place,
            Some(Place::Field("$[0].segmentation".to_owned()))
        );
        assert!(error.found.contains("runs cover 9 pixels"), "{error}");
        assert_eq!(error.expected, "6 for 2x3");
        for (text, found) in [
            ("[[1, 2, 3, 4]]", "another kind of segmentation"),
            (r#"{"size": [3], "counts": [6]}"#, "an array of 1"),
            (r#"{"size": [3, 2, 1], "counts": [6]}"#, "an array of 3"),
            (r#"{"size": [3, 2], "counts": 6}"#, "6"),
            (r#"{"size": [3, 2], "counts": [7, -1]}"#, "-1"),
        ] {
            let error = read(text).unwrap_err();
            assert_eq!(
                error.place,
                Some(Place::Field("$[0].segmentation".to_owned()))
            );
            assert_eq!(error.found, found, "{error}");
        }
    }
}

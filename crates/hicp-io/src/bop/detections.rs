//! What a detector found, in COCO's form.

use std::path::Path;

use super::rle::Rle;
use crate::error::IoError;
use crate::json::{Document, Node};
use crate::limits::ReadLimits;

/// An object instance found in an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Detection {
    /// The scene.
    pub scene_id: u32,
    /// The image.
    pub image_id: u32,
    /// The object.
    pub category_id: u32,
    /// Confidence; higher is better.
    pub score: f64,
    /// Box in pixels: x, y, width, height.
    pub bbox: Option<[f64; 4]>,
    /// Mask, still coded: decode it with [`Rle::to_mask`].
    pub segmentation: Option<Rle>,
    /// Seconds spent on the image, where known.
    pub time_s: Option<f64>,
}

/// Reads the detections of a BOP dataset from a JSON array, in the file's order.
///
/// Segmentations are run-length codes, as lists of runs or compressed. Cost: the file's JSON tree is held in memory
/// while it is converted, several times the size of the file.
///
/// # Errors
///
/// What [`IoError`] says of JSON files, and [`IoError::Segmentation`] for a code that does not fit its image. Polygons
/// are not supported.
pub fn read_detections(path: impl AsRef<Path>) -> Result<Vec<Detection>, IoError> {
    ReadLimits::DEFAULT.read_detections(path)
}

impl ReadLimits {
    /// As [`read_detections`], within these limits.
    ///
    /// # Errors
    ///
    /// As [`read_detections`].
    pub fn read_detections(&self, path: impl AsRef<Path>) -> Result<Vec<Detection>, IoError> {
        read_within(self, path.as_ref())
    }
}

fn read_within(limits: &ReadLimits, path: &Path) -> Result<Vec<Detection>, IoError> {
    Document::read(limits, path)?
        .root()
        .items()?
        .iter()
        .map(detection)
        .collect()
}

fn detection(node: &Node<'_>) -> Result<Detection, IoError> {
    let time = node.optional("time").map(|n| n.number()).transpose()?;
    Ok(Detection {
        scene_id: node.get("scene_id")?.unsigned()?,
        image_id: node.get("image_id")?.unsigned()?,
        category_id: node.get("category_id")?.unsigned()?,
        score: node.get("score")?.number()?,
        bbox: node.optional("bbox").map(|n| n.numbers()).transpose()?,
        segmentation: node
            .optional("segmentation")
            .map(|n| segmentation(&n))
            .transpose()?,
        time_s: time.filter(|seconds| *seconds >= 0.0),
    })
}

fn segmentation(node: &Node<'_>) -> Result<Rle, IoError> {
    let (Some(size), Some(counts)) = (node.optional("size"), node.optional("counts")) else {
        return Err(node.refuse("a run-length code with `size` and `counts`"));
    };
    let [height, width] = match size.items()?.as_slice() {
        [height, width] => [height.unsigned()?, width.unsigned()?],
        _ => return Err(size.refuse("an array of height and width")),
    };
    let rle = if let Some(text) = counts.text() {
        Rle::from_compressed(width, height, text)
    } else {
        let runs = counts
            .items()
            .map_err(|_| counts.refuse("an array of run lengths, or their compressed text"))?;
        let runs = runs.iter().map(Node::unsigned).collect::<Result<_, _>>()?;
        Rle::from_counts(width, height, runs)
    };
    rle.map_err(|source| IoError::Segmentation {
        path: node.path().to_owned(),
        key: node.key().to_owned(),
        source,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bop::RleError;

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
    fn both_forms_of_runs_give_the_same_mask() {
        for counts in ["[1, 1, 1, 1, 2]", "\"11101\""] {
            let detections = read(&format!(r#"{{"size": [3, 2], "counts": {counts}}}"#)).unwrap();
            let detection = &detections[0];
            assert_eq!(detection.bbox, Some([1.0, 2.5, 3.0, 4.0]));
            assert_eq!(detection.time_s, None);
            let mask = detection.segmentation.as_ref().unwrap().to_mask();
            assert_eq!((mask.width(), mask.height()), (2, 3));
            assert_eq!(mask.pixels(), [false, true, true, false, false, false]);
        }
        assert_eq!(read("null").unwrap()[0].segmentation, None);
    }

    #[test]
    fn faults_are_named() {
        assert!(matches!(
            read(r#"{"size": [3, 2], "counts": [4, 5]}"#),
            Err(IoError::Segmentation { key, source: RleError::Coverage { found: 9, expected: 6, .. }, .. })
                if key == "$[0].segmentation"
        ));
        for (text, place) in [
            ("[[1, 2, 3, 4]]", "$[0].segmentation"),
            (r#"{"size": [3], "counts": [6]}"#, "$[0].segmentation.size"),
            (
                r#"{"size": [3, 2], "counts": 6}"#,
                "$[0].segmentation.counts",
            ),
            (
                r#"{"size": [3, 2], "counts": [7, -1]}"#,
                "$[0].segmentation.counts[1]",
            ),
        ] {
            match read(text) {
                Err(IoError::JsonValue { key, .. }) => assert_eq!(key, place),
                other => panic!("{other:?}"),
            }
        }
    }
}

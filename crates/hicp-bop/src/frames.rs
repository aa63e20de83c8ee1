//! Grouping of rows by image.

use std::collections::BTreeMap;

use hicp_io::bop::{Detection, ResultRow};

/// The ids of a scene and of an image in it.
pub type FrameKey = (u32, u32);

/// The number of requested instances of each object, by image.
pub type Targets = BTreeMap<FrameKey, BTreeMap<u32, u32>>;

/// The rows of an image, as ascending indices into the file.
pub type FrameRows = (FrameKey, Vec<usize>);

/// Groups rows by image, in the order of scene and image.
///
/// ```
/// use hicp_io::bop::ResultRow;
/// use hybrid_icp::core::Isometry3;
/// let row = |image| ResultRow::new(1, image, 5, Isometry3::identity());
/// let frames = hicp_bop::frames_of(&[row(7), row(3), row(7)]);
/// assert_eq!(frames, [((1, 3), vec![1]), ((1, 7), vec![0, 2])]);
/// ```
#[must_use]
pub fn frames_of(rows: &[ResultRow]) -> Vec<FrameRows> {
    let mut frames: BTreeMap<FrameKey, Vec<usize>> = BTreeMap::new();
    for (index, row) in rows.iter().enumerate() {
        let frame = (row.scene_id, row.im_id);
        frames.entry(frame).or_default().push(index);
    }
    frames.into_iter().collect()
}

/// Groups detections by image, in their given order.
#[must_use]
pub fn detections_by_frame(detections: Vec<Detection>) -> BTreeMap<FrameKey, Vec<Detection>> {
    let mut frames: BTreeMap<FrameKey, Vec<Detection>> = BTreeMap::new();
    for detection in detections {
        let frame = (detection.scene_id, detection.image_id);
        frames.entry(frame).or_default().push(detection);
    }
    frames
}

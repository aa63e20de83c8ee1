//! Where masks come from.

use std::collections::BTreeMap;

use hicp_io::bop::Detection;

use crate::bop_image::BopImage;
use crate::box_mask::BoxMask;
use crate::frames::{FrameKey, detections_by_frame};
use crate::scenes::Image;

/// Where the masks of a dataset's images come from.
#[derive(Clone, Debug, Default)]
pub enum MaskSource {
    /// The visible masks (`mask_visib`) of the ground truth.
    #[default]
    Visible,
    /// The segmentations of detections, by image ([`MaskSource::detections`]).
    Detections(BTreeMap<FrameKey, Vec<Detection>>),
    /// No segmentation: every row has a mask of its own, what was measured in a box about its pose.
    Box(BoxMask),
}

impl MaskSource {
    /// The segmentations of detections.
    #[must_use]
    pub fn detections(detections: Vec<Detection>) -> Self {
        Self::Detections(detections_by_frame(detections))
    }

    /// Finds the masks of an image.
    #[must_use]
    pub fn frame(&self, key: FrameKey, image: Image) -> BopImage<'_> {
        match self {
            Self::Visible => BopImage::with_visible_masks(image),
            Self::Detections(by_frame) => {
                let of_frame = by_frame.get(&key).map_or(&[][..], Vec::as_slice);
                BopImage::with_detections(image, of_frame)
            }
            Self::Box(_) => BopImage::without_masks(image),
        }
    }
}

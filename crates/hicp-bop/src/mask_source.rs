//! The source of masks.

use std::collections::BTreeMap;

use hicp_io::bop::Detection;
use hicp_io::is_absent;

use crate::bop_image::BopImage;
use crate::box_mask::BoxMask;
use crate::fault::{Fault, FaultKind};
use crate::frames::{FrameKey, detections_by_frame};
use crate::mask_file::Source;
use crate::scenes::Image;

/// The source of the masks of a dataset's images.
#[derive(Clone, Debug, Default)]
pub enum MaskSource {
    /// The visible masks (`mask_visib`) of the ground truth.
    #[default]
    Visible,
    /// The segmentations of detections, by image ([`MaskSource::detections`]). The mask of a
    /// detection without one is its box.
    Detections(BTreeMap<FrameKey, Vec<Detection>>),
    /// No segmentation: the mask of a row consists of all measured points in a box around its pose.
    Box(BoxMask),
    /// One detection per row, in the order of the rows: the mask of a row is that of its detection.
    ///
    /// The rows have no pose yet. It is estimated ([`hybrid_icp::Refiner::estimate`]).
    OfRows(Vec<Detection>),
}

impl MaskSource {
    /// Creates a source from the segmentations and boxes of detections.
    #[must_use]
    pub fn detections(detections: Vec<Detection>) -> Self {
        Self::Detections(detections_by_frame(detections))
    }

    /// Finds the masks of an image.
    ///
    /// With [`MaskSource::Visible`] and without ground truth, there are no masks, and the image has
    /// a fault.
    #[must_use]
    pub fn frame(&self, key: FrameKey, image: Image) -> BopImage<'_> {
        let (mut masks, mut faults) = (Vec::new(), Vec::new());
        match self {
            Self::Visible => match image.scene.ground_truth(image.im_id) {
                Some(truths) => {
                    let instances = truths.iter().enumerate();
                    masks.extend(instances.map(|(i, truth)| (truth.obj_id, Source::Instance(i))));
                }
                None => faults.push(no_ground_truth(&image)),
            },
            Self::Detections(by_frame) => {
                let detections = by_frame.get(&key).into_iter().flatten();
                masks.extend(detections.filter_map(|d| Some((d.category_id, Source::of(d)?))));
            }
            Self::Box(_) | Self::OfRows(_) => {}
        }
        BopImage::new(image, masks, faults)
    }
}

/// Returns the fault of an image without ground truth.
pub(crate) fn no_ground_truth(image: &Image) -> Fault {
    let path = image.scene.file("scene_gt");
    let why = match is_absent(&path) {
        true => "does not exist".to_owned(),
        false => format!("does not have image {}", image.im_id),
    };
    Fault {
        kind: FaultKind::MissingMask,
        text: format!("ground truth is missing: {} {why}", path.display()),
    }
}

//! The storage of a mask: an image file, a run-length code or a box.

use hicp_io::bop::{Detection, Rle};
use hybrid_icp::core::Mask;

use crate::fault::{Fault, FaultKind};
use crate::scenes::Image;

/// The storage of a mask.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Source<'a> {
    /// The visible mask of an instance, by its index in the ground truth.
    Instance(usize),
    /// The run-length code of a detection.
    Code(&'a Rle),
    /// The box of a detection: x, y, width and height, pixels.
    Box([f64; 4]),
}

impl<'a> Source<'a> {
    /// Returns the segmentation of a detection, or its box if it has none.
    pub(crate) fn of(detection: &'a Detection) -> Option<Self> {
        let code = detection.segmentation.as_ref().map(Self::Code);
        code.or(detection.bbox.map(Self::Box))
    }

    /// Reads the mask and checks that it has the size of the depth image.
    pub(crate) fn read(self, image: &Image) -> Result<Mask, Fault> {
        let Image { scene, im_id, .. } = image;
        let expected = (image.depth.width(), image.depth.height());
        match self {
            Self::Instance(instance) => {
                let mask = scene.read_visible_mask(*im_id, instance);
                let mask = mask.map_err(|error| match Fault::of(&error) {
                    fault if fault.kind == FaultKind::Missing => Fault {
                        kind: FaultKind::MissingMask,
                        ..fault
                    },
                    fault => fault,
                })?;
                let path = scene.visible_mask_path(*im_id, instance);
                match (mask.width(), mask.height()) {
                    found if found == expected => Ok(mask),
                    found => Err(wrong_size(&path.display().to_string(), found, image)),
                }
            }
            Self::Box(bbox) => Ok(Mask::in_box(expected.0, expected.1, bbox)),
            // A short code may describe a huge mask, so its size is checked before decoding.
            Self::Code(code) => match (code.width(), code.height()) {
                found if found == expected => Ok(code.to_mask()),
                found => {
                    let name = format!("a segmentation of image {im_id} in --detections");
                    Err(wrong_size(&name, found, image))
                }
            },
        }
    }
}

fn wrong_size(name: &str, (width, height): (u32, u32), image: &Image) -> Fault {
    let path = image.scene.depth_path(image.im_id);
    let path = path.map_or_else(|e| e.to_string(), |path| path.display().to_string());
    Fault::damaged(format!(
        "{name} is {width}x{height} pixels but {path} is {}x{}, expected the same size",
        image.depth.width(),
        image.depth.height(),
    ))
}

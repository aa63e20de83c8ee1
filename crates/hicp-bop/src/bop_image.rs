//! The masks of an image, and its observations in them.

use hybrid_icp::Refiner;
use hybrid_icp::core::{Isometry3, Mask, Model, Observation};

use crate::assignment::assign_masks;
use crate::box_mask::BoxMask;
use crate::covered::covered_pixels;
use crate::fault::Fault;
use crate::mask_file::Source;
use crate::row_status::RowStatus;
use crate::scenes::Image;

/// Bytes of masks, one per pixel, that are held at once.
const HELD_BYTES: usize = 1 << 28;

/// An image while its rows are refined ([`crate::MaskSource::frame`]).
///
/// Its observations share its depth. A mask is read when a row of its object needs it, and its observation is created when a
/// row is refined in it.
#[derive(Debug)]
pub struct BopImage<'a> {
    image: Image,
    masks: Vec<Candidate<'a>>,
    faults: Vec<Fault>,
    /// Bytes of masks that may be held.
    memory: usize,
}

/// A mask that rows of an object may be refined in.
#[derive(Debug)]
struct Candidate<'a> {
    obj_id: u32,
    source: Source<'a>,
    seen: Seen,
}

/// The state of a mask.
#[derive(Debug)]
enum Seen {
    /// It was not needed yet, or it was released.
    Unread,
    /// It is missing or cannot be used.
    Unusable(RowStatus),
    Read(Mask),
    Observed(Box<Observation>),
}

impl Seen {
    /// Returns the mask if it is held.
    fn mask(&self) -> Option<&Mask> {
        match self {
            Self::Read(mask) => Some(mask),
            Self::Observed(observation) => Some(observation.mask()),
            Self::Unread | Self::Unusable(_) => None,
        }
    }
}

impl<'a> BopImage<'a> {
    /// Creates an image with the masks that rows of objects may be refined in.
    pub(crate) fn new(image: Image, masks: Vec<(u32, Source<'a>)>, faults: Vec<Fault>) -> Self {
        let unread = |(obj_id, source)| Candidate {
            obj_id,
            source,
            seen: Seen::Unread,
        };
        Self {
            image,
            masks: masks.into_iter().map(unread).collect(),
            faults,
            memory: HELD_BYTES,
        }
    }

    /// Limits the memory of masks that are held at once, in bytes. The default is 256 MiB. One mask is always held.
    ///
    /// A few characters of a run-length code may stand for a whole image, so a file can name far more masks than fit into
    /// memory. Beyond the limit, all masks are released and read again when they are needed, with the same results.
    #[must_use]
    pub fn with_memory(mut self, bytes: usize) -> Self {
        self.memory = bytes;
        self
    }

    /// Returns the image.
    #[must_use]
    pub fn image(&self) -> &Image {
        &self.image
    }

    /// Returns the faults of masks that rows needed and that are missing or cannot be used.
    #[must_use]
    pub fn into_faults(self) -> Vec<Fault> {
        self.faults
    }

    /// Chooses a mask for every pose of an object with [`assign_masks`], or returns the reason why a pose has none.
    ///
    /// The masks returned are arguments of [`BopImage::observation`]. Cost: a render per pose and O(silhouette) per mask. The
    /// renderer's cache keeps the last few, so the refinement of a single pose reuses the render that chose its mask.
    pub fn choose(
        &mut self,
        refiner: &mut Refiner,
        model: &Model,
        obj_id: u32,
        poses: &[Isometry3<f64>],
    ) -> Vec<Result<usize, RowStatus>> {
        let mut usable = Vec::new();
        let mut status = RowStatus::NoMask;
        for index in 0..self.masks.len() {
            if self.masks[index].obj_id == obj_id {
                match self.read(index) {
                    Ok(()) => {
                        usable.push(index);
                        status = status.max(RowStatus::NoOverlap);
                    }
                    Err(unusable) => status = status.max(unusable),
                }
            }
        }
        let overlaps: Vec<Vec<u64>> = poses
            .iter()
            .map(|pose| self.overlaps(refiner, model, pose, &usable))
            .collect();
        let chosen = assign_masks(&overlaps).into_iter();
        chosen
            .map(|place| place.map(|place| usable[place]).ok_or(status))
            .collect()
    }

    /// Returns the observation of the image in a mask, which is created when it is first needed.
    ///
    /// # Errors
    ///
    /// The status of rows in a mask that cannot be used; [`BopImage::choose`] returns no such mask.
    pub fn observation(&mut self, mask: usize) -> Result<&Observation, RowStatus> {
        self.read(mask)?;
        let seen = &mut self.masks[mask].seen;
        if let Seen::Read(read) = seen {
            *seen = match self.image.observe(read.clone()) {
                Ok(observation) => Seen::Observed(Box::new(observation)),
                Err(error) => {
                    self.faults.push(Fault::damaged(error.to_string()));
                    Seen::Unusable(RowStatus::Damaged)
                }
            };
        }
        match seen {
            Seen::Observed(observation) => Ok(observation),
            _ => Err(RowStatus::Damaged),
        }
    }

    /// Creates the observation of an estimate in the box around it, without a segmentation.
    ///
    /// # Errors
    ///
    /// [`RowStatus::NothingMeasured`] if the mask is empty.
    pub fn observe_box(
        &self,
        refiner: &mut Refiner,
        model: &Model,
        pose: &Isometry3<f64>,
        by: &BoxMask,
    ) -> Result<Observation, RowStatus> {
        let Image { depth, camera, .. } = &self.image;
        let view = refiner.workspace_mut().view(model, camera, pose);
        let mask = by.mask(view, (depth, camera), model, pose);
        let mask = mask.ok_or(RowStatus::NothingMeasured)?;
        self.image.observe(mask).map_err(|_| RowStatus::Damaged)
    }

    /// Reads a mask that is not held. If the masks would exceed the memory, releases the others.
    fn read(&mut self, index: usize) -> Result<(), RowStatus> {
        if matches!(self.masks[index].seen, Seen::Unread) {
            let held = self
                .masks
                .iter()
                .filter(|other| other.seen.mask().is_some());
            if (held.count() + 1) * self.image.depth.pixels().len() > self.memory {
                let held = self
                    .masks
                    .iter_mut()
                    .filter(|other| other.seen.mask().is_some());
                held.for_each(|other| other.seen = Seen::Unread);
            }
            self.masks[index].seen = match self.masks[index].source.read(&self.image) {
                Ok(mask) => Seen::Read(mask),
                Err(fault) => {
                    let status = RowStatus::from(&fault);
                    self.faults.push(fault);
                    Seen::Unusable(status)
                }
            };
        }
        match &self.masks[index].seen {
            Seen::Unusable(status) => Err(*status),
            _ => Ok(()),
        }
    }

    /// Returns how many pixels of each mask the model covers at a pose.
    fn overlaps(
        &mut self,
        refiner: &mut Refiner,
        model: &Model,
        pose: &Isometry3<f64>,
        masks: &[usize],
    ) -> Vec<u64> {
        let camera = self.image.camera;
        let view = refiner.workspace_mut().view(model, &camera, pose);
        let covered: Vec<(u32, u32)> = covered_pixels(view).collect();
        let overlap = |index: &usize| {
            // If the file has changed since the mask was read, the mask covers nothing.
            let _ = self.read(*index);
            let mask = self.masks[*index].seen.mask()?;
            let both = covered
                .iter()
                .filter(|(u, v)| mask.get(*u, *v) == Some(true));
            Some(both.count() as u64)
        };
        masks
            .iter()
            .map(overlap)
            .map(Option::unwrap_or_default)
            .collect()
    }
}

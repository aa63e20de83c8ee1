//! The masks of an image, and its observations with them.

use hicp_io::bop::Detection;
use hybrid_icp::Refiner;
use hybrid_icp::core::{Isometry3, Mask, Model, Observation};

use crate::assignment::assign_masks;
use crate::box_mask::BoxMask;
use crate::fault::Fault;
use crate::mask_file::Source;
use crate::row_status::RowStatus;
use crate::scenes::Image;

/// Default memory for masks that are held at once, in bytes. A mask has one byte per pixel.
const HELD_BYTES: usize = 1 << 28;

/// An image during the refinement of its rows ([`crate::MaskSource::frame`]).
///
/// All its observations share the depth image. A mask is read when a row of its object needs it. An
/// observation is created when a row is refined with its mask.
#[derive(Debug)]
pub struct BopImage<'a> {
    image: Image,
    masks: Vec<Candidate<'a>>,
    faults: Vec<Fault>,
    /// Memory available for masks, in bytes.
    memory: usize,
}

/// A mask for rows of an object.
#[derive(Debug)]
struct Candidate<'a> {
    obj_id: u32,
    source: Source<'a>,
    seen: Seen,
}

/// The state of a mask.
#[derive(Debug)]
enum Seen {
    /// The mask was not needed yet, or it was released.
    Unread,
    /// The mask is missing or cannot be used.
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

/// Adds a fault, and returns the status of the rows that it concerns.
fn enter(faults: &mut Vec<Fault>, fault: Fault) -> RowStatus {
    let status = RowStatus::from(&fault);
    faults.push(fault);
    status
}

impl<'a> BopImage<'a> {
    /// Creates an image with the masks for rows of objects.
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

    /// Limits the memory of masks that are held at once, in bytes; the default is 256 MiB.
    ///
    /// At least one mask is held. A run-length code of a few characters may describe a whole image,
    /// so a file can contain far more masks than fit into memory. At the limit, all masks are
    /// released and read again when needed, with the same results.
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

    /// Returns the faults of required masks that are missing or cannot be used.
    #[must_use]
    pub fn into_faults(self) -> Vec<Fault> {
        self.faults
    }

    /// Chooses a mask for every pose of an object with [`assign_masks`].
    ///
    /// Returns either an argument for [`BopImage::observation`] or the reason why the pose has no
    /// mask. Cost: one render per pose and O(silhouette) per mask. The renderer's cache keeps the
    /// last few renders, so the refinement of a single pose reuses the render that chose its mask.
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

    /// Returns the observation of the image with a mask, and creates it on first use.
    ///
    /// # Errors
    ///
    /// [`RowStatus`] of the rows if the mask cannot be used. [`BopImage::choose`] never returns
    /// such a mask.
    pub fn observation(&mut self, mask: usize) -> Result<&Observation, RowStatus> {
        self.read(mask)?;
        let seen = &mut self.masks[mask].seen;
        if let Seen::Read(read) = seen {
            *seen = match self.image.observe(read.clone()) {
                Ok(observation) => Seen::Observed(Box::new(observation)),
                Err(fault) => Seen::Unusable(enter(&mut self.faults, fault)),
            };
        }
        match seen {
            Seen::Observed(observation) => Ok(observation),
            _ => Err(RowStatus::Damaged),
        }
    }

    /// Creates an observation with a box around an estimate as its mask, without a segmentation.
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

    /// Creates an observation with the mask of a detection, or with its box if it has no mask.
    ///
    /// # Errors
    ///
    /// - [`RowStatus::NoMask`] if the detection has neither a mask nor a box.
    /// - [`RowStatus::NothingMeasured`] if no depth was measured inside.
    /// - [`RowStatus::Damaged`] if the mask has another size than the depth image.
    pub fn observe_detection(&mut self, detection: &Detection) -> Result<Observation, RowStatus> {
        let source = Source::of(detection).ok_or(RowStatus::NoMask)?;
        let mask = source.read(&self.image);
        let observation = mask.and_then(|mask| self.image.observe(mask));
        let observation = observation.map_err(|fault| enter(&mut self.faults, fault))?;
        match observation.n_measured() {
            0 => Err(RowStatus::NothingMeasured),
            _ => Ok(observation),
        }
    }

    /// Reads a mask that is not held. Releases all other masks if the memory would be exceeded.
    fn read(&mut self, index: usize) -> Result<(), RowStatus> {
        if matches!(self.masks[index].seen, Seen::Unread) {
            let others = self.masks.iter_mut();
            let held: Vec<_> = others.filter(|other| other.seen.mask().is_some()).collect();
            if (held.len() + 1) * self.image.depth.pixels().len() > self.memory {
                for other in held {
                    other.seen = Seen::Unread;
                }
            }
            self.masks[index].seen = match self.masks[index].source.read(&self.image) {
                Ok(mask) => Seen::Read(mask),
                Err(fault) => Seen::Unusable(enter(&mut self.faults, fault)),
            };
        }
        match &self.masks[index].seen {
            Seen::Unusable(status) => Err(*status),
            _ => Ok(()),
        }
    }

    /// Returns the number of pixels of each mask that the model covers at a pose.
    fn overlaps(
        &mut self,
        refiner: &mut Refiner,
        model: &Model,
        pose: &Isometry3<f64>,
        masks: &[usize],
    ) -> Vec<u64> {
        let camera = self.image.camera;
        let view = refiner.workspace_mut().view(model, &camera, pose);
        let covered: Vec<(u32, u32)> = view.covered().collect();
        let overlap = |index: &usize| {
            // If the file has changed since the first read, the mask covers nothing.
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

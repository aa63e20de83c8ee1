//! The masks of an image, and what each cuts out of it.

use std::sync::Arc;

use hicp_io::bop::Detection;
use hicp_io::is_absent;
use hybrid_icp::Refiner;
use hybrid_icp::core::{Isometry3, Mask, Model, Observation};

use crate::assignment::assign_masks;
use crate::box_mask::BoxMask;
use crate::fault::{Fault, FaultKind};
use crate::mask_file::Source;
use crate::row_status::RowStatus;
use crate::scenes::Image;

/// Bytes of masks, one per pixel, that are held at once.
const HELD_BYTES: usize = 1 << 28;

/// An image while its rows are refined: its depth read once and shared by its observations, a mask read when a row of its object asks for it, an observation
/// made when a row is refined in it.
#[derive(Debug)]
pub struct BopImage<'a> {
    image: Image,
    masks: Vec<Candidate<'a>>,
    faults: Vec<Fault>,
    /// Pixels of the masks that are held, and how many may be.
    held: usize,
    memory: usize,
}

/// A mask that rows of an object may be refined in.
#[derive(Debug)]
struct Candidate<'a> {
    obj_id: u32,
    source: Source<'a>,
    seen: Seen,
}

/// What is known of a mask.
#[derive(Debug)]
enum Seen {
    /// Nobody asked for it yet, or it was let go.
    Unread,
    /// It is not there or cannot be used.
    Unusable(RowStatus),
    Read(Mask),
    Observed(Box<Observation>),
}

impl<'a> BopImage<'a> {
    /// An image whose masks are the visible masks of its ground truth; without ground truth it has none, and a fault that says so.
    #[must_use]
    pub fn with_visible_masks(image: Image) -> Self {
        let truths = image.scene.ground_truth(image.im_id);
        let unknown = truths.is_none().then(|| no_ground_truth(&image));
        let masks = truths.unwrap_or_default().iter().enumerate();
        let masks = masks.map(|(instance, truth)| (truth.obj_id, Source::Instance(instance)));
        let masks = candidates(masks);
        let mut frame = Self::new(image, masks);
        frame.faults.extend(unknown);
        frame
    }

    /// An image whose masks are the segmentations of detections; those without one are of no use and no harm.
    #[must_use]
    pub fn with_detections(image: Image, detections: &'a [Detection]) -> Self {
        let coded = detections.iter();
        let coded = coded.filter_map(|d| Some((d.category_id, d.segmentation.as_ref()?)));
        let masks = candidates(coded.map(|(obj_id, code)| (obj_id, Source::Code(code))));
        Self::new(image, masks)
    }

    /// An image without masks, for [`BopImage::observe_box`].
    #[must_use]
    pub fn without_masks(image: Image) -> Self {
        Self::new(image, Vec::new())
    }

    fn new(image: Image, masks: Vec<Candidate<'a>>) -> Self {
        Self {
            image,
            masks,
            faults: Vec::new(),
            held: 0,
            memory: HELD_BYTES,
        }
    }

    /// Limits the memory of masks that are held at once, bytes: 256 MiB unless told. One is held whatever its size.
    ///
    /// A few characters of a run-length code may stand for a whole image, so a file can name far more masks than fit into memory. Beyond
    /// the limit all are let go and read again when they are asked for, to the same results.
    #[must_use]
    pub fn with_memory(mut self, bytes: usize) -> Self {
        self.memory = bytes;
        self
    }

    /// The image.
    #[must_use]
    pub fn image(&self) -> &Image {
        &self.image
    }

    /// Masks that are missing or could not be used, as far as rows asked for them.
    #[must_use]
    pub fn into_faults(self) -> Vec<Fault> {
        self.faults
    }

    /// Chooses a mask for every pose of an object, as [`assign_masks`] does; or says why a pose has none.
    ///
    /// The masks returned are for [`BopImage::observation`]. Cost: a render per pose and O(silhouette) per mask. The renderer's cache
    /// keeps the last few, so that the refinement of a single pose begins with the render that chose its mask.
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

    /// Returns what a mask cuts out of the image, made when it is first asked for.
    ///
    /// # Errors
    ///
    /// The status of rows in a mask that cannot be used; [`BopImage::choose`] returns no such mask.
    pub fn observation(&mut self, mask: usize) -> Result<&Observation, RowStatus> {
        self.read(mask)?;
        let seen = &mut self.masks[mask].seen;
        if matches!(seen, Seen::Read(_))
            && let Seen::Read(read) = std::mem::replace(seen, Seen::Unusable(RowStatus::Damaged))
        {
            match Observation::new(Arc::clone(&self.image.depth), read, self.image.camera) {
                Ok(observation) => *seen = Seen::Observed(Box::new(observation)),
                Err(error) => {
                    self.held = self.held.saturating_sub(self.n_pixels());
                    self.faults.push(Fault::damaged(error.to_string()));
                }
            }
        }
        match &self.masks[mask].seen {
            Seen::Observed(observation) => Ok(observation),
            Seen::Unusable(status) => Err(*status),
            Seen::Unread | Seen::Read(_) => Err(RowStatus::NoMask),
        }
    }

    /// Makes the observation of an estimate that has no mask but the box about it.
    ///
    /// # Errors
    ///
    /// [`RowStatus::NothingMeasured`] where the mask is empty.
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
        // The mask has the size of the depth image, and so has the camera.
        Observation::new(Arc::clone(depth), mask, *camera).map_err(|_| RowStatus::Damaged)
    }

    fn n_pixels(&self) -> usize {
        self.image.depth.pixels().len()
    }

    /// Lets all masks go that are held.
    fn release(&mut self) {
        for candidate in &mut self.masks {
            if matches!(candidate.seen, Seen::Read(_) | Seen::Observed(_)) {
                candidate.seen = Seen::Unread;
            }
        }
        self.held = 0;
    }

    /// Makes sure that a mask is read.
    fn read(&mut self, index: usize) -> Result<(), RowStatus> {
        if matches!(self.masks[index].seen, Seen::Unread) {
            if self.held.saturating_add(self.n_pixels()) > self.memory {
                self.release();
            }
            let seen = match self.masks[index].source.read(&self.image) {
                Ok(mask) => {
                    self.held += self.n_pixels();
                    Seen::Read(mask)
                }
                Err(fault) => {
                    let status = RowStatus::from(&fault);
                    self.faults.push(fault);
                    Seen::Unusable(status)
                }
            };
            self.masks[index].seen = seen;
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
        let region = view.region();
        masks
            .iter()
            .map(|index| {
                let mask = match self.read(*index).map(|()| &self.masks[*index].seen) {
                    Ok(Seen::Read(mask)) => mask,
                    Ok(Seen::Observed(observation)) => observation.mask(),
                    // It could be used a moment ago: its file has changed.
                    _ => return 0,
                };
                let pixels = (region.v_min..region.v_max)
                    .flat_map(|v| (region.u_min..region.u_max).map(move |u| (u, v)));
                let covered = pixels.zip(view.depth());
                let both =
                    covered.filter(|((u, v), z)| **z > 0.0 && mask.get(*u, *v) == Some(true));
                both.count() as u64
            })
            .collect()
    }
}

/// Why nothing is known of the instances of an image, in the words of what else is missing.
fn no_ground_truth(image: &Image) -> Fault {
    let path = image.scene.dir().join("scene_gt.json");
    let why = match is_absent(&path) {
        true => "does not exist".to_owned(),
        false => format!("does not have image {}", image.im_id),
    };
    Fault {
        kind: FaultKind::MissingMask,
        text: format!("ground truth is missing: {} {why}", path.display()),
    }
}

fn candidates<'a>(masks: impl Iterator<Item = (u32, Source<'a>)>) -> Vec<Candidate<'a>> {
    masks
        .map(|(obj_id, source)| Candidate {
            obj_id,
            source,
            seen: Seen::Unread,
        })
        .collect()
}

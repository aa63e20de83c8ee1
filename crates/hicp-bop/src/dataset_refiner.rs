//! The refinement of an image's rows.

use std::collections::BTreeMap;
use std::time::Instant;

use hicp_io::bop::{Detection, ResultRow};
use hybrid_icp::checks::{warning_of_box, warnings};
use hybrid_icp::core::{Isometry3, Model};
use hybrid_icp::icp::{Alternative, Verdict};
use hybrid_icp::{Refinement, Refiner};

use crate::bop_image::BopImage;
use crate::fault::Fault;
use crate::frames::FrameKey;
use crate::mask_source::MaskSource;
use crate::models::Models;
use crate::result::{FrameResult, RowResult};
use crate::row_status::RowStatus;
use crate::scenes::Scenes;

/// The shared data of a dataset's images: its models, its scenes, and the source of masks.
///
/// Threads may share it; each thread needs a separate [`Refiner`].
#[derive(Debug)]
pub struct DatasetRefiner {
    /// The models of the objects that rows name.
    pub models: Models,
    /// The scenes.
    pub scenes: Scenes,
    /// The source of masks.
    pub masks: MaskSource,
}

impl DatasetRefiner {
    /// Refines the rows of one image.
    ///
    /// `indices` are the positions of these rows in `rows`, ascending ([`crate::frames_of`]). The
    /// rows of an object compete for its masks ([`crate::assign_masks`]). Without segmentation,
    /// each row has a separate mask ([`crate::BoxMask`]). With [`MaskSource::OfRows`], the poses of
    /// the rows are ignored and estimated.
    ///
    /// The color image is read if one of the models has colors.
    ///
    /// Never fails: a row that cannot be refined has a [`RowStatus`] with the reason, and missing
    /// or damaged files are listed in the faults. Except for the time, the result depends only on
    /// the arguments.
    ///
    /// Memory: the image, the masks of the objects in its rows, and one observation per used mask.
    ///
    /// # Panics
    ///
    /// Panics if an index is beyond `rows`.
    pub fn frame(
        &self,
        refiner: &mut Refiner,
        key: FrameKey,
        rows: &[ResultRow],
        indices: &[usize],
    ) -> FrameResult {
        let mut image = match self.scenes.read(key) {
            Ok(image) => image,
            Err(fault) => {
                let status = RowStatus::from(&fault);
                let unrefined = indices.iter().map(|i| RowResult::unrefined(*i, status));
                return FrameResult {
                    rows: unrefined.collect(),
                    faults: vec![fault],
                    ..FrameResult::default()
                };
            }
        };
        let mut result = FrameResult::default();
        let objects = indices.iter().map(|index| rows[*index].obj_id);
        if objects.into_iter().any(|obj_id| self.is_colored(obj_id)) {
            let unread = image.read_color().err();
            result.uncolored = unread.is_none() && image.color.is_none();
            result.faults.extend(unread.map(|fault| Fault {
                text: format!(
                    "{}; the rows of the image are refined by depth alone",
                    fault.text
                ),
                ..fault
            }));
        }
        let mut work = Work {
            frame: self.masks.frame(key, image),
            refiner,
            result,
        };
        let mut by_object: BTreeMap<u32, Vec<(usize, Isometry3<f64>)>> = BTreeMap::new();
        for index in indices {
            let row = &rows[*index];
            let of_object = by_object.entry(row.obj_id).or_default();
            of_object.push((*index, row.camera_from_object()));
        }
        for (obj_id, of_object) in by_object {
            match (self.models.by_id.get(&obj_id), &self.masks) {
                (None, _) if self.models.broken.contains_key(&obj_id) => {
                    work.leave(&of_object, RowStatus::Damaged);
                }
                (None, _) => work.leave(&of_object, RowStatus::MissingModel),
                (Some(model), MaskSource::Box(by)) => {
                    for (index, init) in of_object {
                        let start = Instant::now();
                        let observed = work.frame.observe_box(work.refiner, model, &init, by);
                        match observed {
                            Ok(observed) => {
                                let refined = work.refiner.refine(model, &observed, &init);
                                work.done(start, index, &refined);
                            }
                            Err(status) => work.leave(&[(index, init)], status),
                        }
                    }
                }
                (Some(model), MaskSource::OfRows(detections)) => {
                    work.estimate(model, obj_id, &of_object, detections);
                }
                (Some(model), _) => work.in_masks(model, obj_id, &of_object),
            }
        }
        let mut result = work.result;
        result.rows.sort_by_key(|row| row.index);
        result.faults.extend(work.frame.into_faults());
        result
    }

    /// Returns whether the model of an object has colors.
    fn is_colored(&self, obj_id: u32) -> bool {
        let model = self.models.by_id.get(&obj_id);
        model.is_some_and(|model| model.mesh().color().is_some())
    }
}

/// The state of an image during its refinement.
struct Work<'a, 'r> {
    frame: BopImage<'a>,
    refiner: &'r mut Refiner,
    result: FrameResult,
}

impl Work<'_, '_> {
    /// Refines the rows of an object, each with its assigned mask.
    fn in_masks(&mut self, model: &Model, obj_id: u32, rows: &[(usize, Isometry3<f64>)]) {
        let poses: Vec<Isometry3<f64>> = rows.iter().map(|(_, init)| *init).collect();
        let mut start = Instant::now();
        let mut looked = false;
        let chosen = self.frame.choose(self.refiner, model, obj_id, &poses);
        for ((index, init), mask) in rows.iter().zip(chosen) {
            match mask.and_then(|mask| self.frame.observation(mask)) {
                Ok(observation) => {
                    if !std::mem::replace(&mut looked, true) {
                        let warnings = warnings(model, observation, init).into_iter();
                        self.result.warnings.extend(warnings.map(|d| (obj_id, d)));
                    }
                    let refined = self.refiner.refine(model, observation, init);
                    self.done(start, *index, &refined);
                    // Only the first refined row includes the time of the choice.
                    start = Instant::now();
                }
                Err(status) => self.leave(&[(*index, *init)], status),
            }
        }
    }

    /// Estimates the rows of an object, each in the mask of its detection.
    fn estimate(
        &mut self,
        model: &Model,
        obj_id: u32,
        rows: &[(usize, Isometry3<f64>)],
        detections: &[Detection],
    ) {
        let mut looked = false;
        for (index, init) in rows {
            let start = Instant::now();
            let detection = detections.get(*index).ok_or(RowStatus::NoMask);
            match detection.and_then(|detection| self.frame.observe_detection(detection)) {
                Ok(observation) => {
                    let found = self.refiner.estimate(model, &observation);
                    self.done(start, *index, &found);
                    if !std::mem::replace(&mut looked, true) {
                        let pose = &found.outcome.camera_from_object;
                        let mut warnings = warnings(model, &observation, pose);
                        let bbox = detection.ok().filter(|d| d.segmentation.is_none());
                        let bbox = bbox.and_then(|detection| detection.bbox);
                        let size = observation.camera().size();
                        warnings.extend(bbox.and_then(|bbox| warning_of_box(bbox, size)));
                        let warnings = warnings.into_iter();
                        self.result.warnings.extend(warnings.map(|d| (obj_id, d)));
                    }
                }
                Err(status) => self.leave(&[(*index, *init)], status),
            }
        }
    }

    fn done(&mut self, start: Instant, index: usize, refinement: &Refinement) {
        let row = row_of(index, refinement, self.refiner.alternatives());
        *self.result.seconds.get_or_insert(0.0) += start.elapsed().as_secs_f64();
        self.result.rows.push(row);
    }

    fn leave(&mut self, rows: &[(usize, Isometry3<f64>)], status: RowStatus) {
        let left = rows
            .iter()
            .map(|(index, _)| RowResult::unrefined(*index, status));
        self.result.rows.extend(left);
    }
}

/// Returns the result of a row.
fn row_of(index: usize, refinement: &Refinement, alternatives: &[Alternative]) -> RowResult {
    let outcome = &refinement.outcome;
    let (status, pose) = match outcome.verdict {
        Verdict::Refined => (RowStatus::Refined, Some(outcome.camera_from_object)),
        Verdict::KeptInitial(reason) => (RowStatus::Kept(reason), None),
    };
    RowResult {
        index,
        status,
        pose,
        mve: Some((refinement.mve_initial, refinement.mve)),
        confidence: Some(refinement.confidence),
        flatness: refinement.flatness,
        alternatives: alternatives.to_vec(),
    }
}

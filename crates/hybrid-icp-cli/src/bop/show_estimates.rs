//! What `bop show` tells of an image's estimates: their scores, their MVE, and their errors where there is ground truth.

use std::collections::BTreeSet;

use hicp_bop::{FaultKind, Image, MaskSource, Models, Scenes, frames_of};
use hicp_io::bop::ResultRow;
use hybrid_icp::{Isometry3, Mask, Preset, Refiner};

use super::judge::{EvaluatedObject, Judge, Renders};

/// An estimate of a result file.
#[derive(Clone, Debug)]
pub(crate) struct Estimate {
    pub(crate) obj_id: u32,
    pub(crate) camera_from_object: Isometry3<f64>,
    pub(crate) score: f64,
    /// `None` where no mask of the object meets the silhouette.
    pub(crate) mve: Option<f64>,
    /// The mask that the MVE is of.
    pub(crate) mask: Option<Mask>,
    /// Against the instance of the image's ground truth that is nearest by ADI.
    pub(crate) error: Option<PoseError>,
}

/// Errors of an estimate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PoseError {
    pub(crate) adi_m: f64,
    /// Mean over BOP's ten tolerances.
    pub(crate) vsd: f64,
    /// Whether ADI is below a tenth of the diameter.
    pub(crate) near: bool,
}

/// What all estimates of the image are looked at with.
pub(crate) struct Inspection<'a> {
    pub(crate) scenes: &'a Scenes,
    pub(crate) image: &'a Image,
    pub(crate) frame: (u32, u32),
    /// Models to draw and to score with, and those to evaluate with.
    pub(crate) models: &'a Models,
    pub(crate) eval_models: &'a Models,
    pub(crate) masks: &'a MaskSource,
    /// Visibility tolerance of VSD, metres.
    pub(crate) delta: f64,
    /// Estimates of every object; as many as the ground truth has instances if not given.
    pub(crate) top: Option<usize>,
}

/// The estimates of a file that are shown.
#[derive(Debug, Default)]
pub(crate) struct Estimates {
    /// By object, those with the best scores first.
    pub(crate) shown: Vec<Estimate>,
    /// Rows of the image that are not shown, because others of their object have better scores.
    pub(crate) beyond: usize,
    /// Files that could not be used.
    pub(crate) damaged: Vec<String>,
}

impl Inspection<'_> {
    /// Returns the places of an object's instances in the ground truth.
    pub(crate) fn instances(&self, obj_id: u32) -> Vec<usize> {
        let truths = self.image.scene.ground_truth(self.image.im_id);
        let truths = truths.unwrap_or_default().iter().enumerate();
        let of_object = truths.filter(|(_, truth)| truth.obj_id == obj_id);
        of_object.map(|(index, _)| index).collect()
    }

    /// Looks at the image's rows of a result file.
    pub(crate) fn estimates(&self, rows: &[ResultRow]) -> Estimates {
        let judge = Judge {
            objects: EvaluatedObject::of_models(self.eval_models, None),
            scenes: self.scenes,
            rows,
            rows_of: frames_of(rows).into_iter().collect(),
            delta: self.delta,
        };
        let of_frame = judge.rows_of.get(&self.frame);
        let of_frame = of_frame.map_or(&[][..], Vec::as_slice);
        let objects: BTreeSet<u32> = of_frame.iter().map(|row| rows[*row].obj_id).collect();
        let mut frame = self.masks.frame(self.frame, self.image.clone());
        let mut refiner = Refiner::preset(Preset::Hybrid);
        let mut renders = Renders::default();
        let mut found = Estimates::default();
        for obj_id in objects {
            let (Some(model), Some(object)) =
                (self.models.by_id.get(&obj_id), judge.objects.get(&obj_id))
            else {
                continue;
            };
            let truths = self.instances(obj_id);
            let count = self.top.unwrap_or(truths.len().max(1));
            let target = (obj_id, object);
            let judged = judge.target(
                &mut renders,
                self.image,
                self.frame,
                target,
                (truths, count),
            );
            let judged = match judged {
                Ok(judged) => judged,
                Err(text) => {
                    found.damaged.push(text);
                    continue;
                }
            };
            let of_object = of_frame.iter().filter(|row| rows[**row].obj_id == obj_id);
            found.beyond += of_object.count() - judged.rows.len();
            let poses = judged
                .rows
                .iter()
                .map(|row| rows[*row].camera_from_object());
            let poses: Vec<Isometry3<f64>> = poses.collect();
            let masks = frame.choose(&mut refiner, model, obj_id, &poses);
            let judged_rows = judged.rows.iter().zip(&judged.errors.estimates);
            for ((row, errors), mask) in judged_rows.zip(masks) {
                let row = &rows[*row];
                let pose = row.camera_from_object();
                let nearest = errors.iter().min_by(|a, b| a.adi_m.total_cmp(&b.adi_m));
                let observed = mask.and_then(|mask| frame.observation(mask)).ok();
                found.shown.push(Estimate {
                    obj_id,
                    camera_from_object: pose,
                    score: row.score,
                    mve: observed.map(|observation| refiner.mve(model, observation, &pose)),
                    mask: observed.map(|observation| observation.mask().clone()),
                    error: nearest.map(|errors| PoseError {
                        adi_m: errors.adi_m,
                        vsd: errors.vsd.iter().sum::<f64>() / errors.vsd.len() as f64,
                        near: errors.adi_m < 0.1 * judged.errors.diameter_m,
                    }),
                });
            }
        }
        // An estimate whose mask is missing is shown without one.
        let faults = frame.into_faults().into_iter();
        let damaged = faults.filter(|fault| fault.kind == FaultKind::Damaged);
        found.damaged.extend(damaged.map(|fault| fault.text));
        found
    }
}

//! The estimates of an image: their scores, their MVE, and their errors against the ground truth.

use std::collections::BTreeSet;

use hicp_bop::{
    EvaluatedObject, Fault, FaultKind, Image, Judge, MaskSource, Models, Renders, Scenes, instances,
};
use hicp_io::bop::ResultRow;
use hybrid_icp::core::{Isometry3, Mask};
use hybrid_icp::{Preset, Refiner};

/// An estimate of a result file.
#[derive(Clone, Debug)]
pub(super) struct Estimate {
    pub(super) obj_id: u32,
    pub(super) camera_from_object: Isometry3<f64>,
    pub(super) score: f64,
    /// `None` if no mask of the object overlaps the silhouette.
    pub(super) mve: Option<f64>,
    /// The mask that the MVE is computed in.
    pub(super) mask: Option<Mask>,
    /// Errors against the instance of the ground truth that is nearest by ADI.
    pub(super) error: Option<PoseError>,
}

/// Errors of an estimate.
#[derive(Clone, Copy, Debug)]
pub(super) struct PoseError {
    pub(super) adi_m: f64,
    /// Mean over BOP's ten tolerances.
    pub(super) vsd: f64,
    /// `true` if ADI is below a tenth of the diameter.
    pub(super) near: bool,
}

/// An image and everything that its estimates are compared with.
pub(super) struct Inspection<'a> {
    pub(super) scenes: &'a Scenes,
    pub(super) image: &'a Image,
    pub(super) frame: (u32, u32),
    /// Models to draw and to score with.
    pub(super) models: &'a Models,
    /// Models to evaluate with.
    pub(super) eval_models: &'a Models,
    pub(super) masks: &'a MaskSource,
    /// Visibility tolerance of VSD.
    pub(super) delta_meters: f64,
    /// Estimates of every object, by default as many as the ground truth has instances.
    pub(super) top: Option<usize>,
}

/// The estimates of a result file.
#[derive(Debug, Default)]
pub(super) struct Estimates {
    /// Name of the file.
    pub(super) file: String,
    /// The estimates that are shown: by object, those with the best scores first.
    pub(super) shown: Vec<Estimate>,
    /// The number of rows that are not shown because others of their object have better scores.
    pub(super) beyond: usize,
    /// Files that could not be used.
    pub(super) faults: Vec<Fault>,
}

impl Inspection<'_> {
    /// Scores the image's rows of a result file and computes their errors.
    pub(super) fn estimates(&self, file: String, rows: &[ResultRow]) -> Estimates {
        let mut found = Estimates {
            file,
            ..Estimates::default()
        };
        let objects = EvaluatedObject::of_models(self.eval_models, None);
        let judge = Judge::new(objects, self.scenes, rows, self.delta_meters);
        let of_image = rows
            .iter()
            .filter(|row| (row.scene_id, row.im_id) == self.frame);
        let objects: BTreeSet<u32> = of_image.map(|row| row.obj_id).collect();
        let mut image = self.masks.frame(self.frame, self.image.clone());
        let mut refiner = Refiner::preset(Preset::Hybrid);
        let mut renders = Renders::default();
        for obj_id in objects {
            let Some(model) = self.models.by_id.get(&obj_id) else {
                continue;
            };
            let truths = instances(self.image, obj_id, usize::MAX);
            let count = self.top.unwrap_or(truths.len().max(1));
            let judged = judge.target(&mut renders, self.image, self.frame, obj_id, truths, count);
            let judged = match judged {
                Ok(Some(judged)) => judged,
                Ok(None) => continue,
                Err(fault) => {
                    found.faults.push(fault);
                    continue;
                }
            };
            found.beyond += judge.rows_of(self.frame, obj_id).len() - judged.rows.len();
            let poses = judged.rows.iter();
            let poses: Vec<_> = poses.map(|row| rows[*row].camera_from_object()).collect();
            let masks = image.choose(&mut refiner, model, obj_id, &poses);
            let judged_rows = judged.rows.iter().zip(&judged.errors.estimates);
            for (((row, errors), pose), mask) in judged_rows.zip(poses).zip(masks) {
                let nearest = errors.iter().min_by(|a, b| a.adi_m.total_cmp(&b.adi_m));
                let observed = mask.and_then(|mask| image.observation(mask)).ok();
                found.shown.push(Estimate {
                    obj_id,
                    camera_from_object: pose,
                    score: rows[*row].score,
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
        // An estimate whose mask is missing is shown without an MVE.
        let faults = image.into_faults().into_iter();
        found
            .faults
            .extend(faults.filter(|fault| fault.kind == FaultKind::Damaged));
        found
    }
}

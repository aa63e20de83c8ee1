//! Registration of an object near a pose, in the pixels around it.

use std::sync::Arc;

use hicp_association::Stride;
use hicp_core::{
    DepthImage, ImageError, Isometry3, Mask, Matrix6, Model, Observation, PinholeCamera, Problem,
};
use hicp_icp::{Cascade, Outcome, Session, Stage, Verdict, Workspace};
use hicp_raster::Rasterizer;
use hicp_score::Evidence;

use super::extent::Extent;
use super::found::Found;
use super::motion::{Motion, registered};
use super::region::Widening;
use crate::presets::{Far, Local, Near, Search, local, search};

/// Factor on the deviations of a registration, whose errors are correlated.
const INFLATION: f64 = 2.0;
/// Number of model points of a registration.
const POINTS: usize = 1000;
/// Depth noise before it is measured, in diameters.
const START_NOISE: f64 = 0.02;
/// Distance from the prediction, beyond four standard deviations, that is a jump, in radii.
const JUMP_RADII: f64 = 0.35;

/// The object, the camera, and the stages that register one in images of the other.
pub(super) struct Matcher {
    pub(super) model: Arc<Model>,
    pub(super) camera: PinholeCamera,
    pub(super) extent: Extent,
    /// A short cascade for good predictions.
    near: Near,
    /// The same after a stage that also pulls the object along its own surface.
    far: Cascade<(Far, Near)>,
    local: Local,
    pub(super) search: Search,
    pub(super) workspace: Workspace,
    widening: Widening,
    /// Standard deviation of the depth noise, in diameters.
    noise: f64,
}

impl Matcher {
    pub(super) fn new(model: Arc<Model>, camera: PinholeCamera) -> Self {
        let local = local();
        let steps = &local.0.1.misaligned.0.0;
        let (mut near, far) = (steps.aligned, steps.misaligned);
        near.0.0.selection.stride = Stride::AboutPoints(POINTS);
        near.0.1.selection.stride = Stride::AboutPoints(POINTS);
        Self {
            extent: Extent::new(&model),
            model,
            camera,
            near,
            far: Cascade((far, near)),
            local,
            search: search(),
            workspace: Workspace::new(Rasterizer::default()),
            widening: Widening::default(),
            noise: START_NOISE,
        }
    }

    /// Registers the object near its predicted pose.
    pub(super) fn follow(
        &mut self,
        depth: &Arc<DepthImage>,
        mask: Option<&Mask>,
        motion: &Motion,
    ) -> Result<Option<Found>, ImageError> {
        let diameter = self.extent.diameter;
        let deviation = self.extent.deviation(motion);
        let meters = (3.0 * deviation + 0.03 * diameter).min(0.3 * diameter);
        let observation = self.observe(depth, mask, motion.pose(), meters)?;
        let mut best: Option<Found> = None;
        for effort in 0..3 {
            let (model, workspace) = (&self.model, &mut self.workspace);
            let outcome = match effort {
                0 => run(
                    &mut self.near,
                    workspace,
                    model,
                    &observation,
                    motion.pose(),
                ),
                1 => run(&mut self.far, workspace, model, &observation, motion.pose()),
                _ => run(
                    &mut self.local,
                    workspace,
                    model,
                    &observation,
                    motion.pose(),
                ),
            };
            let found = self.judge(&observation, &outcome);
            let reach = JUMP_RADII * self.extent.radius + 4.0 * deviation;
            let found = found.filter(|f| self.extent.distance(&f.pose, motion.pose()) < reach);
            if let Some(found) = found
                && best.is_none_or(|best| best.merit() < found.merit())
            {
                best = Some(found);
            }
            let enough = |f: Found| f.is_clear() || f.is_hidden() || effort == 1 && f.is_sure();
            if best.is_some_and(enough) {
                break;
            }
        }
        if let Some(best) = best.filter(|best| best.evidence.agrees > 0.3) {
            self.noise += 0.2 * (best.noise() - self.noise);
        }
        Ok(best)
    }

    /// Returns the better of two registrations from a pose.
    pub(super) fn register(
        &mut self,
        observation: &Observation,
        init: &Isometry3<f64>,
    ) -> Option<Found> {
        let (model, workspace) = (&self.model, &mut self.workspace);
        let near = run(&mut self.near, workspace, model, observation, init);
        let far = run(&mut self.far, workspace, model, observation, init);
        let found = [near, far].map(|outcome| self.judge(observation, &outcome));
        let found = found.into_iter().flatten();
        found.max_by(|a, b| a.merit().total_cmp(&b.merit()))
    }

    /// Returns the pixels around a pose whose depth is near that of the object.
    pub(super) fn observe(
        &mut self,
        depth: &Arc<DepthImage>,
        mask: Option<&Mask>,
        pose: &Isometry3<f64>,
        meters: f64,
    ) -> Result<Observation, ImageError> {
        let z = (pose * self.model.center()).z.max(self.extent.radius);
        let pixels = (self.camera.fx() * meters / z).clamp(2.0, 64.0);
        // Noise must not cut the surface at the border of the gate, which would hold it in place.
        let meters = meters + 2.5 * self.noise * self.extent.diameter;
        let view = self.workspace.view(&self.model, &self.camera, pose);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // Clamped.
        let around = self
            .widening
            .mask(view, depth, pixels as u32, meters as f32);
        let around = match mask {
            Some(mask) => Mask::in_region(
                around.width(),
                around.height(),
                &around.bounding_region(),
                |u, v| around.get(u, v) == Some(true) && mask.get(u, v) == Some(true),
            ),
            None => around,
        };
        Observation::new(Arc::clone(depth), around, self.camera)
    }

    pub(super) fn judge(&mut self, observation: &Observation, outcome: &Outcome) -> Option<Found> {
        if matches!(outcome.verdict, Verdict::KeptInitial(_)) && outcome.evaluation.is_none() {
            return None;
        }
        let problem = Problem::new(&self.model, observation);
        let pose = outcome.camera_from_object;
        let evidence = Evidence::at(&mut self.workspace.context(&problem), &pose)?;
        Some(Found {
            pose,
            quality: outcome.quality,
            evidence,
        })
    }

    pub(super) fn covariance(&self, found: &Found) -> Matrix6<f64> {
        let radius = self.extent.radius;
        let center = found.pose * self.model.center();
        let (scale, information) = match found.quality {
            Some(quality) => (
                (INFLATION * quality.plane_rmse).powi(2),
                quality.information().unwrap_or_default(),
            ),
            None => (1.0, Matrix6::zeros()),
        };
        registered(
            &information,
            &center,
            scale.max(1e-8),
            [0.005 * radius, 0.005],
            [radius, 1.0],
        )
    }
}

/// Runs a stage on an image.
pub(super) fn run(
    stage: &mut impl Stage,
    workspace: &mut Workspace,
    model: &Model,
    observation: &Observation,
    init: &Isometry3<f64>,
) -> Outcome {
    let problem = Problem::new(model, observation);
    stage.run(&problem, init, &mut Session::new(workspace, &mut ()))
}

//! Registration of an object near a pose, in the pixels around it.

use std::sync::Arc;

use hicp_association::Stride;
use hicp_core::{
    DepthImage, ImageError, Isometry3, Mask, Matrix6, Model, Observation, PinholeCamera, Problem,
};
use hicp_icp::{
    Cascade, IterationLimit, LookAlikeCount, Outcome, SearchOptions, Session, Stage, Verdict,
    Workspace,
};
use hicp_raster::Rasterizer;
use hicp_score::{Confidence, MeanVsd, SampledMve, Score};

use super::found::{Found, measured_noise};
use super::motion::Motion;
use super::region::Widening;
use super::rejections::Rejections;
use crate::extent::{DIFFERENT_DIAMETERS, Extent};
use crate::presets::{Far, Fit, Search, far, fit, look_alikes, search_with};
use crate::registered::Registered;

/// Factor on the deviations of a registration, whose errors are correlated.
const INFLATION: f64 = 2.0;
/// Factor on the deviation of an unknown direction that makes it no information at all.
const NOTHING: f64 = 1e3;
/// Numbers of points of a registration, and of lines across the silhouette.
const POINTS: usize = 1000;
const LINES: usize = 80;
/// Numbers of iterations from a good initial pose and from a rough one.
const ITERATIONS: usize = 3;
pub(super) const ROUGH_ITERATIONS: usize = 8;
/// Deviation of a prediction above which it is a rough initial pose, in diameters.
const ROUGH_DIAMETERS: f64 = 0.05;
/// Standard deviation of the depth noise before it is measured, in diameters.
const START_NOISE: f64 = 0.02;
/// Distance from the prediction, beyond four standard deviations, that is a jump, in radii.
const JUMP_RADII: f64 = 0.35;

/// The object, the camera, and the stages that register one in images of the other.
pub(super) struct Matcher {
    pub(super) model: Arc<Model>,
    pub(super) camera: PinholeCamera,
    pub(super) extent: Extent,
    /// The stage for good predictions.
    near: Fit,
    /// The same after a stage that also pulls the object along its own surface.
    far: Cascade<(Far, Fit)>,
    pub(super) search: Search,
    /// Ranks rotations around an open axis.
    pub(super) ranking: SampledMve,
    /// Lists the poses that look like a given one.
    pub(super) look_alikes: LookAlikeCount<SampledMve, MeanVsd>,
    pub(super) workspace: Workspace,
    widening: Widening,
    /// Standard deviation of the depth noise in the images before, per depth, once measured.
    pub(super) noise: Option<f64>,
    /// The surfaces that were searched in vain.
    pub(super) rejected: Rejections,
}

impl Matcher {
    pub(super) fn new(model: Arc<Model>, camera: PinholeCamera) -> Self {
        let mut near = fit();
        near.association.0.stride = Stride::AboutPoints(POINTS);
        near.association.1.lines = LINES;
        Self {
            extent: Extent::new(&model),
            model,
            camera,
            far: Cascade((far(), near.clone())),
            near,
            search: quick_search(),
            ranking: SampledMve::imperfect_mask(),
            look_alikes: look_alikes(),
            workspace: Workspace::new(Rasterizer::default()),
            widening: Widening::default(),
            noise: None,
            rejected: Rejections::default(),
        }
    }

    /// Registers the object near its predicted pose. The result has a covariance.
    pub(super) fn follow(
        &mut self,
        depth: &Arc<DepthImage>,
        mask: Option<&Mask>,
        motion: &Motion,
    ) -> Result<Option<(Found, Matrix6<f64>)>, ImageError> {
        let diameter = self.extent.diameter;
        let deviation = motion.deviation(&self.extent);
        let meters = (3.0 * deviation + 0.03 * diameter).min(0.3 * diameter);
        let observation = self.observe(depth, mask, motion.pose(), meters)?;
        let reach = JUMP_RADII * self.extent.radius + 4.0 * deviation;
        let rough = deviation > ROUGH_DIAMETERS * diameter;
        let iterations = if rough { ROUGH_ITERATIONS } else { ITERATIONS };
        let mut best: Option<Found> = None;
        for thorough in [false, true] {
            let found = if thorough {
                self.fit_far(&observation, motion.pose())
            } else {
                self.fit(&observation, motion.pose(), iterations)
            };
            if found.is_none() {
                // Nothing was measured near the surface.
                break;
            }
            let found = found.filter(|f| self.extent.distance(&f.pose, motion.pose()) < reach);
            if let Some(found) = found
                && best.is_none_or(|best| best.merit() < found.merit())
            {
                best = Some(found);
            }
            if best.is_some_and(|f| f.is_sure() || f.is_hidden()) {
                break;
            }
        }
        if let Some(best) = best.filter(|best| best.is_sure() && best.evidence.agrees > 0.5) {
            let measured = measured_noise(&best.evidence) / self.depth(&best.pose);
            let before = self.noise.unwrap_or(measured);
            self.noise = Some(before + 0.2 * (measured - before));
        }
        Ok(best.map(|found| (found, self.covariance(&observation, &found, deviation))))
    }

    /// Returns the better of two registrations from a pose.
    pub(super) fn register(
        &mut self,
        observation: &Observation,
        init: &Isometry3<f64>,
    ) -> Option<Found> {
        let near = self.fit(observation, init, ROUGH_ITERATIONS);
        let far = self.fit_far(observation, init);
        let found = near.into_iter().chain(far);
        found.max_by(|a, b| a.merit().total_cmp(&b.merit()))
    }

    /// Fits the rendered surface and its silhouette to the image.
    pub(super) fn fit(
        &mut self,
        observation: &Observation,
        init: &Isometry3<f64>,
        iterations: usize,
    ) -> Option<Found> {
        self.near.stop.1 = IterationLimit(iterations);
        let (stage, workspace) = (&mut self.near, &mut self.workspace);
        let outcome = run(stage, workspace, &self.model, observation, init);
        self.judge(observation, &outcome)
    }

    /// Does the same after a stage that also pulls the object along its own surface.
    fn fit_far(&mut self, observation: &Observation, init: &Isometry3<f64>) -> Option<Found> {
        let (stage, workspace) = (&mut self.far, &mut self.workspace);
        let outcome = run(stage, workspace, &self.model, observation, init);
        self.judge(observation, &outcome)
    }

    /// Forgets the noise and the surfaces of earlier images.
    pub(super) fn forget(&mut self) {
        self.noise = None;
        self.rejected.clear();
    }

    /// Returns the pixels around a pose whose depth is near that of the object.
    pub(super) fn observe(
        &mut self,
        depth: &Arc<DepthImage>,
        mask: Option<&Mask>,
        pose: &Isometry3<f64>,
        meters: f64,
    ) -> Result<Observation, ImageError> {
        let depths = self.depth(pose);
        let diameter = self.extent.diameter;
        let pixels = (self.camera.fx() * meters / (depths * diameter)).clamp(2.0, 64.0);
        let noise = self.noise.map_or(START_NOISE, |noise| noise * depths);
        // Noise must not cut the surface at the border of the gate, which would hold it in place.
        let meters = meters + 2.5 * noise * diameter;
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

    fn judge(&mut self, observation: &Observation, outcome: &Outcome) -> Option<Found> {
        if matches!(outcome.verdict, Verdict::KeptInitial(_)) && outcome.evaluation.is_none() {
            return None;
        }
        let problem = Problem::new(&self.model, observation);
        let pose = outcome.camera_from_object;
        let mut context = self.workspace.context(&problem);
        let mve = MeanVsd::default().score(&mut context, &pose);
        let (evidence, confidence) = Confidence::at(&mut context, &pose, mve, 0.0);
        let judged = (mve, evidence, confidence.probability);
        let noise = self.noise.map(|noise| noise * self.depth(&pose));
        Some(Found::new(pose, outcome.quality, judged, noise))
    }

    /// Returns the depth of the object's center, in diameters.
    fn depth(&self, pose: &Isometry3<f64>) -> f64 {
        let z = (pose * self.model.center()).z.max(self.extent.radius);
        z / self.extent.diameter
    }

    /// Returns the covariance of a registered pose around the object's center.
    ///
    /// Open directions are unknown ([`Registered::forget_open`]).
    ///
    /// `deviation` is that of the prediction, meters. If it is large, the variance of an unknown
    /// direction bounds it. Otherwise the variance is so large that images without information do
    /// not add up to a known direction.
    pub(super) fn covariance(
        &mut self,
        observation: &Observation,
        found: &Found,
        deviation: f64,
    ) -> Matrix6<f64> {
        let radius = self.extent.radius;
        let (scale, information) = match found.quality {
            Some(quality) => (
                (INFLATION * quality.plane_rmse).powi(2),
                quality.information().unwrap_or_default(),
            ),
            None => (1.0, Matrix6::zeros()),
        };
        let mut registered = Registered::new(&information, &self.extent, &found.pose);
        let problem = Problem::new(&self.model, observation);
        let workspace = &mut self.workspace;
        let mut score = |pose: &_| MeanVsd::default().score(&mut workspace.context(&problem), pose);
        let open = registered.forget_open(&self.extent, &found.pose, found.mve, &mut score);
        let certain = deviation < DIFFERENT_DIAMETERS * self.extent.diameter;
        let factor = if certain && !open.is_empty() {
            NOTHING
        } else {
            1.0
        };
        let unknown = [radius, 1.0].map(|x| factor * x);
        registered.covariance(scale.max(1e-8), [0.005 * radius, 0.005], unknown)
    }
}

/// Creates a search that searches unless it is sure, with fewer hypotheses than `search`.
///
/// A surface that is not the object must not take long, because most are not.
fn quick_search() -> Search {
    search_with(SearchOptions {
        good_enough: 0.1,
        hypotheses: 512,
        aligned: 128,
        refined: 8,
        widens: false,
        ..SearchOptions::default()
    })
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

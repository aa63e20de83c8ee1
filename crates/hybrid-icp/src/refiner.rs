//! One call from an observation and a rough pose to a pose with its score.

use hicp_core::{Isometry3, Model, Observation, Problem, Renderer};
use hicp_icp::{
    Alternative, BoxedStage, LookAlikeCount, Observer, Outcome, Session, Stage, Termination,
    Workspace, is_near,
};
use hicp_raster::Rasterizer;
use hicp_score::{Confidence, Evidence, Flatness, MeanVsd, SampledMve, Score};

use crate::checks::{warning_of_runner_up, warnings_of_result};
use crate::preset::Preset;
use crate::presets;
use crate::warning::Warning;

/// Least number of measured pixels of the images in which look-alikes of near poses are counted.
const COARSE_PIXELS: usize = 2500;

/// The result of a refinement: a pose, how it was found, and how well it explains the image.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Refinement {
    /// The pose (`outcome.camera_from_object`), the reason why the pipeline ended, and the numbers
    /// at that pose.
    ///
    /// If no part of the pipeline evaluated the pose, the evaluation and quality are those of the
    /// refiner's own fit, point-to-plane over the rendered surface and the silhouette.
    pub outcome: Outcome,
    /// The mean VSD estimate of the initial pose: 0 agrees with the image everywhere, 1 nowhere.
    ///
    /// Equal to [`Self::mve`] if there was no initial pose ([`Refiner::estimate`]).
    pub mve_initial: f64,
    /// The mean VSD estimate of the returned pose, by the default [`MeanVsd`].
    ///
    /// Presets such as `auto` lower another MVE ([`MeanVsd::imperfect_mask`]), so this one may rise
    /// a little. A rise above `mve_initial` of more than 0.01 is a warning ([`Warning::Worse`]).
    pub mve: f64,
    /// The probability that the returned pose is right, 0 to 1 ([`Confidence`]).
    ///
    /// Poses that look alike and explain the image as well lower it. They do so less if the
    /// returned pose is within 0.25 diameters of the initial one. Accept a pose with 0.95 or more
    /// ([`ACCEPTED`](crate::ACCEPTED)).
    pub confidence: f64,
    /// The largest distance to expect of a surface point from its true place, meters.
    pub expected_error_meters: f64,
    /// The rotation error to expect, degrees.
    pub expected_error_degrees: f64,
    /// Flatness of the measured and the rendered surface at the returned pose, which tells whether
    /// a plane would explain the depth better. `None` if fewer than 64 pixels show both.
    pub flatness: Option<Flatness>,
    /// The evidence for and against the returned pose, and how well the mask fits it.
    pub evidence: Evidence,
    /// The number of other poses that look alike, each weighted by how well it explains the image.
    ///
    /// A pose that explains it as well counts 1, one that explains it better up to 2, and others
    /// less ([`Alternative::likelihood`]). At most four poses count, and no declared symmetries.
    pub look_alikes: f64,
    /// The best other pose that a search found; `None` without a search or another pose.
    ///
    /// [`Refiner::alternatives`] has all of them.
    pub runner_up: Option<Alternative>,
}

impl Refinement {
    /// Returns the reasons not to trust the pose, if there are any ([`warnings_of_result`]).
    #[must_use]
    pub fn warnings(&self) -> Vec<Warning> {
        let mut warnings =
            warnings_of_result(self.mve_initial, self.mve, self.confidence, self.flatness);
        warnings.extend(self.runner_up.as_ref().and_then(warning_of_runner_up));
        warnings
    }
}

/// A pipeline with its scratch memory and renderer, for any number of refinements: create one per
/// thread, or call [`refine_batch`](crate::refine_batch).
///
/// The pipeline is any stage, by default a boxed one. [`Refiner::stage_mut`] changes it in place,
/// and [`Refiner::into_stage`] returns it.
///
/// ```
/// use hybrid_icp::core::{
///     DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, Point3, TriMesh,
/// };
/// use hybrid_icp::{Preset, Refiner, refine_batch};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let camera = PinholeCamera::new(100.0, 100.0, 31.5, 31.5, 64, 64)?;
/// let plate = vec![
///     Point3::new(-0.1, -0.1, 0.0), Point3::new(0.1, -0.1, 0.0), Point3::new(0.1, 0.1, 0.0), Point3::new(-0.1, 0.1, 0.0),
/// ];
/// let model = Model::new(TriMesh::new(plate, vec![[0, 2, 1], [0, 3, 2]])?);
/// // The plate stands half a meter in front of the camera; the detector is 4 cm off.
/// let depth = (0..64 * 64).map(|i| if (12..52).contains(&(i % 64)) && (12..52).contains(&(i / 64)) { 0.5 } else { 0.0 });
/// let depth = DepthImage::from_meters(64, 64, depth.collect())?;
/// let mask = Mask::measured(&depth);
/// let observation = Observation::new(depth, mask, camera)?;
/// let init = Isometry3::translation(0.0, 0.0, 0.54);
///
/// let refined = Refiner::preset(Preset::Auto).refine(&model, &observation, &init);
/// assert!((refined.outcome.camera_from_object.translation.z - 0.5).abs() < 1e-4);
/// assert!(refined.mve < refined.mve_initial);
///
/// // Many poses on all cores, with the bits of one thread.
/// let items = [(&model, &observation, init); 8];
/// let all = refine_batch(&items, None, || Refiner::preset(Preset::Auto));
/// assert_eq!(all, [refined; 8]);
/// # Ok(()) }
/// ```
pub struct Refiner<S = BoxedStage> {
    stage: S,
    workspace: Workspace,
    score: MeanVsd,
    look_alikes: LookAlikeCount<SampledMve, MeanVsd>,
    /// Measures the pairs of a pose that no registration evaluated.
    registration: presets::Fit,
}

/// Runs the default preset, [`Preset::Auto`].
impl Default for Refiner {
    fn default() -> Self {
        Self::preset(Preset::default())
    }
}

impl Refiner {
    /// Creates a refiner that runs a preset.
    #[must_use]
    pub fn preset(preset: Preset) -> Self {
        Self::new(preset.build())
    }

    /// Creates a refiner that runs a stage behind a box, so that its type does not name the stage.
    #[must_use]
    pub fn boxed(stage: impl Stage + Send + 'static) -> Self {
        Self::new(Box::new(stage))
    }
}

impl<S: Stage> Refiner<S> {
    /// Creates a refiner that runs `stage`.
    #[must_use]
    pub fn new(stage: S) -> Self {
        Self::with_renderer(stage, Rasterizer::default())
    }

    /// Creates a refiner that runs `stage` and renders with `renderer`.
    #[must_use]
    pub fn with_renderer(stage: S, renderer: impl Renderer + Send + 'static) -> Self {
        Self {
            stage,
            workspace: Workspace::new(renderer),
            score: MeanVsd::default(),
            look_alikes: presets::look_alikes(),
            registration: presets::fit_of(1),
        }
    }

    /// Returns the stage.
    pub fn stage(&self) -> &S {
        &self.stage
    }

    /// Returns the stage, to change it between refinements.
    pub fn stage_mut(&mut self) -> &mut S {
        &mut self.stage
    }

    /// Returns the stage and drops the scratch memory.
    pub fn into_stage(self) -> S {
        self.stage
    }

    /// Refines a pose (`camera_from_object`, meters).
    ///
    /// Never fails on data: without overlap, or with degenerate geometry, the outcome has the
    /// initial pose and states the reason. Deterministic, unless the stage has a time limit.
    ///
    /// Cost: that of the pipeline, the scores of the initial and the returned pose, and the count
    /// of look-alikes ([`LookAlikeCount::at`](hicp_icp::LookAlikeCount::at)). If no stage evaluated
    /// the returned pose, one iteration of the refiner's own fit is added.
    pub fn refine(
        &mut self,
        model: &Model,
        observation: &Observation,
        init: &Isometry3<f64>,
    ) -> Refinement {
        self.refine_observed(model, observation, init, &mut ())
    }

    /// Refines a pose and reports every step to an observer.
    pub fn refine_observed(
        &mut self,
        model: &Model,
        observation: &Observation,
        init: &Isometry3<f64>,
        observer: &mut dyn Observer,
    ) -> Refinement {
        let problem = Problem::new(model, observation);
        let mve_initial = self.mve(model, observation, init);
        self.workspace.alternatives_mut().clear();
        let outcome = self.stage.run(
            &problem,
            init,
            &mut Session::new(&mut self.workspace, observer),
        );
        self.judged(&problem, Some((init, mve_initial)), outcome)
    }

    /// Finds the pose of a segmented object (`camera_from_object`, meters) without an initial pose.
    ///
    /// A [`HypothesisSearch`](hicp_icp::HypothesisSearch) ranks rotations of SO(3), placed at the
    /// observed points, and fits the best of them. This refiner's stage then refines what is found.
    /// `mve_initial` equals `mve`, because there is no initial pose.
    ///
    /// Never fails on data: if no surface was measured inside the mask, the outcome keeps the
    /// identity and states the reason. Deterministic. Cost: that of a `search` that does not end at
    /// once, some tens of milliseconds on one core; the search allocates its list of hypotheses.
    ///
    /// ```
    /// # use hybrid_icp::core::{DepthImage, Mask, Model, Observation, PinholeCamera, Point3, TriMesh};
    /// use hybrid_icp::{Preset, Refiner};
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// # let camera = PinholeCamera::new(100.0, 100.0, 31.5, 31.5, 64, 64)?;
    /// # let corners = [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]].map(|[x, y]| Point3::new(x, y, 0.0));
    /// # let model = Model::new(TriMesh::new(corners.to_vec(), vec![[0, 2, 1], [0, 3, 2]])?);
    /// # let depth = (0..64 * 64).map(|i| if (12..52).contains(&(i % 64)) && (12..52).contains(&(i / 64)) { 0.5 } else { 0.0 });
    /// # let depth = DepthImage::from_meters(64, 64, depth.collect())?;
    /// # let mask = Mask::measured(&depth);
    /// let observation = Observation::new(depth, mask, camera)?;
    /// let found = Refiner::preset(Preset::Local).estimate(&model, &observation);
    /// assert!((found.outcome.camera_from_object.translation.z - 0.5).abs() < 1e-3);
    /// assert!(found.mve < 0.1);
    /// # Ok(()) }
    /// ```
    pub fn estimate(&mut self, model: &Model, observation: &Observation) -> Refinement {
        self.estimate_observed(model, observation, &mut ())
    }

    /// Finds a pose as [`Self::estimate`] does, and reports every step to an observer.
    pub fn estimate_observed(
        &mut self,
        model: &Model,
        observation: &Observation,
        observer: &mut dyn Observer,
    ) -> Refinement {
        let problem = Problem::new(model, observation);
        let mut search = presets::by_color(presets::estimate_with(&mut self.stage));
        self.workspace.alternatives_mut().clear();
        let outcome = search.run(
            &problem,
            &Isometry3::identity(),
            &mut Session::new(&mut self.workspace, observer),
        );
        self.judged(&problem, None, outcome)
    }

    /// Judges a pose as it is, for example a fused one or that of another library.
    ///
    /// Nothing is assumed about the way in which it was found: a pose that looks like it lowers the
    /// confidence as much as after [`Self::estimate`]. The outcome states that the pose was kept.
    /// Cost: one render, the scores of a refinement, and the pairs at the pose. If other poses look
    /// like it, also their renders.
    pub fn judge(
        &mut self,
        model: &Model,
        observation: &Observation,
        camera_from_object: &Isometry3<f64>,
    ) -> Refinement {
        let problem = Problem::new(model, observation);
        self.workspace.alternatives_mut().clear();
        let outcome = Outcome::kept(camera_from_object, Termination::Kept);
        self.judged(&problem, None, outcome)
    }

    /// Scores the pose of an outcome.
    fn judged(
        &mut self,
        problem: &Problem<'_>,
        start: Option<(&Isometry3<f64>, f64)>,
        outcome: Outcome,
    ) -> Refinement {
        let outcome = self.measured(problem, outcome);
        let pose = &outcome.camera_from_object;
        let near = start.zip(problem.model());
        let near = near.is_some_and(|((init, _), model)| is_near(model, init, pose));
        let mut look_alikes = if near {
            0.0
        } else {
            self.look_alikes(problem, pose)
        };
        let mut context = self.workspace.context(problem);
        let mve = self.score.score(&mut context, pose);
        let (evidence, mut confidence) = Confidence::at(&mut context, pose, mve, look_alikes);
        let flatness = Flatness::at(&mut context, pose);
        if near && let Some((model, observation)) = problem.sides() {
            // In the full image, their renders would take longer than a refinement.
            let factor = (observation.n_measured() / COARSE_PIXELS).isqrt();
            let factor = u32::try_from(factor).unwrap_or(u32::MAX);
            let coarse = (factor > 1).then(|| observation.decimated(factor));
            let coarse = coarse.as_deref().unwrap_or(observation);
            look_alikes = self.look_alikes(&Problem::new(model, coarse), pose);
            confidence = confidence.near_initial(look_alikes);
        }
        Refinement {
            outcome,
            mve_initial: start.map_or(mve, |(_, mve)| mve),
            mve,
            confidence: confidence.probability,
            expected_error_meters: confidence.error_meters,
            expected_error_degrees: confidence.error_degrees,
            flatness,
            evidence,
            look_alikes,
            runner_up: self.workspace.alternatives().first().copied(),
        }
    }

    /// Measures the pairs at the pose of an outcome that no registration evaluated, for example one
    /// that a search scored and kept.
    fn measured(&mut self, problem: &Problem<'_>, mut outcome: Outcome) -> Outcome {
        let nothing = matches!(
            outcome.termination,
            Termination::NoPairs | Termination::Unsupported(_)
        );
        if outcome.evaluation.is_none() && !nothing {
            let (pose, observer) = (&outcome.camera_from_object, &mut ());
            let mut session = Session::new(&mut self.workspace, observer);
            let at_pose = self.registration.run(problem, pose, &mut session);
            (outcome.evaluation, outcome.quality) = (at_pose.evaluation, at_pose.quality);
        }
        outcome
    }

    /// Returns the number of other poses that explain the image as well as `pose`.
    ///
    /// If colors were compared, they decide among the poses that look alike in depth.
    fn look_alikes(&mut self, problem: &Problem<'_>, pose: &Isometry3<f64>) -> f64 {
        let others = self.workspace.alternatives();
        let found = others.first().map_or(0.0, Alternative::likelihood);
        if others.iter().any(|other| other.color_gap.is_some()) {
            return found;
        }
        found.max(
            self.look_alikes
                .at(&mut self.workspace.context(problem), pose),
        )
    }

    /// Returns the distinct other poses that the last run found, best first.
    ///
    /// Two poses are distinct if their MSSD, up to declared symmetries, is above a tenth of the
    /// diameter. Only a search or a choice by color finds other poses: the presets `search`, `auto`
    /// and `color`, and [`Self::estimate`].
    #[must_use]
    pub fn alternatives(&self) -> &[Alternative] {
        self.workspace.alternatives()
    }

    /// Returns the mean VSD estimate of a pose: 0 agrees with the image everywhere, 1 nowhere.
    pub fn mve(
        &mut self,
        model: &Model,
        observation: &Observation,
        camera_from_object: &Isometry3<f64>,
    ) -> f64 {
        let problem = Problem::new(model, observation);
        self.score
            .score(&mut self.workspace.context(&problem), camera_from_object)
    }

    /// Returns the scratch memory and render cache, for custom scores and renders.
    pub fn workspace_mut(&mut self) -> &mut Workspace {
        &mut self.workspace
    }
}

impl<S> std::fmt::Debug for Refiner<S> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Refiner")
            .field("workspace", &self.workspace)
            .finish_non_exhaustive()
    }
}

//! Sequential ICP: estimates fused while the camera moves (§V).

mod step;
mod undetermined;

use hicp_core::{Isometry3, Matrix6, Model, Observation, Problem};
use hicp_fusion::{
    BoxedFuser, CameraMotion, CovarianceModel, Fuser, FuserConfig, FusionError, FusionMethod, Gate,
    Gated, IntoFuser, MveCovariance, PoseEstimate, SharedError, SymmetryAware, UnitCovariance,
    Update,
};
use hicp_icp::{
    BoxedStage, Observer, Outcome, Quality, Session, Stage, Termination, Verdict, Workspace,
};
use hicp_raster::Rasterizer;
use hicp_score::{MeanVsd, Score};

use crate::calibration::Calibration;
use crate::sequential::undetermined::Undetermined;

pub use crate::sequential::step::{
    MotionCheck, SequentialConfig, SequentialEvent, SequentialStep, WithoutPairs,
};

// Deviation: window: §V fuses all estimates, so that each step takes longer than the one before.
// `SequentialEstimator::for_object` and `calibrated` fuse the newest 100,
// `SequentialEstimator::paper` all.
/// Number of the newest estimates that [`SequentialEstimator::for_object`] and
/// [`SequentialEstimator::calibrated`] fuse.
const WINDOW: usize = 100;

/// Difference in score up to which a registration from the initial pose is preferred to one from a
/// pose that failed the gate.
const PREFERRED: f64 = 0.02;

/// Estimates the pose of a static object from images along the path of a moving camera (§V).
///
/// Each image is registered from the pose fused so far, moved with the camera. The fuser receives
/// the result, and its estimate is the answer and the next initial pose (§V-A). If ICP finds no
/// pairs, nothing is fused ([`WithoutPairs`]). While all estimates have failed a gate, an image is
/// also registered from the initial pose, because the first image may show another object. The
/// estimator has no clock and starts no thread.
///
/// Cost of a step: the pipeline, and one render and one score if the MVE is computed. While all
/// estimates have failed, twice as much.
///
/// ```
/// use hybrid_icp::fusion::{CameraMotion, FusionMethod};
/// use hybrid_icp::core::{
///     DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, Point3, TriMesh,
/// };
/// use hybrid_icp::{SequentialEstimator, presets};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let camera = PinholeCamera::new(100.0, 100.0, 31.5, 31.5, 64, 64)?;
/// let plate = vec![
///     Point3::new(-0.1, -0.1, 0.0), Point3::new(0.1, -0.1, 0.0), Point3::new(0.1, 0.1, 0.0), Point3::new(-0.1, 0.1, 0.0),
/// ];
/// let model = Model::new(TriMesh::new(plate, vec![[0, 2, 1], [0, 3, 2]])?);
/// // The plate stands 60 cm in front of the camera, which advances by 2 cm per image; the detector is 3 cm off.
/// let init = Isometry3::translation(0.0, 0.0, 0.63);
/// let mut estimator = SequentialEstimator::for_object(presets::hybrid(), FusionMethod::Average, &model, &init)?;
/// let mut motion = CameraMotion::none();
/// for distance in [0.60_f32, 0.58, 0.56] {
///     let depth = hybrid_icp::raster::render_depth_image(
///         model.mesh(), &camera, &Isometry3::translation(0.0, 0.0, f64::from(distance)));
///     let mask = Mask::measured(&depth);
///     let step = estimator.step(&model, &Observation::new(depth, mask, camera)?, &motion);
///     assert!((step.camera_from_object.translation.z - f64::from(distance)).abs() < 1e-4);
///     motion = CameraMotion::new(Isometry3::translation(0.0, 0.0, -0.02))?;
/// }
/// # Ok(()) }
/// ```
pub struct SequentialEstimator {
    stage: BoxedStage,
    fuser: BoxedFuser,
    covariance: Box<Covariance>,
    score: Option<Box<dyn Score + Send>>,
    /// The directions that no image determined, if covariances account for them.
    undetermined: Option<Undetermined>,
    without_pairs: WithoutPairs,
    workspace: Workspace,
    /// The initial pose in the current camera frame.
    init: Isometry3<f64>,
    /// `true` if the fused pose failed a gate.
    provisional: bool,
}

/// The covariance of an estimate, from the outcome of its registration and its score.
type Covariance = dyn Fn(&Outcome, Option<f64>) -> Matrix6<f64> + Send;

impl SequentialEstimator {
    /// Creates an estimator from any stage and any fuser.
    ///
    /// `init` is the rough pose in the first camera frame.
    ///
    /// # Errors
    ///
    /// [`FusionError`] when the initial pose is not a rigid motion of sensible size.
    pub fn new(
        stage: impl Stage + Send + 'static,
        fuser: impl Fuser + Send + 'static,
        config: SequentialConfig,
        init: &Isometry3<f64>,
    ) -> Result<Self, FusionError> {
        let mut estimator = Self {
            stage: Box::new(stage),
            fuser: Box::new(fuser),
            covariance: Box::new(move |outcome, mve| of_model(&config.covariance, outcome, mve)),
            score: config.score.map(|score| Box::new(score) as _),
            undetermined: None,
            without_pairs: config.without_pairs,
            workspace: Workspace::new(Rasterizer::default()),
            init: *init,
            provisional: false,
        };
        estimator.restart(init)?;
        Ok(estimator)
    }

    /// Creates an estimator for an object.
    ///
    /// `fuser` is a [`FusionMethod`], or any [`Fuser`]. It receives estimates as follows:
    ///
    /// - The covariance of an estimate is its MVE times [`UnitCovariance::AboutObject`]. A rotation
    ///   by 1 rad around the object's center counts as a translation by its radius.
    /// - An estimate of a symmetric object is replaced by the equivalent pose nearest to the held
    ///   one ([`SymmetryAware`]).
    /// - A [`Gated`] rejects estimates with an MVE above 0.4. Until one passes, it holds the failed
    ///   one with the lowest MVE, and resets `fuser` to replace it.
    /// - Methods that keep estimates keep the newest 100, which bounds the cost of a step.
    ///
    /// # Errors
    ///
    /// [`FusionError`] as for [`SequentialEstimator::new`], or when the model's size is out of
    /// range.
    pub fn for_object(
        stage: impl Stage + Send + 'static,
        fuser: impl IntoFuser,
        model: &Model,
        init: &Isometry3<f64>,
    ) -> Result<Self, FusionError> {
        let unit = UnitCovariance::about_object(model.center(), model.radius())?;
        // Without calibrated covariances a Mahalanobis distance means nothing.
        let gate = Gate {
            max_mahalanobis_squared: None,
            ..Gate::default()
        };
        let gated = gated(fuser, unit, gate)?;
        let mve = MveCovariance {
            unit,
            ..MveCovariance::default()
        };
        Self::of_object(stage, gated, CovarianceModel::Mve(mve), model, init)
    }

    /// Creates an estimator for an object from the calibrated 6×6 covariance of its registration.
    ///
    /// It also uses the error that all estimates share, and a gate on the Mahalanobis distance. A
    /// direction that no image determines, for example the rotation of a mug whose handle is
    /// hidden, has at least a deviation of the object's radius. Otherwise as
    /// [`SequentialEstimator::for_object`].
    ///
    /// Cost of a step: one more fit that keeps the pose, and up to two scores for each direction of
    /// little information.
    ///
    /// # Errors
    ///
    /// [`FusionError`] as for [`SequentialEstimator::for_object`], or when a factor of the
    /// calibration is out of range.
    pub fn calibrated(
        stage: impl Stage + Send + 'static,
        fuser: impl IntoFuser,
        calibration: &Calibration,
        model: &Model,
        init: &Isometry3<f64>,
    ) -> Result<Self, FusionError> {
        let unit = UnitCovariance::about_object(model.center(), model.radius())?;
        let gated = gated(fuser, unit, calibration.gate)?;
        let fuser = SharedError::new(gated, unit, calibration.shared)?;
        let covariance = CovarianceModel::Inflated(calibration.covariance(unit));
        Ok(Self {
            undetermined: Some(Undetermined::new(model)),
            ..Self::of_object(stage, fuser, covariance, model, init)?
        })
    }

    fn of_object(
        stage: impl Stage + Send + 'static,
        fuser: impl Fuser + Send + 'static,
        covariance: CovarianceModel,
        model: &Model,
        init: &Isometry3<f64>,
    ) -> Result<Self, FusionError> {
        let symmetries = model.symmetries().clone();
        let fuser = SymmetryAware::new(fuser, symmetries, model.center(), model.radius())?;
        let config = SequentialConfig {
            covariance,
            ..SequentialConfig::default()
        };
        Self::new(stage, fuser, config, init)
    }

    /// Creates the estimator of §V to the letter.
    ///
    /// Covariances are e_MVE·I₆ and do not change when the camera moves. There is no gate. If ICP
    /// finds no pairs, its initial pose is fused. The MVE is computed only for the methods that
    /// need it.
    ///
    /// # Errors
    ///
    /// As for [`SequentialEstimator::new`].
    pub fn paper(
        stage: impl Stage + Send + 'static,
        method: FusionMethod,
        init: &Isometry3<f64>,
    ) -> Result<Self, FusionError> {
        let config = SequentialConfig {
            covariance: CovarianceModel::default(),
            score: method.uses_covariances().then(MeanVsd::paper),
            without_pairs: WithoutPairs::Initial,
        };
        Self::new(stage, method.build(FuserConfig::paper()), config, init)
    }

    /// Replaces the model of covariances by a function of a single estimate.
    ///
    /// It receives the outcome of the registration and the score, and returns the covariance of
    /// ξ = [ρ; φ] in the camera frame (left perturbation, meters and radians). It must be pure. A
    /// matrix that is not a covariance is reported as [`SequentialEvent::Refused`].
    ///
    /// ```
    /// use hybrid_icp::SequentialEstimator;
    /// use hybrid_icp::core::Matrix6;
    ///
    /// /// Variances of 1 mm² and 10⁻⁴ rad² over the share of paired points.
    /// fn by_fitness(estimator: SequentialEstimator) -> SequentialEstimator {
    ///     estimator.with_covariance(|outcome, _mve| {
    ///         let fitness = outcome.quality.map_or(0.01, |quality| quality.fitness.max(0.01));
    ///         let variance = |i: usize| if i < 3 { 1e-6 } else { 1e-4 };
    ///         Matrix6::from_fn(|i, j| if i == j { variance(i) / fitness } else { 0.0 })
    ///     })
    /// }
    /// ```
    #[must_use]
    pub fn with_covariance(
        mut self,
        covariance: impl Fn(&Outcome, Option<f64>) -> Matrix6<f64> + Send + 'static,
    ) -> Self {
        self.covariance = Box::new(covariance);
        self.undetermined = None;
        self
    }

    /// Replaces the score of each estimate, which gates and covariances use as the MVE.
    ///
    /// A score that is not between 0 and 1 is reported as [`SequentialEvent::Refused`].
    #[must_use]
    pub fn with_score(mut self, score: impl Score + Send + 'static) -> Self {
        self.score = Some(Box::new(score));
        self
    }

    /// Restarts from a rough pose in the current camera frame, and keeps the scratch memory.
    ///
    /// # Errors
    ///
    /// [`FusionError`] when it is not a rigid motion of sensible size.
    pub fn restart(&mut self, init: &Isometry3<f64>) -> Result<(), FusionError> {
        // The checks of an estimate are those of an initial pose.
        self.init = *PoseEstimate::new(*init, Matrix6::zeros())?.camera_from_object();
        self.fuser.reset();
        self.provisional = false;
        if let Some(undetermined) = &mut self.undetermined {
            undetermined.clear();
        }
        Ok(())
    }

    /// Moves the camera without an image: the pose is then stated in the new frame.
    pub fn move_camera(&mut self, motion: &CameraMotion) {
        self.fuser.propagate(motion);
        self.init = motion.apply(&self.init);
    }

    /// Returns the pose in the current camera frame: fused, or the initial one without an estimate.
    #[must_use]
    pub fn camera_from_object(&self) -> Isometry3<f64> {
        self.fuser
            .estimate()
            .map_or(self.init, |fused| *fused.camera_from_object())
    }

    /// Returns the fused estimate in the current camera frame, if there is one.
    ///
    /// Its covariance includes the directions that no image determines
    /// ([`SequentialEstimator::calibrated`]).
    #[must_use]
    pub fn estimate(&self) -> Option<PoseEstimate> {
        let fused = self.fuser.estimate()?;
        let Some(undetermined) = &self.undetermined else {
            return Some(fused);
        };
        let pose = fused.camera_from_object();
        let covariance = fused.covariance() + undetermined.of_fused(pose);
        let stated = PoseEstimate::new(*pose, covariance).ok()?;
        match fused.mve() {
            Some(mve) => stated.with_mve(mve).ok(),
            None => Some(stated),
        }
    }

    /// Returns the fuser. Its covariance leaves out the directions that no image determines.
    #[must_use]
    pub fn fuser(&self) -> &dyn Fuser {
        &*self.fuser
    }

    /// Registers an image of the object and fuses the result.
    ///
    /// `motion` is that of the camera since the image before, [`CameraMotion::none`] for the first.
    /// Never fails on data: [`SequentialStep::event`] reports what happened. Deterministic.
    pub fn step(
        &mut self,
        model: &Model,
        observation: &Observation,
        motion: &CameraMotion,
    ) -> SequentialStep {
        self.step_observed(model, observation, motion, &mut ())
    }

    /// Registers an image as [`SequentialEstimator::step`] does, and reports every step of ICP to
    /// an observer.
    pub fn step_observed(
        &mut self,
        model: &Model,
        observation: &Observation,
        motion: &CameraMotion,
        observer: &mut dyn Observer,
    ) -> SequentialStep {
        self.move_camera(motion);
        let mut init = self.camera_from_object();
        let problem = Problem::new(model, observation);
        let mut outcome = self.register(&problem, &init, observer);
        if self.provisional {
            // The failed image may have moved the pose away from a good initial one.
            let first = self.init;
            let again = self.register(&problem, &first, observer);
            let mut score = |outcome| self.score(&problem, outcome).unwrap_or(0.0);
            if score(&again) < score(&outcome) + PREFERRED {
                (init, outcome) = (first, again);
            }
        }
        let (mve, event) = self.take(&problem, &outcome);
        SequentialStep {
            camera_from_object: self.camera_from_object(),
            covariance: self.estimate().map(|fused| *fused.covariance()),
            init,
            outcome,
            mve,
            event,
        }
    }

    /// Registers an image from an initial pose.
    fn register(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        observer: &mut dyn Observer,
    ) -> Outcome {
        let mut session = Session::new(&mut self.workspace, observer);
        self.stage.run(problem, init, &mut session)
    }

    /// Returns the score of an outcome, if estimates are scored.
    fn score(&mut self, problem: &Problem<'_>, outcome: &Outcome) -> Option<f64> {
        let score = self.score.as_mut()?;
        let mut context = self.workspace.context(problem);
        Some(score.score(&mut context, &outcome.camera_from_object))
    }

    /// Passes an estimate to the fuser, and remembers the directions that it determines.
    fn fuse(&mut self, estimate: &PoseEstimate) -> Update {
        let update = self.fuser.update(estimate);
        if update.is_taken() {
            self.provisional = matches!(update, Update::Provisional(..));
        }
        if let Some(undetermined) = &mut self.undetermined {
            match update {
                Update::Accepted(_) => undetermined.fuse(false),
                Update::Restarted(..) => undetermined.fuse(true),
                _ => {}
            }
        }
        update
    }

    /// Scores the outcome of ICP and passes it to the fuser.
    fn take(&mut self, problem: &Problem<'_>, outcome: &Outcome) -> (Option<f64>, SequentialEvent) {
        // A guard keeps a good initial pose, and a search returns one, without pairs.
        let guarded = outcome.termination == Termination::ScoreNotImproved;
        let found = outcome.evaluation.is_some() || outcome.verdict == Verdict::Refined || guarded;
        if !found && self.without_pairs == WithoutPairs::Nothing {
            return (None, SequentialEvent::NoEstimate(outcome.termination));
        }
        let pose = &outcome.camera_from_object;
        let mve = self.score(problem, outcome);
        let workspace = &mut self.workspace;
        let mut outcome = *outcome;
        let mut open = Matrix6::zeros();
        if let (Some(undetermined), Some(score), Some(mve)) =
            (&mut self.undetermined, &mut self.score, mve)
        {
            let quality = undetermined.see(problem, pose, mve, (&mut **score, workspace));
            let known = outcome.quality.filter(|known| known.covariance().is_some());
            outcome.quality = known.or(quality);
            open = undetermined.of_latest(pose);
        }
        let covariance = (self.covariance)(&outcome, mve) + open;
        let estimate = PoseEstimate::new(*pose, covariance).and_then(|estimate| match mve {
            Some(mve) => estimate.with_mve(mve),
            None => Ok(estimate),
        });
        let event = match estimate {
            Ok(estimate) => SequentialEvent::Estimated(self.fuse(&estimate)),
            Err(error) => SequentialEvent::Refused(error),
        };
        (mve, event)
    }
}

/// Returns the covariance of an outcome by one of the models.
fn of_model(model: &CovarianceModel, outcome: &Outcome, mve: Option<f64>) -> Matrix6<f64> {
    let registration = match model {
        CovarianceModel::Inflated(_) => outcome.quality.as_ref().and_then(Quality::covariance),
        _ => None,
    };
    model.covariance(&outcome.camera_from_object, mve, registration.as_ref())
}

/// Puts a fuser behind the gate of an object.
fn gated(
    fuser: impl IntoFuser,
    unit: UnitCovariance,
    gate: Gate,
) -> Result<Gated<BoxedFuser>, FusionError> {
    let config = FuserConfig {
        unit,
        window: Some(WINDOW),
        ..FuserConfig::default()
    };
    Gated::new(fuser.into_fuser(config), gate)
}

impl std::fmt::Debug for SequentialEstimator {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SequentialEstimator")
            .field("fuser", &self.fuser.name())
            .field("without_pairs", &self.without_pairs)
            .field("init", &self.init)
            .finish_non_exhaustive()
    }
}

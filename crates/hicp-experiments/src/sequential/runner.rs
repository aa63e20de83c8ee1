//! One trajectory, travelled with every underlying pipeline, its images fused by every method.

use std::sync::OnceLock;

use hicp_core::{DepthImage, Isometry3, Mask, Matrix6, Model, Observation, PinholeCamera};
use hicp_sim::{CaseConfig, CaseMaker, InitialPose, stream};
use hybrid_icp::fusion::{CameraMotion, FusionError, LastEstimate, PoseEstimate, SymmetryAware};
use hybrid_icp::{SequentialEstimator, SequentialEvent, SequentialStep, render_depth_image};

use super::config::{TrajectoryClock, TrajectoryConfig};
use super::row::{TrajectoryRow, Travelled};
use super::rule::FusionRule;
use super::trajectory::Trajectory;
use crate::clock::thread_time;
use crate::config::distinct;
use crate::error::ExperimentError;
use crate::runner::add_or_adi;
use crate::subject::Subject;
use crate::variant::Variant;

/// The reconstruction of every object, made when first needed and shared by all threads.
pub(crate) struct Models {
    made: Vec<OnceLock<Result<Model, String>>>,
}

impl Models {
    pub(crate) fn new(objects: usize) -> Self {
        Self {
            made: (0..objects).map(|_| OnceLock::new()).collect(),
        }
    }

    fn model(
        &self,
        config: &TrajectoryConfig,
        subjects: &[Subject],
        object: usize,
    ) -> Result<&Model, String> {
        let made = self.made[object].get_or_init(|| {
            let subject = &subjects[object];
            let settings = config.reconstruction().map_err(|e| e.to_string())?;
            settings
                .reconstruct(&subject.model, &subject.name, config.seed)
                .map_err(|e| e.to_string())
        });
        made.as_ref().map_err(Clone::clone)
    }
}

/// Makes the rows of trajectories; one per thread.
pub(crate) struct TrajectoryRunner<'a> {
    config: &'a TrajectoryConfig,
    subjects: &'a [Subject],
    models: &'a Models,
    camera: PinholeCamera,
    scorer: CaseMaker,
    underlying: Vec<Variant>,
    rules: Vec<FusionRule>,
}

impl<'a> TrajectoryRunner<'a> {
    pub(crate) fn new(
        config: &'a TrajectoryConfig,
        subjects: &'a [Subject],
        models: &'a Models,
    ) -> Result<Self, ExperimentError> {
        let camera = config.pinhole()?;
        distinct("fusion method", config.methods.iter().map(String::as_str))?;
        let underlying = config.variants();
        for variant in &underlying {
            variant.build(None)?;
        }
        let rules = config.methods.iter().map(|name| {
            FusionRule::from_name(name).ok_or_else(|| ExperimentError::Names {
                what: "fusion method",
                name: name.clone(),
                found: "is not known",
                expected: FusionRule::EXPECTED,
            })
        });
        Ok(Self {
            config,
            subjects,
            models,
            camera,
            scorer: CaseMaker::new(CaseConfig::new(camera, InitialPose::mean_error()))?,
            rules: rules.collect::<Result<_, _>>()?,
            underlying,
        })
    }

    /// Makes the rows of a trajectory: underlying pipelines in order, in each the methods in order. All get the same path, the same
    /// start and the same model; by the clock of costs all methods of a pipeline get the same images.
    pub(crate) fn rows(&mut self, object: usize, index: u64) -> Vec<TrajectoryRow> {
        self.watched_rows(object, index, &mut |_| ())
    }

    /// Makes the rows of a trajectory, and shows every step on the way.
    fn watched_rows(
        &mut self,
        object: usize,
        index: u64,
        watch: &mut dyn FnMut(&TrajectoryStep<'_>),
    ) -> Vec<TrajectoryRow> {
        let subject = &self.subjects[object];
        let drawn = self
            .models
            .model(self.config, self.subjects, object)
            .and_then(|believed| {
                let (scorer, name) = (&mut self.scorer, &subject.name);
                Trajectory::draw(self.config, scorer, &subject.model, name, index)
                    .map(|trajectory| (trajectory, believed))
            });
        let mut rows = Vec::with_capacity(self.config.rows_per_trajectory());
        for underlying in 0..self.underlying.len() {
            let travelled = drawn.as_ref().map_err(Clone::clone).and_then(|drawn| {
                let journey = Journey {
                    object,
                    index,
                    underlying,
                    trajectory: &drawn.0,
                    believed: drawn.1,
                };
                self.travel(&journey, watch).map_err(|e| e.to_string())
            });
            for (method, name) in self.config.methods.iter().enumerate() {
                rows.push(TrajectoryRow {
                    object: subject.name.clone(),
                    trajectory: index,
                    bin: drawn.as_ref().ok().map(|(trajectory, _)| trajectory.bin),
                    underlying: self.underlying[underlying].name.clone(),
                    method: name.clone(),
                    measured: travelled.as_ref().ok().map(|all| all[method].clone()),
                    note: travelled.as_ref().err().cloned().unwrap_or_default(),
                });
            }
        }
        rows
    }

    /// Travels a trajectory; returns what each method made of it.
    fn travel(
        &mut self,
        journey: &Journey<'_>,
        watch: &mut dyn FnMut(&TrajectoryStep<'_>),
    ) -> Result<Vec<Travelled>, TravelError> {
        let mut travellers = Vec::new();
        for (method, rule) in self.rules.iter().enumerate() {
            let variant = &self.underlying[journey.underlying];
            let (believed, init) = (journey.believed, &journey.trajectory.init);
            travellers.push(Traveller {
                estimator: rule.estimator(variant.build(None)?, &variant.name, believed, init)?,
                method,
                n_estimates: 0,
            });
        }
        // By a real clock every method is elsewhere when the next image is taken.
        let together = match self.config.clock {
            TrajectoryClock::Cost => travellers.len(),
            TrajectoryClock::Real => 1,
        };
        let mut all = Vec::new();
        for group in travellers.chunks_mut(together.max(1)) {
            let truth = self.go(journey, group, watch)?;
            all.extend(group.iter().map(|one| self.judge(journey, one, &truth)));
        }
        all.into_iter().collect()
    }

    /// Takes some estimators along the path on the same images; returns the true pose where it ends.
    fn go(
        &self,
        journey: &Journey<'_>,
        group: &mut [Traveller],
        watch: &mut dyn FnMut(&TrajectoryStep<'_>),
    ) -> Result<Isometry3<f64>, TravelError> {
        let (config, trajectory) = (self.config, journey.trajectory);
        let last = config.n_images(journey.underlying) - 1;
        let mut truth = trajectory.camera_from_object;
        let mut motion = CameraMotion::none();
        let mut travelled = 0.0;
        for image in 0.. {
            truth = motion.apply(&truth);
            let (depth, mask) = self.take_image(journey, image, &truth)?;
            let start = thread_time();
            let observation = Observation::new(depth, mask, self.camera)?;
            let mut began = start;
            for one in &mut *group {
                let step = one.estimator.step(journey.believed, &observation, &motion);
                let ended = thread_time();
                one.n_estimates += usize::from(matches!(step.event, SequentialEvent::Estimated(_)));
                watch(&TrajectoryStep {
                    object: &self.subjects[journey.object],
                    trajectory: journey.index,
                    underlying: &self.underlying[journey.underlying].name,
                    method: &config.methods[one.method],
                    image,
                    camera_from_object: truth,
                    believed: journey.believed,
                    step: &step,
                });
                began = ended;
            }
            let meters = match config.clock {
                TrajectoryClock::Cost if image == last as u64 => f64::INFINITY,
                TrajectoryClock::Cost => config.step_m(journey.underlying),
                TrajectoryClock::Real => {
                    config.speed_m_s * began.saturating_sub(start).as_secs_f64()
                }
            };
            if travelled + meters > config.path_m + 1e-9 {
                break;
            }
            motion = CameraMotion::new(trajectory.motion(meters))?;
            travelled += meters;
        }
        // All are judged from where the path ends.
        let rest = CameraMotion::new(trajectory.motion(config.path_m - travelled))?;
        for one in group {
            one.estimator.move_camera(&rest);
        }
        Ok(rest.apply(&truth))
    }

    /// What the camera sees, with a perfect mask.
    fn take_image(
        &self,
        journey: &Journey<'_>,
        image: u64,
        truth: &Isometry3<f64>,
    ) -> Result<(DepthImage, Mask), TravelError> {
        let subject = &self.subjects[journey.object];
        let depth = render_depth_image(subject.model.mesh(), &self.camera, truth);
        let seen = depth.pixels().iter().map(|z| *z > 0.0).collect();
        let mask = Mask::new(self.camera.width(), self.camera.height(), seen)?;
        let labels = [
            subject.name.as_str(),
            &self.underlying[journey.underlying].name,
            "trajectory sensor",
        ];
        let mut rng = stream(self.config.seed, &labels, (journey.index << 20) + image);
        Ok((self.config.depth_noise().apply(&mut rng, &depth), mask))
    }

    fn judge(
        &mut self,
        journey: &Journey<'_>,
        one: &Traveller,
        truth: &Isometry3<f64>,
    ) -> Result<Travelled, TravelError> {
        let model = &self.subjects[journey.object].model;
        let pose = one.estimator.camera_from_object();
        let mut mahalanobis_squared = None;
        if let Some(fused) = one.estimator.estimate()
            && model.symmetries().continuous.is_empty()
        {
            let nearest = nearest_truth(model, truth, &pose)?;
            let exact = PoseEstimate::new(nearest, Matrix6::zeros())?;
            mahalanobis_squared = Some(exact.mahalanobis_squared(&fused));
        }
        Ok(Travelled {
            vsd_initial: journey.trajectory.vsd_initial,
            vsd_final: self.scorer.vsd(model, truth, &pose),
            add_final_mm: 1e3 * add_or_adi(model, &pose, truth),
            n_estimates: one.n_estimates,
            mahalanobis_squared,
        })
    }
}

/// Of the true poses that look the same, the one nearest to a pose.
pub(crate) fn nearest_truth(
    model: &Model,
    truth: &Isometry3<f64>,
    pose: &Isometry3<f64>,
) -> Result<Isometry3<f64>, FusionError> {
    let (center, radius) = (model.center(), model.radius());
    let inner = LastEstimate::default();
    let symmetric = SymmetryAware::new(inner, model.symmetries().clone(), center, radius)?;
    Ok(symmetric.representative(truth, pose))
}

/// One trajectory with one underlying pipeline.
struct Journey<'a> {
    object: usize,
    index: u64,
    underlying: usize,
    trajectory: &'a Trajectory,
    believed: &'a Model,
}

/// A method on its way.
struct Traveller {
    estimator: SequentialEstimator,
    method: usize,
    n_estimates: usize,
}

/// What a method made of one image of a trajectory.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct TrajectoryStep<'a> {
    /// The object.
    pub object: &'a Subject,
    /// Index of the trajectory among those of its object.
    pub trajectory: u64,
    /// Name of the underlying pipeline.
    pub underlying: &'a str,
    /// Name of the method.
    pub method: &'a str,
    /// Index of the image.
    pub image: u64,
    /// The true pose in the frame of this image; of an object with symmetries, one of them.
    pub camera_from_object: Isometry3<f64>,
    /// The model that was registered: a reconstruction.
    pub believed: &'a Model,
    /// What came out.
    pub step: &'a SequentialStep,
}

impl TrajectoryStep<'_> {
    /// Returns the true pose that is nearest to a pose, of those that look the same.
    ///
    /// # Errors
    ///
    /// [`FusionError`] when the object's size is out of range.
    pub fn nearest_truth(&self, pose: &Isometry3<f64>) -> Result<Isometry3<f64>, FusionError> {
        nearest_truth(&self.object.model, &self.camera_from_object, pose)
    }
}

/// Travels one trajectory of every object and shows each step of every pipeline and method: for figures that the rows do not hold.
///
/// # Errors
///
/// [`ExperimentError`] when a pipeline cannot be built or a method is not known. A trajectory that cannot be made shows nothing.
pub fn watch_trajectories(
    config: &TrajectoryConfig,
    subjects: &[Subject],
    trajectories: std::ops::Range<u64>,
    watch: &mut dyn FnMut(&TrajectoryStep<'_>),
) -> Result<(), ExperimentError> {
    let models = Models::new(subjects.len());
    let mut runner = TrajectoryRunner::new(config, subjects, &models)?;
    for index in trajectories {
        for object in 0..subjects.len() {
            runner.watched_rows(object, index, watch);
        }
    }
    Ok(())
}

/// What keeps a trajectory from being travelled.
#[derive(Debug, thiserror::Error)]
enum TravelError {
    #[error(transparent)]
    Fusion(#[from] FusionError),
    #[error(transparent)]
    Image(#[from] hicp_core::ImageError),
    #[error(transparent)]
    Experiment(#[from] ExperimentError),
}

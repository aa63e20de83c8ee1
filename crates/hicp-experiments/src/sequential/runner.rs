//! The evaluation of a trajectory: every underlying pipeline, every fusion method.

use std::error::Error;
use std::ops::Range;

use hicp_core::{DepthImage, Isometry3, Mask, Matrix6, Model, Observation};
use hicp_sim::{CaseConfig, CaseMaker, InitialPose, stream};
use hybrid_icp::fusion::{CameraMotion, PoseEstimate};
use hybrid_icp::raster::render_depth_image;
use hybrid_icp::{SequentialEstimator, SequentialEvent};

use super::config::{TrajectoryClock, TrajectoryConfig};
use super::rule::FusionRule;
use super::step::{TrajectoryStep, nearest_truth};
use super::trajectory::Trajectory;
use crate::clock::thread_time;
use crate::error::ExperimentError;
use crate::study::{Design, Fields, Measured, Models, Outcome};
use crate::subject::Subject;
use crate::variant::Variant;

type Failed = Box<dyn Error>;
type Watch<'w> = &'w mut dyn FnMut(&TrajectoryStep<'_>);

/// Evaluates trajectories. Each thread has one.
pub(super) struct TrajectoryRunner<'a> {
    config: &'a TrajectoryConfig,
    subjects: &'a [Subject],
    models: &'a Models,
    scorer: CaseMaker,
    underlying: Vec<Variant>,
    rules: Vec<FusionRule>,
}

/// One trajectory with one underlying pipeline.
struct Journey<'a> {
    object: usize,
    index: u64,
    underlying: usize,
    trajectory: &'a Trajectory,
    believed: &'a Model,
}

/// The state of a method along a trajectory.
struct Traveler {
    estimator: SequentialEstimator,
    n_estimates: usize,
    /// `true` if each of its estimates takes the time of an MVE, too.
    with_mve: bool,
}

/// Runs trajectories of every object, and calls `watch` with each step of every method.
///
/// It gives access to figures that the rows do not contain. `trajectories` are the indices per
/// object.
///
/// # Errors
///
/// [`ExperimentError`] when the configuration is invalid or a pipeline cannot be built. A
/// trajectory that cannot be created has no steps.
pub fn watch_trajectories(
    config: &TrajectoryConfig,
    subjects: &[Subject],
    trajectories: Range<u64>,
    watch: &mut dyn FnMut(&TrajectoryStep<'_>),
) -> Result<(), ExperimentError> {
    config.check(&Fields::new(config))?;
    let models = Models::new(subjects.len());
    let mut runner = TrajectoryRunner::new(config, subjects, &models)?;
    for index in trajectories {
        for object in 0..subjects.len() {
            runner.outcomes(object, index, watch);
        }
    }
    Ok(())
}

impl<'a> TrajectoryRunner<'a> {
    pub(super) fn new(
        config: &'a TrajectoryConfig,
        subjects: &'a [Subject],
        models: &'a Models,
    ) -> Result<Self, ExperimentError> {
        let underlying: Vec<Variant> = config.underlying.iter().map(|u| u.variant()).collect();
        for variant in &underlying {
            variant.build(None)?;
        }
        // Unknown methods were refused with the configuration.
        let rules = config.methods.iter().map(String::as_str);
        let rules = rules.filter_map(FusionRule::from_name);
        Ok(Self {
            config,
            subjects,
            models,
            scorer: CaseMaker::new(CaseConfig::new(config.camera, InitialPose::mean_error()))?,
            rules: rules.collect(),
            underlying,
        })
    }

    /// Evaluates a trajectory. The outcomes are ordered by underlying pipeline, then by method.
    ///
    /// All get the same path, the same start and the same model. With the clock of costs, all
    /// methods of a pipeline whose estimates take as long get the same images. `watch` is called
    /// with every step.
    pub(super) fn outcomes(&mut self, object: usize, index: u64, watch: Watch<'_>) -> Vec<Outcome> {
        let drawn = self.draw(object, index);
        let mut outcomes = Vec::new();
        for underlying in 0..self.underlying.len() {
            let drawn = drawn.as_ref().map_err(Clone::clone);
            let traveled = drawn.and_then(|(trajectory, believed)| {
                let journey = Journey {
                    object,
                    index,
                    underlying,
                    trajectory,
                    believed,
                };
                self.travel(&journey, watch).map_err(|e| e.to_string())
            });
            match traveled {
                Ok(all) => outcomes.extend(all.into_iter().map(Ok)),
                Err(error) => outcomes.extend(vec![Err(error); self.rules.len()]),
            }
        }
        outcomes
    }

    /// Draws a trajectory, and reconstructs the model.
    fn draw(&mut self, object: usize, index: u64) -> Result<(Trajectory, &'a Model), String> {
        let (config, subject) = (self.config, &self.subjects[object]);
        let (model, name) = (&subject.model, &subject.name);
        let reconstruct = || {
            Ok(config
                .reconstruction()
                .reconstruct(model, name, config.seed)?)
        };
        let believed = self.models.get(object, 0, reconstruct)?;
        let trajectory = Trajectory::draw(config, &mut self.scorer, model, name, index)?;
        Ok((trajectory, believed))
    }

    /// Runs a trajectory with one underlying pipeline. Returns the figures of each method.
    fn travel(&mut self, journey: &Journey<'_>, watch: Watch<'_>) -> Result<Vec<Measured>, Failed> {
        let (config, variant) = (self.config, &self.underlying[journey.underlying]);
        let plain = (config.covariance, config.without_pairs);
        let has_costly_mve = config.underlying[journey.underlying].seconds_per_mve > 0.0;
        let mut travelers = Vec::new();
        for rule in &self.rules {
            let underlying = (&*variant.name, variant.build(None)?);
            let init = &journey.trajectory.start.init;
            travelers.push(Traveler {
                estimator: rule.estimator(plain, underlying, journey.believed, init)?,
                n_estimates: 0,
                with_mve: has_costly_mve && rule.uses_mve(),
            });
        }
        let mut groups: Vec<Vec<&mut Traveler>> = Vec::new();
        for one in &mut travelers {
            // With the real clock, every method takes its images from different places.
            let is_shared = config.clock == TrajectoryClock::Cost;
            let group = groups
                .iter_mut()
                .find(|group| group[0].with_mve == one.with_mve);
            match group.filter(|_| is_shared) {
                Some(group) => group.push(one),
                None => groups.push(vec![one]),
            }
        }
        let mut truth = journey.trajectory.start.truth;
        for group in &mut groups {
            truth = self.go(journey, group, watch)?;
        }
        let judged = travelers.iter().map(|one| self.judge(journey, one, &truth));
        judged.collect()
    }

    /// Moves some estimators along the path over the same images.
    ///
    /// Returns the true pose at the end of the path.
    fn go(
        &self,
        journey: &Journey<'_>,
        group: &mut [&mut Traveler],
        watch: Watch<'_>,
    ) -> Result<Isometry3<f64>, Failed> {
        let (config, trajectory) = (self.config, journey.trajectory);
        let with_mve = group.first().is_some_and(|one| one.with_mve);
        let last = config.n_images(journey.underlying, with_mve) - 1;
        let seconds = config.seconds(journey.underlying, with_mve);
        let mut truth = trajectory.start.truth;
        let mut motion = CameraMotion::none();
        let mut traveled = 0.0;
        for image in 0.. {
            truth = motion.apply(&truth);
            let (depth, mask) = self.take_image(journey, image, &truth)?;
            let start = thread_time();
            let observation = Observation::new(depth, mask, config.camera)?;
            let mut end = start;
            for one in &mut *group {
                let step = one.estimator.step(journey.believed, &observation, &motion);
                end = thread_time();
                one.n_estimates += usize::from(matches!(step.event, SequentialEvent::Estimated(_)));
                watch(&TrajectoryStep {
                    object: &self.subjects[journey.object],
                    trajectory: journey.index,
                    camera_from_object: truth,
                    believed: journey.believed,
                    step: &step,
                });
            }
            let meters = match config.clock {
                TrajectoryClock::Cost if image == last as u64 => f64::INFINITY,
                TrajectoryClock::Cost => config.speed_m_s * seconds,
                TrajectoryClock::Real => config.speed_m_s * end.saturating_sub(start).as_secs_f64(),
            };
            if traveled + meters > config.path_m + 1e-9 {
                break;
            }
            motion = CameraMotion::new(trajectory.motion(meters))?;
            traveled += meters;
        }
        // All methods are judged at the end of the path.
        let rest = CameraMotion::new(trajectory.motion(config.path_m - traveled))?;
        for one in group {
            one.estimator.move_camera(&rest);
        }
        Ok(rest.apply(&truth))
    }

    /// Returns the depth image with noise, and a perfect mask.
    fn take_image(
        &self,
        journey: &Journey<'_>,
        image: u64,
        truth: &Isometry3<f64>,
    ) -> Result<(DepthImage, Mask), Failed> {
        let subject = &self.subjects[journey.object];
        let depth = render_depth_image(subject.model.mesh(), &self.config.camera, truth);
        let mask = Mask::measured(&depth);
        let underlying = &self.underlying[journey.underlying].name;
        let labels = [&subject.name, underlying, "trajectory sensor"];
        let mut rng = stream(self.config.seed, &labels, (journey.index << 20) + image);
        let noise = TrajectoryConfig::noise(&self.config.depth_noise);
        Ok((noise.apply(&mut rng, &depth), mask))
    }

    fn judge(
        &mut self,
        journey: &Journey<'_>,
        one: &Traveler,
        truth: &Isometry3<f64>,
    ) -> Result<Measured, Failed> {
        let subject = &self.subjects[journey.object];
        let (model, pose) = (&subject.model, one.estimator.camera_from_object());
        let mut measured = Measured {
            vsd_initial: journey.trajectory.start.vsd,
            vsd_final: self.scorer.vsd(model, truth, &pose),
            add_final_mm: subject.add_or_adi_mm(&pose, truth),
            steps: one.n_estimates,
            ..Measured::default()
        };
        if let Some(fused) = one.estimator.estimate()
            && model.symmetries().continuous.is_empty()
        {
            let nearest = nearest_truth(model, truth, &pose);
            let exact = PoseEstimate::new(nearest, Matrix6::zeros())?;
            measured.mahalanobis_squared = Some(exact.mahalanobis_squared(&fused));
        }
        Ok(measured)
    }
}

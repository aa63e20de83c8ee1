//! One trajectory, travelled with every underlying pipeline, its images fused by every method.

use std::sync::OnceLock;

use hicp_core::{Mask, Model, Observation, PinholeCamera};
use hicp_sim::{CaseConfig, CaseMaker, InitialPose, stream};
use hybrid_icp::fusion::{CameraMotion, FusionError};
use hybrid_icp::{BoxedStage, SequentialEstimator, SequentialEvent, render_depth_image};

use super::config::TrajectoryConfig;
use super::row::{TrajectoryRow, Travelled};
use super::rule::FusionRule;
use super::trajectory::Trajectory;
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
        let underlying = config.variants();
        for variant in &underlying {
            variant.build(None)?;
        }
        let rules = config.methods.iter().map(|name| {
            FusionRule::from_name(name).ok_or_else(|| ExperimentError::Names {
                what: "fusion method",
                name: name.clone(),
                found: "is not known",
                expected: "a method of the paper, or gated-average, gated-weighted-average",
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
    /// start and the same model; all methods of a pipeline get the same images.
    pub(crate) fn rows(&mut self, object: usize, index: u64) -> Vec<TrajectoryRow> {
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
                self.travel(object, index, underlying, &drawn.0, drawn.1)
                    .map_err(|e| e.to_string())
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
        object: usize,
        index: u64,
        underlying: usize,
        trajectory: &Trajectory,
        believed: &Model,
    ) -> Result<Vec<Travelled>, TravelError> {
        let (config, subject) = (self.config, &self.subjects[object]);
        let mut estimators: Vec<(SequentialEstimator, usize)> = Vec::new();
        for rule in &self.rules {
            let stage: BoxedStage = self.underlying[underlying].build(None)?;
            estimators.push((rule.estimator(stage, believed, &trajectory.init)?, 0));
        }
        let step = config.step_m(underlying);
        let advance = CameraMotion::new(trajectory.motion(step))?;
        let mut truth = trajectory.camera_from_object;
        for image in 0..config.n_images(underlying) {
            let motion = if image == 0 {
                CameraMotion::none()
            } else {
                advance
            };
            truth = motion.apply(&truth);
            let depth = render_depth_image(subject.model.mesh(), &self.camera, &truth);
            let seen = depth.pixels().iter().map(|z| *z > 0.0).collect();
            let mask = Mask::new(self.camera.width(), self.camera.height(), seen)?;
            let labels = [
                subject.name.as_str(),
                &self.underlying[underlying].name,
                "trajectory sensor",
            ];
            let mut rng = stream(config.seed, &labels, (index << 20) + image as u64);
            let depth = config.depth_noise().apply(&mut rng, &depth);
            let observation = Observation::new(depth, mask, self.camera)?;
            for (estimator, n_estimates) in &mut estimators {
                let taken = estimator.step(believed, &observation, &motion);
                *n_estimates += usize::from(matches!(taken.event, SequentialEvent::Estimated(_)));
            }
        }
        // All are judged from where the path ends.
        let travelled = (config.n_images(underlying) - 1) as f64 * step;
        let rest = CameraMotion::new(trajectory.motion(config.path_m - travelled))?;
        let truth = rest.apply(&truth);
        let scorer = &mut self.scorer;
        let judged = estimators.iter_mut().map(|(estimator, n_estimates)| {
            estimator.move_camera(&rest);
            let pose = estimator.camera_from_object();
            Travelled {
                vsd_initial: trajectory.vsd_initial,
                vsd_final: scorer.vsd(&subject.model, &truth, &pose),
                add_final_mm: 1e3 * add_or_adi(&subject.model, &pose, &truth),
                n_estimates: *n_estimates,
            }
        });
        Ok(judged.collect())
    }
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

//! The evaluation of a case: every condition, every variant.

use std::sync::Arc;

use hicp_core::{DepthImage, Isometry3, Mask, Model, Observation, Problem};
use hicp_sim::{Case, CaseMaker, Reconstruction, ReconstructionNoise};
use hybrid_icp::BoxedStage;
use hybrid_icp::icp::{Observer, RegimeEvent, Session, Workspace};
use hybrid_icp::raster::Rasterizer;

use super::config::Config;
use crate::clock::thread_time;
use crate::error::ExperimentError;
use crate::study::{Measured, Models, Outcome};
use crate::subject::Subject;

/// More renders than the cache of a workspace holds.
const FORGET: u32 = 8;

/// Evaluates cases. Each thread has one.
pub(super) struct Runner<'a> {
    config: &'a Config,
    subjects: &'a [Subject],
    models: &'a Models,
    /// The first creates fixed initial poses, 6.2 mm and 9.5° off; the second creates binned ones.
    makers: [CaseMaker; 2],
    /// By level, then by variant. There is only one level unless levels change the pipelines.
    stages: Vec<Vec<BoxedStage>>,
    /// By variant.
    workspaces: Vec<Workspace>,
    forgotten: u32,
}

/// A case under a condition.
struct Presented<'a> {
    subject: &'a Subject,
    case: &'a Case,
    depth: Arc<DepthImage>,
    mask: Mask,
    /// The model that is registered.
    model: &'a Model,
}

/// The first letters of the chosen regimes.
#[derive(Default)]
struct Regimes(String);

impl Observer for Regimes {
    fn on_regime(&mut self, event: &RegimeEvent) {
        self.0.extend(event.regime.name().chars().next());
    }
}

impl<'a> Runner<'a> {
    pub(super) fn new(
        config: &'a Config,
        subjects: &'a [Subject],
        models: &'a Models,
    ) -> Result<Self, ExperimentError> {
        let maker = |binned| CaseMaker::new(config.cases(binned));
        let build = |alpha| config.variants.iter().map(|v| v.build(alpha)).collect();
        let alphas = config.experiment.alphas(config.levels.len()).into_iter();
        let workspace = |_| Workspace::new(Rasterizer::default());
        Ok(Self {
            config,
            subjects,
            models,
            makers: [maker(false)?, maker(true)?],
            stages: alphas.map(build).collect::<Result<_, _>>()?,
            workspaces: config.variants.iter().map(workspace).collect(),
            forgotten: 0,
        })
    }

    /// Evaluates a case. The outcomes are ordered by level, then by variant.
    ///
    /// All variants get the same image and the same initial pose.
    pub(super) fn outcomes(&mut self, object: usize, index: u64) -> Vec<Outcome> {
        let (config, subject) = (self.config, &self.subjects[object]);
        let mut cases: [Option<Result<Case, String>>; 2] = [None, None];
        let mut outcomes = Vec::new();
        for level in 0..config.levels.len() {
            let condition = config.experiment.condition(level, index);
            let start = usize::from(condition.binned);
            let case = cases[start].get_or_insert_with(|| {
                let maker = &mut self.makers[start];
                let case = maker.case(&subject.model, &subject.name, config.seed, index);
                case.map_err(|e| e.to_string())
            });
            let presented = case.as_ref().map_err(Clone::clone).and_then(|case| {
                let seen = condition.corruption.apply(case);
                let (depth, mask) = seen.map_err(|e| e.to_string())?;
                Ok(Presented {
                    subject,
                    case,
                    depth: Arc::new(depth),
                    mask,
                    model: self.model(object, condition.model_level)?,
                })
            });
            for variant in 0..config.variants.len() {
                let presented = presented.as_ref().map_err(Clone::clone);
                outcomes.push(presented.and_then(|it| self.measure(level, variant, it)));
            }
        }
        outcomes
    }

    /// Returns the model of an object at a level: 0 is the original.
    fn model(&self, object: usize, level: u32) -> Result<&'a Model, String> {
        let (subject, config) = (&self.subjects[object], self.config);
        if level == 0 {
            return Ok(&subject.model);
        }
        self.models.get(object, level as usize - 1, || {
            let settings = Reconstruction {
                max_distance_meters: config.max_distance_m,
                axis_offset_meters: config.axis_offset_m,
                ..Reconstruction::new(config.camera, ReconstructionNoise::level(level)?)
            };
            Ok(settings.reconstruct(&subject.model, &subject.name, config.seed)?)
        })
    }

    fn measure(&mut self, level: usize, variant: usize, presented: &Presented<'_>) -> Outcome {
        let level = level.min(self.stages.len() - 1);
        let stage = &mut self.stages[level][variant];
        let workspace = &mut self.workspaces[variant];
        let (case, depth) = (presented.case, Arc::clone(&presented.depth));

        // Every variant creates an observation: normals and search trees are part of its time.
        let (mask, start) = (presented.mask.clone(), thread_time());
        let window = self.config.normals();
        let observation = Observation::with_normal_window(depth, mask, case.camera, window);
        let observation = observation.map_err(|e| e.to_string())?;
        let problem = Problem::new(presented.model, &observation);
        let mut regimes = Regimes::default();
        let outcome = stage.run(
            &problem,
            &case.init,
            &mut Session::new(workspace, &mut regimes),
        );
        let time = thread_time().saturating_sub(start);

        // The next level starts from the same pose, and its time must include the render again.
        for _ in 0..FORGET {
            self.forgotten = self.forgotten.wrapping_add(1);
            let behind = Isometry3::translation(0.0, 0.0, -10.0 - f64::from(self.forgotten));
            workspace.context(&problem).view(&behind);
        }
        let (subject, pose) = (presented.subject, outcome.camera_from_object);
        let truth = &case.camera_from_object;
        Ok(Measured {
            vsd_initial: case.vsd_initial,
            vsd_final: self.makers[0].vsd(&subject.model, truth, &pose),
            add_final_mm: subject.add_or_adi_mm(&pose, truth),
            steps: outcome.iterations,
            termination: outcome.termination.name().to_owned(),
            cpu_ms: self.config.times.then_some(1e3 * time.as_secs_f64()),
            regimes: regimes.0,
            mahalanobis_squared: None,
        })
    }
}

//! The evaluation of a case: every condition, every variant.

use std::sync::Arc;

use hicp_core::{DepthImage, Isometry3, Mask, Model, Observation, Problem};
use hicp_sim::{Case, CaseMaker, Reconstruction, ReconstructionNoise};
use hybrid_icp::BoxedStage;
use hybrid_icp::icp::{Session, Workspace};
use hybrid_icp::raster::Rasterizer;

use super::condition::Condition;
use super::config::Config;
use crate::clock::thread_time;
use crate::error::ExperimentError;
use crate::study::{Measured, Models, Outcome};
use crate::subject::Subject;

/// More renders than a workspace remembers.
const FORGET: u32 = 8;

/// Evaluates cases; one per thread.
pub(super) struct Runner<'a> {
    config: &'a Config,
    subjects: &'a [Subject],
    models: &'a Models,
    binned: CaseMaker,
    fixed: CaseMaker,
    /// By level, then by variant; one level for all unless levels change the pipelines.
    stages: Vec<Vec<BoxedStage>>,
    /// By variant.
    workspaces: Vec<Workspace>,
    forgotten: u32,
}

/// A case as a condition presents it.
struct Presented<'a> {
    case: &'a Case,
    depth: Arc<DepthImage>,
    mask: Mask,
    /// The model that is registered.
    model: &'a Model,
}

impl<'a> Runner<'a> {
    pub(super) fn new(
        config: &'a Config,
        subjects: &'a [Subject],
        models: &'a Models,
    ) -> Result<Self, ExperimentError> {
        let alphas =
            (0..config.levels.len()).map(|level| config.experiment.condition(level, 0).alpha);
        let pipelines = alphas
            .enumerate()
            .filter(|(level, alpha)| *level == 0 || alpha.is_some());
        let build = |alpha| config.variants.iter().map(|v| v.build(alpha)).collect();
        let workspace = |_| Workspace::new(Rasterizer::default());
        Ok(Self {
            config,
            subjects,
            models,
            binned: CaseMaker::new(config.cases(true)?)?,
            fixed: CaseMaker::new(config.cases(false)?)?,
            stages: pipelines
                .map(|(_, alpha)| build(alpha))
                .collect::<Result<_, _>>()?,
            workspaces: config.variants.iter().map(workspace).collect(),
            forgotten: 0,
        })
    }

    /// Evaluates a case: levels in order, and in each the variants in order.
    ///
    /// All variants get the same image and the same initial pose.
    pub(super) fn outcomes(&mut self, object: usize, index: u64) -> Vec<Outcome> {
        let config = self.config;
        let mut outcomes = Vec::new();
        let mut cases: [Option<Result<Case, String>>; 2] = [None, None];
        for level in 0..config.levels.len() {
            let condition = config.experiment.condition(level, index);
            let case = cases[usize::from(condition.binned)]
                .get_or_insert_with(|| self.case(object, index, condition.binned));
            let case = case.as_ref().map_err(Clone::clone);
            let presented = case.and_then(|case| self.present(object, case, &condition));
            for variant in 0..config.variants.len() {
                let measured = match &presented {
                    Ok(presented) => self.measure(object, level, variant, presented),
                    Err(error) => Err(error.clone()),
                };
                outcomes.push(measured);
            }
        }
        outcomes
    }

    fn case(&mut self, object: usize, index: u64, binned: bool) -> Result<Case, String> {
        let maker = match binned {
            true => &mut self.binned,
            false => &mut self.fixed,
        };
        let (subject, seed) = (&self.subjects[object], self.config.seed);
        let case = maker.case(&subject.model, &subject.name, seed, index);
        case.map_err(|e| e.to_string())
    }

    fn present<'c>(
        &self,
        object: usize,
        case: &'c Case,
        condition: &Condition,
    ) -> Result<Presented<'c>, String>
    where
        'a: 'c,
    {
        let (depth, mask) = condition
            .corruption
            .apply(case)
            .map_err(|e| e.to_string())?;
        Ok(Presented {
            case,
            depth: Arc::new(depth),
            mask,
            model: self.model(object, condition.model_level)?,
        })
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
                ..Reconstruction::new(config.camera.pinhole()?, ReconstructionNoise::level(level)?)
            };
            Ok(settings.reconstruct(&subject.model, &subject.name, config.seed)?)
        })
    }

    fn measure(
        &mut self,
        object: usize,
        level: usize,
        variant: usize,
        presented: &Presented<'_>,
    ) -> Outcome {
        let level = level.min(self.stages.len() - 1);
        let stage = &mut self.stages[level][variant];
        let workspace = &mut self.workspaces[variant];
        let (case, depth) = (presented.case, Arc::clone(&presented.depth));

        // Every variant creates an observation: normals and search trees are part of its time.
        let (mask, start) = (presented.mask.clone(), thread_time());
        let observation = Observation::new(depth, mask, case.camera);
        let observation = observation.map_err(|e| e.to_string())?;
        let problem = Problem::new(presented.model, &observation);
        let outcome = stage.run(&problem, &case.init, &mut Session::new(workspace, &mut ()));
        let time = thread_time().saturating_sub(start);

        // The next level starts from the same pose, whose render must be part of its time too.
        for _ in 0..FORGET {
            self.forgotten = self.forgotten.wrapping_add(1);
            let behind = Isometry3::translation(0.0, 0.0, -10.0 - f64::from(self.forgotten));
            workspace.context(&problem).view(&behind);
        }
        let (subject, pose) = (&self.subjects[object], outcome.camera_from_object);
        let truth = &case.camera_from_object;
        Ok(Measured {
            vsd_initial: case.vsd_initial,
            vsd_final: self.fixed.vsd(&subject.model, truth, &pose),
            add_final_mm: subject.add_or_adi_mm(&pose, truth),
            steps: outcome.iterations,
            termination: outcome.termination.name().to_owned(),
            cpu_ms: self.config.times.then_some(1e3 * time.as_secs_f64()),
            mahalanobis_squared: None,
        })
    }
}

//! One case, looked at under every condition, by every variant.

use std::sync::{Arc, OnceLock};

use hicp_core::{Isometry3, Model, Observation, Point3, Problem};
use hicp_score::{add, adi};
use hicp_sim::{
    Case, CaseMaker, Corruption, DepthNoise, DepthSensor, MaskDefects, Reconstruction,
    ReconstructionNoise, RelativeGaussian,
};
use hybrid_icp::{BoxedStage, Rasterizer, Session, Workspace};

use crate::clock::thread_time;
use crate::config::Config;
use crate::error::ExperimentError;
use crate::experiment::{Condition, MaskFault};
use crate::row::{Measured, Row};
use crate::subject::Subject;

/// Distance of the wall behind an object whose mask is dilated, metres: what the mask adds has a depth.
const WALL_METERS: f64 = 0.1;

/// More renders than a workspace remembers.
const FORGET: u32 = 8;

/// The reconstructions of every object, made when first needed and shared by all threads.
pub(crate) struct Reconstructions {
    made: Vec<[OnceLock<Result<Model, String>>; 4]>,
}

impl Reconstructions {
    pub(crate) fn new(objects: usize) -> Self {
        Self {
            made: (0..objects).map(|_| Default::default()).collect(),
        }
    }

    /// Returns the model of an object at a level: 0 is the original.
    fn model<'a>(
        &'a self,
        config: &Config,
        subjects: &'a [Subject],
        object: usize,
        level: u32,
    ) -> Result<&'a Model, String> {
        let subject = &subjects[object];
        let index = match level {
            0 => return Ok(&subject.model),
            level => level as usize - 1,
        };
        let made = self.made[object][index].get_or_init(|| {
            let make = || -> Result<Model, ExperimentError> {
                let settings = Reconstruction {
                    max_distance_meters: config.max_distance_m,
                    axis_offset_meters: config.axis_offset_m,
                    ..Reconstruction::new(
                        config.cases(false)?.camera,
                        ReconstructionNoise::level(level)?,
                    )
                };
                Ok(settings.reconstruct(&subject.model, &subject.name, config.seed)?)
            };
            make().map_err(|e| e.to_string())
        });
        made.as_ref().map_err(Clone::clone)
    }
}

/// Makes the rows of cases; one per thread.
pub(crate) struct Runner<'a> {
    config: &'a Config,
    subjects: &'a [Subject],
    reconstructions: &'a Reconstructions,
    binned: CaseMaker,
    fixed: CaseMaker,
    /// By level, then by variant; one level stands for all where they do not change the pipelines.
    stages: Vec<Vec<BoxedStage>>,
    /// By variant.
    workspaces: Vec<Workspace>,
    forgotten: u32,
}

impl<'a> Runner<'a> {
    pub(crate) fn new(
        config: &'a Config,
        subjects: &'a [Subject],
        reconstructions: &'a Reconstructions,
    ) -> Result<Self, ExperimentError> {
        let variants = config.variants();
        let mut stages = Vec::new();
        for level in 0..config.levels.len() {
            let alpha = config.experiment.condition(level, 0).alpha;
            if level > 0 && alpha.is_none() {
                break;
            }
            let built: Result<_, _> = variants.iter().map(|v| v.build(alpha)).collect();
            stages.push(built?);
        }
        Ok(Self {
            config,
            subjects,
            reconstructions,
            binned: CaseMaker::new(config.cases(true)?)?,
            fixed: CaseMaker::new(config.cases(false)?)?,
            stages,
            workspaces: variants
                .iter()
                .map(|_| Workspace::new(Rasterizer::default()))
                .collect(),
            forgotten: 0,
        })
    }

    /// Makes the rows of a case: levels in order, in each the variants in order. All variants get the same image and the same
    /// initial pose, and what differs between levels is what they are about.
    pub(crate) fn rows(&mut self, object: usize, index: u64) -> Vec<Row> {
        let mut rows = Vec::with_capacity(self.config.rows_per_case());
        let mut cases: [Option<Result<Case, String>>; 2] = [None, None];
        for level in 0..self.config.levels.len() {
            let condition = self.config.experiment.condition(level, index);
            let case = cases[usize::from(condition.binned)]
                .get_or_insert_with(|| self.case(object, index, condition.binned));
            let seen = case.as_ref().map_err(Clone::clone).and_then(|case| {
                let looked = corruption(&condition)
                    .apply(case)
                    .map_err(|e| e.to_string())?;
                let looked = (Arc::new(looked.0), looked.1);
                let believed = self.reconstructions.model(
                    self.config,
                    self.subjects,
                    object,
                    condition.model_level,
                )?;
                Ok((case, looked, believed))
            });
            for variant in 0..self.config.variants.len() {
                let (bin, measured, note) = match &seen {
                    Ok((case, (depth, mask), believed)) => {
                        // Each variant observes anew: normals and search trees are part of everyone's time.
                        match self.measure(object, level, variant, case, believed, || {
                            Observation::new(Arc::clone(depth), mask.clone(), case.camera)
                        }) {
                            Ok(measured) => (case.bin, Some(measured), String::new()),
                            Err(error) => (case.bin, None, error.to_string()),
                        }
                    }
                    Err(why) => (None, None, why.clone()),
                };
                rows.push(Row {
                    object: self.subjects[object].name.clone(),
                    case: index,
                    variant: self.config.variants[variant].name.clone(),
                    level: self.config.levels[level].clone(),
                    bin,
                    measured,
                    note,
                });
            }
        }
        rows
    }

    fn case(&mut self, object: usize, index: u64, binned: bool) -> Result<Case, String> {
        let maker = if binned {
            &mut self.binned
        } else {
            &mut self.fixed
        };
        let subject = &self.subjects[object];
        maker
            .case(&subject.model, &subject.name, self.config.seed, index)
            .map_err(|e| e.to_string())
    }

    fn measure(
        &mut self,
        object: usize,
        level: usize,
        variant: usize,
        case: &Case,
        believed: &Model,
        observe: impl FnOnce() -> Result<Observation, hicp_core::ImageError>,
    ) -> Result<Measured, hicp_core::ImageError> {
        let level = level.min(self.stages.len() - 1);
        let stage = &mut self.stages[level][variant];
        let workspace = &mut self.workspaces[variant];

        let start = thread_time();
        let observation = observe()?;
        let problem = Problem::new(believed, &observation);
        let outcome = stage.run(&problem, &case.init, &mut Session::new(workspace, &mut ()));
        let time = thread_time().saturating_sub(start);

        // The next level starts from the same pose, whose render must be part of its time too.
        for _ in 0..FORGET {
            self.forgotten = self.forgotten.wrapping_add(1);
            let behind = Isometry3::translation(0.0, 0.0, -10.0 - f64::from(self.forgotten));
            workspace.context(&problem).view(&behind);
        }
        let subject = &self.subjects[object];
        let pose = outcome.camera_from_object;
        let vsd_final = self
            .fixed
            .vsd(&subject.model, &case.camera_from_object, &pose);
        Ok(Measured {
            vsd_initial: case.vsd_initial,
            vsd_final,
            add_final_mm: 1e3 * add_or_adi(&subject.model, &pose, &case.camera_from_object),
            iterations: outcome.iterations,
            termination: outcome.termination.name().to_owned(),
            cpu_ms: self.config.times.then_some(1e3 * time.as_secs_f64()),
        })
    }
}

/// What lies between a case and the image of a condition.
fn corruption(condition: &Condition) -> Corruption {
    let noise = DepthNoise::Relative(RelativeGaussian {
        percent: condition.depth_percent,
    });
    let fault = |fault| condition.mask == fault;
    let defect = |is, size| if is { size } else { 0 };
    Corruption {
        wall_behind_meters: fault(MaskFault::Dilated).then_some(WALL_METERS),
        occluded_share: if fault(MaskFault::Occluded) { 0.3 } else { 0.0 },
        sensor: DepthSensor {
            noise,
            ..DepthSensor::default()
        },
        mask: MaskDefects {
            missing_share: if fault(MaskFault::Missing) { 0.2 } else { 0.0 },
            erosion_pixels: defect(fault(MaskFault::Eroded), 3),
            dilation_pixels: defect(fault(MaskFault::Dilated), 3),
        },
    }
}

/// ADD over the model's samples, or ADI where symmetries are declared, metres.
pub(crate) fn add_or_adi(model: &Model, estimate: &Isometry3<f64>, truth: &Isometry3<f64>) -> f64 {
    let points: Vec<Point3<f32>> = model.samples().iter().map(|s| s.point).collect();
    let symmetries = model.symmetries();
    if symmetries.discrete.is_empty() && symmetries.continuous.is_empty() {
        add(estimate, truth, &points)
    } else {
        adi(estimate, truth, &points)
    }
}

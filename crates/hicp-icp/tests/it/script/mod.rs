//! Scripted components, for tests of the engine alone.

pub(crate) use crate::support;

use std::ops::ControlFlow;

use std::cell::Cell;
use std::sync::{Arc, Mutex};

use hicp_association::{DataAssociation, PointSelection};
use hicp_core::{
    Context, Correspondences, Isometry3, Model, Observation, Pair, PinholeCamera, Point3, Problem,
    Surfel, UnitVector3, Vector3,
};
use hicp_icp::{
    Evaluation, Icp, IterationEvent, Observer, Outcome, RegimeEvent, Session, Stage, StageEvent,
    StopRule, Workspace,
};
use hicp_metric::{ErrorMetric, NormalEquations, Step};

/// One evaluation: its number of pairs and its mean loss; `None` for a metric without a step.
pub type Line = (usize, Option<f64>);

/// The script, shared by association and metric. Every run starts at `init`, whose x is 0.
///
/// The step at evaluation k is one meter along x, so the pose of evaluation k has x = k. The x of a
/// returned pose therefore identifies its evaluation.
#[derive(Clone, Debug)]
pub struct Scripted {
    lines: Vec<Line>,
}

impl Scripted {
    pub fn new(lines: &[Line]) -> Self {
        Self {
            lines: lines.to_vec(),
        }
    }

    /// Returns the line of the evaluation to which a pose belongs.
    fn line(&self, pose: &Isometry3<f64>) -> Line {
        let x = pose.translation.vector.x.round();
        self.lines.get(x as usize).copied().unwrap_or((0, None))
    }
}

fn surfel(x: f64) -> Surfel {
    Surfel {
        point: Point3::new(x as f32, 0.0, 1.0),
        normal: UnitVector3::new_unchecked(-Vector3::z()),
    }
}

impl PointSelection for Scripted {
    fn select(&mut self, _: &mut Context<'_>, _: &Isometry3<f64>, source: &mut Vec<Surfel>) {
        source.push(surfel(0.0));
    }

    fn name(&self) -> &'static str {
        "scripted-selection"
    }
}

impl DataAssociation for Scripted {
    fn associate(
        &mut self,
        _: &mut Context<'_>,
        _: &[Surfel],
        camera_from_object: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        // The pairs carry the pose's x to the metric.
        let here = surfel(camera_from_object.translation.vector.x);
        let (n_pairs, _) = self.line(camera_from_object);
        pairs.extend((0..n_pairs).map(|_| Pair {
            source: here,
            target: here,
            weight: 1.0,
            source_index: 0,
            target_index: 0,
        }));
    }

    fn name(&self) -> &'static str {
        "scripted-association"
    }
}

impl ErrorMetric for Scripted {
    fn linearize(&self, _: &Pair, _: &mut NormalEquations) {}

    fn step(&self, pairs: &Correspondences) -> Option<Step> {
        let x = pairs.as_slice()[0].source.point.x;
        let (_, loss) = self.line(&Isometry3::translation(x.into(), 0.0, 0.0));
        loss.map(|mean_loss| Step {
            increment: Isometry3::translation(1.0, 0.0, 0.0),
            mean_loss,
        })
    }

    fn name(&self) -> &'static str {
        "scripted-metric"
    }
}

pub fn scripted<S: StopRule>(lines: &[Line], stop: S) -> Icp<Scripted, Scripted, (), Scripted, S> {
    let script = Scripted::new(lines);
    Icp {
        selection: script.clone(),
        association: script.clone(),
        filter: (),
        metric: script,
        stop,
    }
}

/// Runs a stage on an empty problem, which scripts do not read.
pub fn run(stage: &mut dyn Stage, init: &Isometry3<f64>) -> Outcome {
    run_observed(stage, init, &mut ())
}

pub fn run_observed(
    stage: &mut dyn Stage,
    init: &Isometry3<f64>,
    observer: &mut dyn Observer,
) -> Outcome {
    let model = Model::new(support::cuboid(0.1, 0.1, 0.1));
    let camera = PinholeCamera::new(10.0, 10.0, 3.5, 3.5, 8, 8).unwrap();
    let observation: Observation =
        support::observe_depth(support::depth_image(&camera, |_| 1.0), &camera);
    let mut workspace = Workspace::new(support::RayCaster);
    stage.run(
        &Problem::new(&model, &observation),
        init,
        &mut Session::new(&mut workspace, observer),
    )
}

/// Returns the number of the evaluation whose pose was returned.
pub fn returned(outcome: &Outcome) -> f64 {
    outcome.camera_from_object.translation.vector.x
}

/// Records all events.
#[derive(Default)]
pub struct Log {
    pub iterations: Vec<(usize, f64, Evaluation)>,
    pub regimes: Vec<RegimeEvent>,
    pub stages: Vec<([&'static str; 3], usize, Outcome)>,
}

impl Observer for Log {
    fn on_iteration(&mut self, event: &IterationEvent<'_>) -> ControlFlow<()> {
        let x = event.camera_from_object.translation.vector.x;
        self.iterations.push((event.iteration, x, event.evaluation));
        ControlFlow::Continue(())
    }

    fn on_regime(&mut self, event: &RegimeEvent) {
        self.regimes.push(*event);
    }

    fn on_stage_end(&mut self, event: &StageEvent<'_>) {
        let names = [event.selection, event.association, event.metric];
        self.stages.push((names, event.n_source, *event.outcome));
    }
}

/// A stage that records its initial pose, moves by a given length along x, and returns a given
/// outcome.
pub struct Scheduled {
    pub outcome: Outcome,
    pub by: f64,
    pub starts: Arc<Mutex<Vec<f64>>>,
    pub calls: Cell<usize>,
}

impl Scheduled {
    pub fn new(outcome: Outcome, by: f64) -> Self {
        Self {
            outcome,
            by,
            starts: Arc::default(),
            calls: Cell::new(0),
        }
    }
}

impl Stage for Scheduled {
    fn run(&mut self, _: &Problem<'_>, init: &Isometry3<f64>, _: &mut Session<'_>) -> Outcome {
        self.starts.lock().unwrap().push(init.translation.vector.x);
        self.calls.set(self.calls.get() + 1);
        let mut pose = *init;
        if self.by != 0.0 {
            pose.translation.vector.x += self.by;
        }
        let mut outcome = self.outcome;
        outcome.camera_from_object = pose;
        outcome
    }
}

//! Where the time of every preset goes: `cargo run --release -p hicp-benches --example breakdown [REPEATS]`.
//!
//! The presets are put together anew from timed components. Times are exclusive (a render asked for by a selection counts as
//! render alone) and medians over the repeats, summed over the three objects of the benches; the table is Markdown.
#![allow(clippy::print_stdout, clippy::unwrap_used)]

use std::cell::RefCell;
use std::time::{Duration, Instant};

use hicp_benches::{Case, OBJECTS, case, forget_renders};
use hybrid_icp::Preset;
use hybrid_icp::association::{
    AllSamples, DataAssociation, NearestNeighbor, PointSelection, Projective, VisibleSurface,
};
use hybrid_icp::core::Iteration;
use hybrid_icp::core::{
    Context, Correspondences, Isometry3, Observation, PinholeCamera, PixelRegion, Problem,
    RenderedView, Renderer, Surfel, TriMesh,
};
use hybrid_icp::icp::{Cascade, Icp, Repeat, Session, Stage, Workspace};
use hybrid_icp::metric::Minimize;
use hybrid_icp::metric::{ErrorMetric, NormalEquations, PointToPlane, PointToPoint, Step};
use hybrid_icp::presets::paper_stop;
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::{MeanVsd, Score};
use hybrid_icp::switch::{PAPER_ALPHA, Switch, Threshold};

/// What time is spent on.
const STEPS: [&str; 7] = [
    "observe",
    "render",
    "select",
    "associate",
    "metric",
    "score",
    "rest",
];
const OBSERVE: usize = 0;
const RENDER: usize = 1;
const SELECT: usize = 2;
const ASSOCIATE: usize = 3;
const METRIC: usize = 4;
const SCORE: usize = 5;
const REST: usize = 6;

/// The time of each step, and the steps that are under way, the innermost last.
struct Clock {
    spent: [Duration; 7],
    running: Vec<usize>,
    since: Instant,
}

thread_local! {
    static CLOCK: RefCell<Clock> = RefCell::new(Clock {
        spent: [Duration::ZERO; 7],
        running: Vec::new(),
        since: Instant::now(),
    });
}

/// Runs something as a step.
fn timed<T>(step: usize, work: impl FnOnce() -> T) -> T {
    let switch = |next: Option<usize>| {
        CLOCK.with_borrow_mut(|clock| {
            let now = Instant::now();
            if let Some(last) = clock.running.last() {
                clock.spent[*last] += now - clock.since;
            }
            clock.since = now;
            match next {
                Some(step) => clock.running.push(step),
                None => {
                    clock.running.pop();
                }
            }
        });
    };
    switch(Some(step));
    let result = work();
    switch(None);
    result
}

#[derive(Default)]
struct Timed<T>(T);

impl<T: PointSelection> PointSelection for Timed<T> {
    fn select(&mut self, context: &mut Context<'_>, pose: &Isometry3<f64>, to: &mut Vec<Surfel>) {
        timed(SELECT, || self.0.select(context, pose, to));
    }
}

impl<T: DataAssociation> DataAssociation for Timed<T> {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        pose: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        timed(ASSOCIATE, || self.0.associate(context, source, pose, pairs));
    }
}

impl<T: Minimize> Minimize for Timed<T> {
    fn inner(&mut self, _: &Iteration<'_>) -> Option<&mut dyn Minimize> {
        Some(&mut self.0)
    }

    fn system(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
    ) -> Option<NormalEquations> {
        timed(METRIC, || self.0.system(iteration, pairs))
    }

    fn mean_loss(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<f64> {
        timed(METRIC, || self.0.mean_loss(iteration, pairs))
    }

    fn add_squared_errors(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
        factor: f64,
        errors: &mut [f64],
    ) {
        timed(METRIC, || {
            self.0.add_squared_errors(iteration, pairs, factor, errors);
        });
    }

    fn minimize(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<Step> {
        timed(METRIC, || self.0.minimize(iteration, pairs))
    }

    fn label(&self) -> &'static str {
        self.0.label()
    }
}

impl<T: Score> Score for Timed<T> {
    fn score(&mut self, context: &mut Context<'_>, pose: &Isometry3<f64>) -> f64 {
        timed(SCORE, || self.0.score(context, pose))
    }
}

impl<T: Renderer> Renderer for Timed<T> {
    fn render(
        &mut self,
        mesh: &TriMesh,
        camera: &PinholeCamera,
        pose: &Isometry3<f64>,
        region: &PixelRegion,
        view: &mut RenderedView,
    ) {
        timed(RENDER, || self.0.render(mesh, camera, pose, region, view));
    }
}

fn projective(metric: impl ErrorMetric + 'static) -> Box<dyn Stage> {
    Box::new(Icp {
        selection: Timed(VisibleSurface::default()),
        association: Timed(Projective),
        filter: (),
        metric: Timed(metric),
        stop: paper_stop(),
    })
}

fn nearest(metric: impl ErrorMetric + 'static) -> Box<dyn Stage> {
    Box::new(Icp {
        selection: Timed(AllSamples),
        association: Timed(NearestNeighbor::default()),
        filter: (),
        metric: Timed(metric),
        stop: paper_stop(),
    })
}

fn timed_preset(preset: Preset) -> Box<dyn Stage> {
    let (point, plane) = (PointToPoint, PointToPlane);
    let cascade = |first, second| Box::new(Cascade((first, second)));
    match preset {
        Preset::Hybrid => Box::new(Repeat {
            times: 2,
            stage: Switch {
                switcher: Threshold {
                    score: Timed(MeanVsd::default()),
                    alpha: PAPER_ALPHA,
                },
                aligned: Cascade((projective(point), projective(plane))),
                misaligned: nearest(point),
            },
        }),
        Preset::ProjectivePointToPoint => projective(point),
        Preset::ProjectivePointToPlane => projective(plane),
        Preset::ProjectiveCascadePointPlane => cascade(projective(point), projective(plane)),
        Preset::ProjectiveCascadePlanePoint => cascade(projective(plane), projective(point)),
        Preset::NnPointToPoint => nearest(point),
        Preset::NnPointToPlane => nearest(plane),
        Preset::NnCascadePointPlane => cascade(nearest(point), nearest(plane)),
        Preset::NnCascadePlanePoint => cascade(nearest(plane), nearest(point)),
        // Their rendering and scoring of the end are told apart; what else they do is in the rest.
        other => other.build(),
    }
}

/// From the depth image to a scored pose: what `Refiner` does.
fn run(case: &Case, stage: &mut dyn Stage, workspace: &mut Workspace) -> [Duration; 7] {
    let seen = &case.scene.observation;
    let (depth, mask) = (seen.depth().clone(), seen.mask().clone());
    forget_renders(
        workspace,
        &Problem::new(&case.scene.model, seen),
        &case.init,
    );
    CLOCK.with_borrow_mut(|clock| clock.spent = [Duration::ZERO; 7]);
    timed(REST, || {
        let made = timed(OBSERVE, || Observation::new(depth, mask, *seen.camera()));
        let observation = made.unwrap();
        let problem = Problem::new(&case.scene.model, &observation);
        let mut score = Timed(MeanVsd::default());
        score.score(&mut workspace.context(&problem), &case.init);
        let mut observer = ();
        let mut session = Session::new(workspace, &mut observer);
        let outcome = stage.run(&problem, &case.init, &mut session);
        score.score(
            &mut workspace.context(&problem),
            &outcome.camera_from_object,
        );
    });
    CLOCK.with_borrow(|clock| clock.spent)
}

fn main() {
    let repeats = std::env::args()
        .nth(1)
        .map_or(101, |count| count.parse().unwrap());
    let cases = OBJECTS.map(case);
    println!("| preset | {} | all, ms |", STEPS.join(" | "));
    println!("|---|{}", "---|".repeat(STEPS.len() + 1));
    for preset in Preset::ALL {
        let mut stage = timed_preset(preset);
        let mut workspace = Workspace::new(Timed(Rasterizer::default()));
        let mut totals = [0.0; 7];
        for case in &cases {
            let runs: Vec<_> = (0..repeats)
                .map(|_| run(case, &mut stage, &mut workspace))
                .collect();
            for (step, total) in totals.iter_mut().enumerate() {
                let mut spent: Vec<Duration> = runs.iter().map(|run| run[step]).collect();
                spent.sort();
                *total += spent[spent.len() / 2].as_secs_f64() * 1e3;
            }
        }
        let all: f64 = totals.iter().sum();
        let shares = totals.map(|total| format!("{:.0} %", 100.0 * total / all));
        println!("| {preset} | {} | {all:.2} |", shares.join(" | "));
    }
}

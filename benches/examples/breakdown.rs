//! Prints how the time of a refinement is divided among its steps, as a Markdown table.
//!
//! `cargo run --release -p hicp-benches --example breakdown [REPEATS [PIPELINE [OVERRIDE]...]]`
//!
//! - Without a pipeline, the table has a row per preset.
//! - `breakdown 200 hybrid` runs one preset only, for a profiler.
//! - Overrides add a row for the changed pipeline. The two pipelines run in alternation:
//!   `breakdown 15 nn-point-to-point association.part.index=kd-tree` compares the two indexes.
//!
//! Every run starts from a depth image, ends with a scored pose, and finds no render of an earlier
//! run. Times are exclusive: a render that a selection requests counts as a render only. They are
//! medians over the repeats, summed over the three objects of the benches.
#![allow(clippy::print_stdout)]

use std::cell::RefCell;
use std::time::{Duration, Instant};

use hicp_benches::{Case, OBJECTS, case, forget_renders};
use hybrid_icp::association::{DataAssociation, PointSelection};
use hybrid_icp::core::{
    Context, Correspondences, Isometry3, Iteration, Observation, PinholeCamera, PixelRegion,
    Problem, RenderedView, Renderer, Surfel, TriMesh,
};
use hybrid_icp::icp::{RegimeEvent, Session, Stage, Workspace};
use hybrid_icp::metric::{Minimize, NormalEquations, Step};
use hybrid_icp::pipeline::{
    BoxedAssociation, BoxedMetric, BoxedScore, BoxedSelection, BoxedSwitcher, Catalog,
    PipelineFile, PipelineLimits,
};
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::{MeanVsd, Score};
use hybrid_icp::switch::Switcher;
use hybrid_icp::{BoxedStage, Preset};

type Failure = Box<dyn std::error::Error>;

/// Steps whose time is measured.
const STEPS: [&str; 7] = [
    "observe",
    "render",
    "select",
    "associate",
    "metric",
    "score",
    "rest",
];
/// The association of surface and silhouette.
const FIT: &str = "joined";
const OBSERVE: usize = 0;
const RENDER: usize = 1;
const SELECT: usize = 2;
const ASSOCIATE: usize = 3;
const METRIC: usize = 4;
const SCORE: usize = 5;
const REST: usize = 6;

/// The time of each step, and the stack of running steps.
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

/// Runs `work` and adds its time to a step.
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

/// A component whose calls are timed as a step.
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
        // The first step that needs normals estimates them. The fits need none.
        if let Some(observation) = context
            .problem
            .observation()
            .filter(|_| self.0.name() != FIT)
        {
            timed(OBSERVE, || observation.n_surfels());
        }
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

impl<T: Switcher> Switcher for Timed<T> {
    fn regime(&mut self, context: &mut Context<'_>, pose: &Isometry3<f64>) -> RegimeEvent {
        timed(SCORE, || self.0.regime(context, pose))
    }
}

/// Returns the shipped parts, with a part `timed` for each kind that is a step.
///
/// A `timed` part measures the part inside it.
fn catalog() -> Catalog {
    let mut catalog = Catalog::built_in().clone();
    let what = "the part that is timed";
    catalog.add_selection(TIMED, move |p| {
        Ok(Timed(p.part::<BoxedSelection>("part", None, what)?))
    });
    catalog.add_association(TIMED, move |p| {
        Ok(Timed(p.part::<BoxedAssociation>("part", None, what)?))
    });
    catalog.add_metric(TIMED, move |p| {
        Ok(Timed(p.part::<BoxedMetric>("part", None, what)?))
    });
    catalog.add_score(TIMED, move |p| {
        Ok(Timed(p.part::<BoxedScore>("part", None, what)?))
    });
    catalog.add_switcher(TIMED, move |p| {
        Ok(Timed(p.part::<BoxedSwitcher>("part", None, what)?))
    });
    catalog
}

const TIMED: &str = "timed";

/// Wraps the timed parts of a preset. In the preset's file, each part is on a line of its own.
fn timed_parts(toml: &str) -> String {
    let steps = [
        "selection",
        "association",
        "metric",
        "score",
        "ranking",
        "switcher",
    ];
    let wrap = |line: &str| match line.split_once(" = ") {
        Some((key, part)) if steps.contains(&key) => {
            format!("{key} = {{ type = \"{TIMED}\", part = {part} }}\n")
        }
        _ => format!("{line}\n"),
    };
    toml.lines().map(wrap).collect()
}

/// A pipeline with the times of its runs.
///
/// Holds the runs on the current object, and the sums over earlier objects in milliseconds.
struct Row {
    name: String,
    stage: BoxedStage,
    workspace: Workspace,
    runs: Vec<[Duration; 7]>,
    totals: [f64; 7],
}

impl Row {
    fn new(preset: Preset, overrides: &[String]) -> Result<Self, Failure> {
        let mut file = PipelineFile::parse(&timed_parts(preset.toml()), preset.name())?;
        for assignment in overrides {
            file.set(assignment)?;
        }
        Ok(Self {
            name: [&[preset.name().to_owned()], overrides].concat().join(" "),
            stage: file.build_from(&catalog(), &PipelineLimits::DEFAULT)?,
            workspace: Workspace::new(Timed(Rasterizer::default())),
            runs: Vec::new(),
            totals: [0.0; 7],
        })
    }

    /// Refines from the depth image to a scored pose, like `Refiner`.
    fn run(&mut self, case: &Case) -> Result<(), Failure> {
        let (model, seen) = (&case.scene.model, &case.scene.observation);
        let (depth, mask) = (seen.depth().clone(), seen.mask().clone());
        let workspace = &mut self.workspace;
        forget_renders(workspace, &Problem::new(model, seen), &case.init);
        CLOCK.with_borrow_mut(|clock| clock.spent = [Duration::ZERO; 7]);
        timed(REST, || {
            let observation = timed(OBSERVE, || Observation::new(depth, mask, *seen.camera()))?;
            let problem = Problem::new(model, &observation);
            let mut score = Timed(MeanVsd::default());
            score.score(&mut workspace.context(&problem), &case.init);
            let mut observer = ();
            let mut session = Session::new(workspace, &mut observer);
            let outcome = self.stage.run(&problem, &case.init, &mut session);
            let pose = outcome.camera_from_object;
            score.score(&mut workspace.context(&problem), &pose);
            Ok::<_, Failure>(())
        })?;
        self.runs.push(CLOCK.with_borrow(|clock| clock.spent));
        Ok(())
    }

    /// Adds the medians of the runs to the totals and clears the runs.
    fn end_object(&mut self) {
        for (step, total) in self.totals.iter_mut().enumerate() {
            let mut spent: Vec<Duration> = self.runs.iter().map(|run| run[step]).collect();
            spent.sort();
            *total += spent[spent.len() / 2].as_secs_f64() * 1e3;
        }
        self.runs.clear();
    }
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let repeats: usize = arguments.first().map_or(Ok(101), |count| count.parse())?;
    let mut rows = Vec::new();
    match arguments.get(1) {
        None => {
            for preset in Preset::ALL {
                rows.push(Row::new(preset, &[])?);
            }
        }
        Some(name) => {
            let overrides = &arguments[2..];
            rows.push(Row::new(name.parse()?, &[])?);
            if !overrides.is_empty() {
                rows.push(Row::new(name.parse()?, overrides)?);
            }
        }
    }
    for case in OBJECTS.map(case) {
        for _ in 0..repeats {
            rows.iter_mut().try_for_each(|row| row.run(&case))?;
        }
        rows.iter_mut().for_each(Row::end_object);
    }
    println!("| pipeline | {} | all, ms |", STEPS.join(" | "));
    println!("|---|{}", "---|".repeat(STEPS.len() + 1));
    for Row { name, totals, .. } in &rows {
        let all: f64 = totals.iter().sum();
        let shares = totals.map(|total| format!("{:.0} %", 100.0 * total / all));
        println!("| {name} | {} | {all:.2} |", shares.join(" | "));
    }
    Ok(())
}

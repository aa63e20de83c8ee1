//! Runs one pipeline repeatedly, for a profiler: `cargo run --release -p hicp-benches --example repeat -- hybrid 200`.
//!
//! Further arguments override fields and are compared with the pipeline as it ships. The two run in alternation:
//! `repeat -- nn-point-to-point 50 association.index=kd-tree` compares kiddo's k-d tree with the tree of boxes.
//!
//! Every run is cold: it makes its observation again. Prints the 5th percentile of the time per object, which other work on
//! the machine hardly changes, and with overrides the ratio of the sums over the objects.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::time::Instant;

use hicp_benches::{Case, OBJECTS, case, forget_renders};
use hybrid_icp::core::{Observation, Problem};
use hybrid_icp::pipeline::PipelineFile;
use hybrid_icp::{Preset, Refiner, Trace};

/// A pipeline with the times of its runs, milliseconds.
struct Run {
    refiner: Refiner,
    observe: Vec<f64>,
    refine: Vec<f64>,
    trace: Trace,
}

impl Run {
    fn new(pipeline: &PipelineFile) -> Self {
        Self {
            refiner: Refiner::boxed(pipeline.build().unwrap()),
            observe: Vec::new(),
            refine: Vec::new(),
            trace: Trace::new(),
        }
    }

    fn run(&mut self, case: &Case) {
        let seen = &case.scene.observation;
        let (depth, mask) = (seen.depth().clone(), seen.mask().clone());
        let problem = Problem::new(&case.scene.model, seen);
        forget_renders(self.refiner.workspace_mut(), &problem, &case.init);
        let start = Instant::now();
        let observation = Observation::new(depth, mask, *seen.camera()).unwrap();
        let made = Instant::now();
        self.trace.clear();
        let (model, init) = (&case.scene.model, &case.init);
        self.refiner
            .refine_observed(model, &observation, init, &mut self.trace);
        let end = Instant::now();
        self.observe.push((made - start).as_secs_f64() * 1e3);
        self.refine.push((end - made).as_secs_f64() * 1e3);
    }

    /// Prints the times and the stages of the last run. Returns the sum of the times.
    fn report(&mut self, case: &Case) -> f64 {
        let [observe, refine] = [&mut self.observe, &mut self.refine].map(|times| {
            times.sort_by(f64::total_cmp);
            times[times.len() / 20]
        });
        let stages = self.trace.stages.iter().map(|s| {
            let iterations = s.outcome.iterations;
            format!("{}/{} {iterations}x{}", s.association, s.metric, s.n_source)
        });
        println!(
            "{:8} box {:6} px, observe {observe:.3} ms, refine {refine:.3} ms: {}",
            case.name,
            case.scene.observation.region().area(),
            stages.collect::<Vec<_>>().join(", ")
        );
        observe + refine
    }
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let preset: Preset = arguments
        .next()
        .map_or(Preset::Hybrid, |name| name.parse().unwrap());
    let repeats: usize = arguments.next().map_or(100, |count| count.parse().unwrap());
    let shipped = PipelineFile::parse(preset.toml(), preset.name()).unwrap();
    let mut pipelines = vec![shipped.clone()];
    let overrides: Vec<String> = arguments.collect();
    if !overrides.is_empty() {
        let mut changed = shipped;
        for assignment in overrides {
            changed.set(&assignment).unwrap();
        }
        pipelines.push(changed);
    }
    let mut totals = vec![0.0; pipelines.len()];
    for object in OBJECTS {
        let case = case(object);
        let mut runs: Vec<Run> = pipelines.iter().map(Run::new).collect();
        for _ in 0..repeats {
            runs.iter_mut().for_each(|run| run.run(&case));
        }
        for (run, total) in runs.iter_mut().zip(&mut totals) {
            *total += run.report(&case);
        }
    }
    if let [shipped, changed] = totals[..] {
        println!("with overrides : as shipped {:.2}", changed / shipped);
    }
}

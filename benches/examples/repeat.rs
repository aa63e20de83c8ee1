//! Runs one pipeline over and over, for a profiler: `cargo run --release -p hicp-benches --example repeat -- hybrid 200`.
//! Further arguments override fields: `repeat -- nn-point-to-point 50 association=nearest-neighbor` searches with the k-d tree.
//!
//! Cold runs: each makes its observation anew. Prints the 5th percentile of the time per object, which other work on the machine hardly moves.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::time::Instant;

use hicp_benches::{OBJECTS, case, forget_renders};
use hybrid_icp::{Observation, PipelineFile, Preset, Problem, Refiner, Trace};

fn main() {
    let mut arguments = std::env::args().skip(1);
    let preset: Preset = arguments
        .next()
        .map_or(Preset::Hybrid, |name| name.parse().unwrap());
    let repeats: usize = arguments.next().map_or(100, |count| count.parse().unwrap());
    let mut pipeline = PipelineFile::parse(preset.toml(), preset.name()).unwrap();
    for assignment in arguments {
        pipeline.set(&assignment).unwrap();
    }
    for object in OBJECTS {
        let case = case(object);
        let seen = &case.scene.observation;
        let mut refiner = Refiner::boxed(pipeline.build().unwrap());
        let (mut observe, mut refine) = (Vec::new(), Vec::new());
        let mut trace = Trace::new();
        for _ in 0..repeats {
            let (depth, mask) = (seen.depth().clone(), seen.mask().clone());
            let problem = Problem::new(&case.scene.model, seen);
            forget_renders(refiner.workspace_mut(), &problem, &case.init);
            let start = Instant::now();
            let observation = Observation::new(depth, mask, *seen.camera()).unwrap();
            let made = Instant::now();
            trace.clear();
            refiner.refine_observed(&case.scene.model, &observation, &case.init, &mut trace);
            let end = Instant::now();
            observe.push((made - start).as_secs_f64() * 1e3);
            refine.push((end - made).as_secs_f64() * 1e3);
        }
        observe.sort_by(f64::total_cmp);
        refine.sort_by(f64::total_cmp);
        let stages: Vec<String> = trace
            .stages
            .iter()
            .map(|s| {
                format!(
                    "{}/{} {}x{}",
                    s.association, s.metric, s.outcome.iterations, s.n_source
                )
            })
            .collect();
        println!(
            "{:8} box {:6} px, observe {:.3} ms, refine {:.3} ms: {}",
            case.name,
            seen.region().area(),
            observe[repeats / 20],
            refine[repeats / 20],
            stages.join(", ")
        );
    }
}

//! An observer: reports every iteration, switch, decision and stage.
//!
//! `cargo run --release -p hybrid-icp --example 04_observer`

#![allow(clippy::print_stdout)]

use std::error::Error;
use std::ops::ControlFlow;

use hybrid_icp::core::{Isometry3, se3};
use hybrid_icp::icp::{DecisionEvent, IterationEvent, Observer, RegimeEvent, StageEvent};
use hybrid_icp::{Preset, Refiner};

mod scene;

/// Prints a line per event, and the error of every pose if the truth is known.
struct Table {
    truth: Isometry3<f64>,
}

impl Observer for Table {
    fn on_regime(&mut self, event: &RegimeEvent) {
        println!("-- {} (score {:.3?})", event.regime.name(), event.score);
    }

    fn on_iteration(&mut self, event: &IterationEvent<'_>) -> ControlFlow<()> {
        let (angle, distance) = se3::pose_distance(event.camera_from_object, &self.truth);
        println!(
            "{:>4} {:>6} pairs, RMS loss {:.3} mm, off by {:.3} degrees and {:.3} mm",
            event.iteration,
            event.evaluation.n_pairs,
            event.evaluation.mean_loss.sqrt() * 1e3,
            angle.to_degrees(),
            distance * 1e3
        );
        ControlFlow::Continue(()) // `Break` would end the run here.
    }

    fn on_decision(&mut self, event: &DecisionEvent<'_>) {
        let verb = if event.kept { "keeps" } else { "rejects" };
        println!(
            "-- {} {verb} a score of {:.3} after {:.3}",
            event.stage, event.score, event.best
        );
    }

    fn on_stage_end(&mut self, event: &StageEvent<'_>) {
        println!(
            "-- {}, {}, {}: {}",
            event.selection, event.association, event.metric, event.outcome.termination
        );
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let given = scene::Scene::new()?;
    let (model, observation) = given.problem()?;
    let mut table = Table { truth: given.truth };
    let mut refiner = Refiner::preset(Preset::Auto);
    let observed = refiner.refine_observed(&model, &observation, &given.detected, &mut table);
    // Looking changes nothing.
    let unobserved = refiner.refine(&model, &observation, &given.detected);
    if observed == unobserved {
        Ok(())
    } else {
        Err("the observer changed the result".into())
    }
}

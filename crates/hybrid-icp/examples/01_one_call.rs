//! One call: from a depth image, a mask, a camera, a mesh and a rough pose to a better pose and a
//! measure of trust.
//!
//! `cargo run --release -p hybrid-icp --example 01_one_call`

#![allow(clippy::print_stdout)]

use std::error::Error;

use hybrid_icp::core::{Model, Observation};
use hybrid_icp::icp::Verdict;
use hybrid_icp::{Preset, Refiner};

mod scene;

fn main() -> Result<(), Box<dyn Error>> {
    // Real inputs come from a camera, a segmentation and a pose estimator; `hicp-io` reads the
    // files.
    let given = scene::Scene::new()?;

    let observation = Observation::new(given.depth, given.mask, given.camera)?; // Once per image.
    let model = Model::new(given.mesh); // Once per object.
    let mut refiner = Refiner::preset(Preset::Auto); // Once per thread.

    let refined = refiner.refine(&model, &observation, &given.detected);

    // Refining never fails; whether it helped is in the outcome and in the score.
    match refined.outcome.verdict {
        Verdict::Refined => println!("refined, {}", refined.outcome.termination),
        Verdict::KeptInitial(why) => println!("kept the detected pose: {why}"),
    }
    println!(
        "confidence {:.3}, mean VSD estimate {:.3}, before {:.3}",
        refined.confidence, refined.mve, refined.mve_initial
    );
    if refined.confidence < 0.95 {
        return Err("this pose may be wrong".into());
    }
    println!("{}", refined.outcome.camera_from_object);
    if let Some(quality) = refined.outcome.quality {
        println!(
            "{:.0} % of the points matched, {:.2} mm from the observed surface (RMS)",
            quality.fitness * 100.0,
            quality.plane_rmse * 1e3
        );
    }
    Ok(())
}

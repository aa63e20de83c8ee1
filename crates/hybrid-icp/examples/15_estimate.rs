//! No initial pose: from a depth image, a mask, a camera and a mesh to a pose.
//!
//! `cargo run --release -p hybrid-icp --example 15_estimate`

#![allow(clippy::print_stdout)]

use std::error::Error;

use hybrid_icp::core::se3;
use hybrid_icp::{Preset, Refiner};

mod scene;

fn main() -> Result<(), Box<dyn Error>> {
    let given = scene::Scene::new()?;
    let (model, observation) = given.problem()?;

    // A search over all rotations finds rough poses; `auto` refines the best of them.
    let found = Refiner::preset(Preset::Auto).estimate(&model, &observation);

    println!("mean VSD estimate {:.3}", found.mve);
    let pose = found.outcome.camera_from_object;
    let (angle, distance) = se3::pose_distance(&pose, &given.truth);
    println!(
        "{:.2} degrees and {:.2} mm from the true pose",
        angle.to_degrees(),
        distance * 1e3
    );
    if angle.to_degrees() < 1.0 && distance < 0.001 && found.warnings().is_empty() {
        Ok(())
    } else {
        Err("the object was not found".into())
    }
}

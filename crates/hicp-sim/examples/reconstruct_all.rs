//! Reconstructs every household object at the four noise levels of §VI-B.3 and prints the surface
//! errors.
//!
//! `cargo run --release -p hicp-sim --example reconstruct_all`
#![allow(clippy::print_stdout, reason = "a report")]

use std::time::Instant;

use hicp_core::{Model, PinholeCamera, Point3, sample_surface};
use hicp_sim::{Household, Reconstruction, ReconstructionNoise, components};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let camera = PinholeCamera::new(572.4, 573.6, 325.3, 242.0, 640, 480)?;
    println!(
        "| object | level | triangles | parts | mean distance to the original, mm | from the original, mm | s |"
    );
    println!("|---|---|---|---|---|---|---|");
    for object in Household::ALL {
        let model = object.model()?;
        for level in 1..=4 {
            let start = Instant::now();
            let settings = Reconstruction::new(camera, ReconstructionNoise::level(level)?);
            let made = settings.reconstruct(&model, object.name(), 1)?;
            let seconds = start.elapsed().as_secs_f64();
            println!(
                "| {} | {level} | {} | {} | {:.2} | {:.2} | {seconds:.1} |",
                object.name(),
                made.mesh().triangles().len(),
                components(made.mesh())?.len(),
                1e3 * mean_distance(&made, &model),
                1e3 * mean_distance(&model, &made),
            );
        }
    }
    Ok(())
}

/// Returns the mean distance from samples of one model to the nearest of dense samples of another,
/// meters.
///
/// It is never exactly 0.
fn mean_distance(from: &Model, to: &Model) -> f64 {
    let dense = sample_surface(to.mesh(), 30_000);
    let nearest = |p: &Point3<f32>| {
        let squared = dense.iter().map(|s| (s.point - p).norm_squared());
        squared.fold(f32::INFINITY, f32::min).sqrt()
    };
    let samples = from.samples();
    samples
        .iter()
        .map(|s| f64::from(nearest(&s.point)))
        .sum::<f64>()
        / samples.len() as f64
}

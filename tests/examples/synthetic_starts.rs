//! Refines 200 starts on ten synthetic objects with every preset, on the same images.
//!
//! The starts are 6.2 mm and 9.5° off.
//!
//! Run `cargo run --release -p hicp-tests --example synthetic_starts [DEPTH_NOISE_PERCENT]`.

use std::time::Instant;

use hicp_tests::starts::{Start, starts};
use hicp_tests::{mean, median, symmetric_pose_distance};
use hybrid_icp::core::Problem;
use hybrid_icp::score::{ModelPoints, Score, Vsd};
use hybrid_icp::{Preset, Refiner};

const STARTS_PER_OBJECT: usize = 20;

/// The measurements of one preset.
#[derive(Default)]
struct Column {
    angles: Vec<f64>,
    distances: Vec<f64>,
    milliseconds: Vec<f64>,
    vsd: Vec<f64>,
    worse: usize,
    /// Number of poses with an MSSD below a tenth of the diameter.
    right: usize,
}

fn main() {
    let noise: f64 = std::env::args().nth(1).map_or(0.0, |text| {
        text.parse().expect("DEPTH_NOISE_PERCENT is a number")
    });
    let mut refiners =
        Preset::ALL.map(|preset| (preset, Refiner::preset(preset), Column::default()));
    for Start { scene, init } in starts(STARTS_PER_OBJECT, noise) {
        let points = ModelPoints::new(&scene.model);
        // No time includes what is derived from the model, once per model.
        Refiner::preset(Preset::Search).refine(&scene.model, &scene.observation, &init);
        for (_, refiner, column) in &mut refiners {
            // A new observation for each preset, so that every time includes normals and search
            // trees.
            let start = Instant::now();
            let observation = scene.observe_again();
            let refined = refiner.refine(&scene.model, &observation, &init);
            column
                .milliseconds
                .push(start.elapsed().as_secs_f64() * 1e3);
            let pose = refined.outcome.camera_from_object;
            let (angle, distance) =
                symmetric_pose_distance(&pose, &scene.truth, scene.model.symmetries());
            column.angles.push(angle.to_degrees());
            column.distances.push(distance * 1e3);
            let problem = Problem::new(&scene.model, &observation);
            let mut context = refiner.workspace_mut().context(&problem);
            let mut vsd = Vsd::new(scene.truth);
            let (before, after) = (
                vsd.score(&mut context, &init),
                vsd.score(&mut context, &pose),
            );
            column.vsd.push(after);
            column.worse += usize::from(after > before);
            let mssd = points.mssd(&pose, &scene.truth);
            column.right += usize::from(mssd < 0.1 * points.diameter());
        }
    }

    println!(
        "| pipeline | median rotation error | median translation error | mean VSD | VSD > 0.3 | ends worse than it started | time, ratio of medians | of means | MSSD < 0.1 d |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let baseline = refiners
        .iter_mut()
        .find(|(preset, ..)| *preset == Preset::NnPointToPoint)
        .map_or((f64::NAN, f64::NAN), |(_, _, column)| {
            (median(&mut column.milliseconds), mean(&column.milliseconds))
        });
    for (preset, _, column) in &mut refiners {
        let count = column.vsd.len() as f64;
        let failed = column.vsd.iter().filter(|vsd| **vsd > 0.3).count() as f64;
        println!(
            "| {preset} | {:.3}° | {:.3} mm | {:.3} | {:.1} % | {:.1} % | {:.2} | {:.2} | {:.1} % |",
            median(&mut column.angles),
            median(&mut column.distances),
            mean(&column.vsd),
            100.0 * failed / count,
            100.0 * column.worse as f64 / count,
            median(&mut column.milliseconds) / baseline.0,
            mean(&column.milliseconds) / baseline.1,
            100.0 * column.right as f64 / count,
        );
    }
    println!(
        "\nTimes are relative to nn-point-to-point: median {:.2} ms from depth image to pose.",
        baseline.0
    );
}

//! Refines 200 perturbed starts (6.2 mm, 9.5°) on ten synthetic objects, noise-free and with a full mask, with every preset.
//!
//! `cargo run --release -p hicp-tests --example synthetic_starts`

use hicp_sim::{
    Household, MEAN_ROTATION_ERROR_DEGREES, MEAN_TRANSLATION_ERROR_METERS, perturb, rng,
};
use hicp_tests::{scene, symmetric_pose_distance};
use hybrid_icp::{Preset, Problem, Refiner, Score, Vsd};

const STARTS_PER_OBJECT: usize = 20;

fn main() {
    let noise: f64 = std::env::args()
        .nth(1)
        .and_then(|s| s.parse().ok())
        .unwrap_or(0.0);
    println!(
        "| pipeline | median rotation (deg) | median translation (mm) | mean VSD | VSD > 0.3 | worse than start | median iterations | median ms |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for preset in Preset::ALL {
        let mut refiner = Refiner::preset(preset);
        let (mut angles, mut distances, mut times, mut iterations) =
            (vec![], vec![], vec![], vec![]);
        let (mut vsd_sum, mut failed, mut worse, mut total) = (0.0, 0, 0, 0);
        for (index, object) in (0..).zip(Household::ALL) {
            let mut rng = rng(index);
            for _ in 0..STARTS_PER_OBJECT {
                let scene = scene(object, noise, &mut rng);
                let init = perturb(
                    &mut rng,
                    &scene.truth,
                    MEAN_TRANSLATION_ERROR_METERS,
                    MEAN_ROTATION_ERROR_DEGREES.to_radians(),
                );
                let start = std::time::Instant::now();
                let refined = refiner.refine(&scene.model, &scene.observation, &init);
                times.push(start.elapsed().as_secs_f64() * 1e3);
                let pose = refined.outcome.camera_from_object;
                let (angle, distance) =
                    symmetric_pose_distance(&pose, &scene.truth, scene.model.symmetries());
                angles.push(angle.to_degrees());
                distances.push(distance * 1e3);
                iterations.push(refined.outcome.iterations as f64);
                let problem = Problem::new(&scene.model, &scene.observation);
                let mut context = refiner.workspace_mut().context(&problem);
                let mut vsd = Vsd::new(scene.truth);
                let before = vsd.score(&mut context, &init);
                let after = vsd.score(&mut context, &pose);
                vsd_sum += after;
                failed += usize::from(after > 0.3);
                worse += usize::from(after > before);
                total += 1;
            }
        }
        println!(
            "| {preset} | {:.3} | {:.3} | {:.3} | {:.1} % | {:.1} % | {:.0} | {:.2} |",
            median(&mut angles),
            median(&mut distances),
            vsd_sum / total as f64,
            100.0 * failed as f64 / total as f64,
            100.0 * worse as f64 / total as f64,
            median(&mut iterations),
            median(&mut times),
        );
    }
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

//! Compares `Refiner::estimate` with `search` from a rough pose, on the same simulated images.
//!
//! Run `cargo run --release -p hicp-tests --example estimate`, and then, if not the defaults:
//! `[CASES] [tuning|test] [MASK] [PRESET]`.
//!
//! The images are those of `hicp_tests::tabletop`, and `MASK` is one of its kinds, `exact` if not
//! given. A pose fails if its MSSD is above a tenth of the diameter, up to declared symmetries. The
//! rough pose has the mean error of an estimator, 6.2 mm and 9.5°. Times are from the depth image
//! to the pose on one core.

use std::time::Instant;

use hicp_sim::rng;
use hicp_tests::tabletop::{MaskKind, Tabletop};
use hicp_tests::{household, mean, median, points_of};
use hybrid_icp::core::Observation;
use hybrid_icp::{Preset, Refiner};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let cases: usize = arguments.next().map_or(Ok(1000), |text| text.parse())?;
    let objects = household(arguments.next().as_deref().unwrap_or("tuning"))?;
    let mask = arguments.next().unwrap_or_else(|| "exact".to_owned());
    let kind = MaskKind::ALL.into_iter().find(|kind| kind.name() == mask);
    let kind = kind.ok_or(format!("{mask}: not a kind of mask"))?;
    let stage = match arguments.next() {
        Some(name) => name.parse()?,
        None => Preset::Local,
    };
    let scenes = Tabletop::new(&objects)?;
    let points = points_of(&scenes);
    let names = ["search from a rough pose", "estimate"];
    let mut refiners = [Refiner::preset(Preset::Search), Refiner::preset(stage)];
    let (mut failed, mut times) = ([0_usize; 2], [Vec::new(), Vec::new()]);
    let (mut n, mut both, mut random) = (0, 0, rng(1));
    'scenes: for seed in 0.. {
        for seen in scenes.scene(seed)? {
            let (model, points) = (&scenes.objects[seen.model].1, &points[seen.model]);
            let rough = seen.near(&mut random, 1.0);
            let mut right = [false; 2];
            for (index, refiner) in refiners.iter_mut().enumerate() {
                let observation = seen.observe(kind)?;
                let (depth, mask) = (seen.depth.clone(), observation.mask().clone());
                let camera = *observation.camera();
                let start = Instant::now();
                let observation = Observation::new(depth, mask, camera)?;
                let refined = match index {
                    0 => refiner.refine(model, &observation, &rough),
                    _ => refiner.estimate(model, &observation),
                };
                times[index].push(start.elapsed().as_secs_f64() * 1e3);
                let error = points.mssd(&refined.outcome.camera_from_object, &seen.truth);
                right[index] = error < 0.1 * points.diameter();
                failed[index] += usize::from(!right[index]);
            }
            both += usize::from(!right[0] && !right[1]);
            n += 1;
            if n == cases {
                break 'scenes;
            }
        }
    }
    println!("{n} cases, masks: {mask}\n");
    println!("| pipeline | failed | time, median | mean |\n|---|---|---|---|");
    for (index, name) in names.iter().enumerate() {
        println!(
            "| {name} | {:.1} % | {:.1} ms | {:.1} ms |",
            100.0 * failed[index] as f64 / n as f64,
            median(&mut times[index]),
            mean(&times[index]),
        );
    }
    // The standard error of the difference of two paired shares.
    let only = failed.map(|count| (count - both) as f64);
    let [searched, estimated] = only;
    let percent = 100.0 / n as f64;
    println!(
        "\nDifference: {:+.1} points, 95 % interval ± {:.1}.",
        (estimated - searched) * percent,
        1.96 * (estimated + searched).sqrt() * percent
    );
    Ok(())
}

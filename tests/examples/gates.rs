//! Counts the right and wrong poses that a threshold on the MVE accepts, as a Markdown table.
//!
//! Run `cargo run --release -p hicp-tests --example gates [SCENES]`.
//!
//! The scenes show six objects on a table, with the depth noise of an Intel D435. The preset `auto`
//! refines each visible object in four ways: with its own model from a near start and from any
//! rotation, with its model in other proportions, and with the model of another object. A pose with
//! a warning is not accepted.

use hicp_sim::{
    AxialPolynomial, Clutter, DepthNoise, DepthSensor, Household, Proportions, perturb, rng,
    rotation,
};
use hybrid_icp::core::{Isometry3, Model, Observation, Translation3};
use hybrid_icp::score::ModelPoints;
use hybrid_icp::{Preset, Refiner};

/// A refined pose: its MVE, whether it has a warning, and whether it is right.
struct Judged {
    mve: f64,
    warned: bool,
    right: bool,
}

/// Fewest visible pixels of an object that is refined.
const LEAST_PIXELS: usize = 1500;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scenes: u64 = std::env::args()
        .nth(1)
        .map_or(Ok(40), |text| text.parse())?;
    let models = Household::ALL.map(Household::model);
    let models = models.into_iter().collect::<Result<Vec<_>, _>>()?;
    let others = Proportions {
        width: 1.12,
        height: 0.92,
    };
    let alike = Household::ALL.map(|object| object.model_with(others));
    let alike = alike.into_iter().collect::<Result<Vec<_>, _>>()?;
    let sensor = DepthSensor {
        noise: DepthNoise::Axial(AxialPolynomial::d435_ahn2019_axial()),
        ..DepthSensor::default()
    };
    let camera = hicp_tests::camera();
    let mut refiner = Refiner::preset(Preset::Auto);
    let mut judged: [Vec<Judged>; 4] = Default::default();
    for seed in 0..scenes {
        let mut random = rng(seed);
        let clutter = Clutter::draw(&mut random, &models, 6)?;
        let view = clutter.view(&mut random, &models, &camera, &sensor)?;
        for (place, seen) in view.instances.iter().enumerate() {
            let visible = seen.visible.pixels().iter().filter(|on| **on).count();
            if visible < LEAST_PIXELS {
                continue;
            }
            let observation = Observation::new(view.depth.clone(), seen.visible.clone(), camera)?;
            let truth = seen.camera_from_object;
            let other = (seen.model + 3 + 5 * place) % models.len();
            let near = perturb(&mut random, &truth, 0.0062, 9.5_f64.to_radians());
            let mut turned = |model: &Model| {
                let center = truth * models[seen.model].center();
                let turn = Isometry3::from_parts(Translation3::identity(), rotation(&mut random));
                let shift = center - turn * model.center();
                Translation3::from(shift) * turn
            };
            let tries = [
                (&models[seen.model], near),
                (&models[seen.model], turned(&models[seen.model])),
                (&alike[seen.model], near),
                (&models[other], turned(&models[other])),
            ];
            for (kind, (model, init)) in tries.into_iter().enumerate() {
                let refined = refiner.refine(model, &observation, &init);
                let pose = refined.outcome.camera_from_object;
                let mssd = ModelPoints::new(model).mssd(&pose, &truth);
                judged[kind].push(Judged {
                    mve: refined.mve,
                    warned: !refined.warnings().is_empty(),
                    right: kind < 2 && mssd < 0.1 * model.diameter(),
                });
            }
        }
    }

    println!(
        "| MVE below | near start: right, wrong | any rotation: right, wrong | look-alike | other class |"
    );
    println!("|---|---:|---:|---:|---:|");
    let line = |name: &str, accepts: &dyn Fn(&Judged) -> bool| {
        let cells = judged.iter().enumerate().map(|(kind, all)| {
            let share = |right: bool| {
                let accepted = all.iter().filter(|j| accepts(j) && j.right == right);
                format!(
                    "{:.1} %",
                    100.0 * accepted.count() as f64 / all.len() as f64
                )
            };
            match kind {
                0 | 1 => format!("{}, {}", share(true), share(false)),
                _ => share(false),
            }
        });
        println!("| {name} | {} |", cells.collect::<Vec<_>>().join(" | "));
    };
    for threshold in [0.05, 0.1, 0.15, 0.2, 0.3, 0.4] {
        line(&threshold.to_string(), &|j| j.mve < threshold && !j.warned);
    }
    line("no gate", &|_| true);
    println!("\n{} objects in {scenes} scenes.", judged[0].len());
    Ok(())
}

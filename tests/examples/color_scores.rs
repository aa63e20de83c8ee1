//! Compares formulations of the agreement of colors on simulated scenes of tuning objects.
//!
//! Run `cargo run --release -p hicp-tests --example color_scores [CASES] [hard]`.
//!
//! The objects are symmetric in depth, with textures. The agreement at the true pose is compared
//! with the best one at poses that look the same in depth. `hard` adds highlights and a shadow on
//! one half. Margins are differences of Fisher's z.

use hicp_sim::{Household, Lighting, Texture, stream};
use hicp_tests::painted::Painted;
use hicp_tests::points_of;
use hicp_tests::tabletop::MaskKind;
use hybrid_icp::core::{Context, Isometry3, Problem, RenderCache};
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::{ColorAgreement, SampledColor, Shading};

const OBJECTS: [Household; 4] = [
    Household::Bottle,
    Household::Plate,
    Household::Carton,
    Household::Pot,
];
const SHADINGS: [Shading; 3] = [Shading::Even, Shading::Directional, Shading::Local];
/// Largest number of other poses per case: with samples, and with renders.
const OTHERS: [usize; 2] = [64, 12];

/// The cases of a formulation.
#[derive(Default)]
struct Row {
    right: usize,
    margins: Vec<f64>,
    at_truth: Vec<f64>,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let cases: usize = arguments.next().map_or(Ok(100), |text| text.parse())?;
    let hard = arguments.next().is_some_and(|word| word == "hard");
    let painted = Painted::new(&OBJECTS, &[Texture::Stripes, Texture::Logos, Texture::Text])?;
    let objects = &painted.scenes.objects;
    let points = points_of(&painted.scenes);
    let mut rows: [Row; 6] = Default::default();
    let mut n = 0;
    'scenes: for seed in 0.. {
        for seen in painted.scenes.scene(seed)? {
            let mut lighting = Lighting::draw(&mut stream(seed, &["light"], n));
            if hard {
                (lighting.highlight, lighting.shadow, lighting.ambient) = (1.0, 0.4, 0.3);
            }
            let observation = painted.observe(&seen, MaskKind::Exact, &lighting, seed)?;
            let (model, points) = (&objects[seen.model].1, &points[seen.model]);
            let mut renders = RenderCache::new(Rasterizer::default());
            let mut context = Context::new(Problem::new(model, &observation), &mut renders);
            let poses = painted.motions[seen.model].iter();
            let apart =
                |pose: &Isometry3<f64>| points.mssd(pose, &seen.truth) > 0.1 * points.diameter();
            let poses: Vec<_> = poses.map(|m| seen.truth * m).filter(apart).collect();
            if poses.is_empty() {
                continue;
            }
            for (index, row) in rows.iter_mut().enumerate() {
                let (mut dense, mut sampled) = (ColorAgreement::default(), SampledColor::default());
                (dense.shading, sampled.shading) = (SHADINGS[index / 2], SHADINGS[index / 2]);
                let mut measure = |pose: &Isometry3<f64>| match index % 2 {
                    0 => sampled.measure(&context.problem, pose).correlation,
                    _ => dense.measure(&mut context, pose).correlation,
                };
                let at_truth = measure(&seen.truth);
                let step = poses.len().div_ceil(OTHERS[index % 2]);
                let others = poses.iter().step_by(step).map(measure);
                let best = others.fold(-1.0, f64::max);
                let z = |correlation: f64| correlation.clamp(-0.999, 0.999).atanh();
                row.right += usize::from(at_truth > best);
                row.margins.push(z(at_truth) - z(best));
                row.at_truth.push(at_truth);
            }
            n += 1;
            if n as usize == cases {
                break 'scenes;
            }
        }
    }
    println!("| shading | places | right | margin, 5 % | median | at truth, 5 % | median |");
    println!("|---|---|---|---|---|---|---|");
    for (index, row) in rows.iter_mut().enumerate() {
        let quantile = |values: &mut Vec<f64>, share: f64| {
            values.sort_by(f64::total_cmp);
            values[(share * (values.len() - 1) as f64) as usize]
        };
        println!(
            "| {:?} | {} | {:.1} % | {:.2} | {:.2} | {:.2} | {:.2} |",
            SHADINGS[index / 2],
            ["samples", "render"][index % 2],
            100.0 * row.right as f64 / n as f64,
            quantile(&mut row.margins, 0.05),
            quantile(&mut row.margins, 0.5),
            quantile(&mut row.at_truth, 0.05),
            quantile(&mut row.at_truth, 0.5),
        );
    }
    Ok(())
}

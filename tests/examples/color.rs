//! Compares pipelines with and without color on simulated scenes of textured objects.
//!
//! Run `cargo run --release -p hicp-tests --example color [CASES] [SET] [EVIDENCE] [WORDS]`.
//!
//! `SET` is `tuning` or `test`. With the word `plain`, the objects have no texture. With `refine`,
//! poses are not estimated from the mask alone. Times are those of the processor. `EVIDENCE` is
//! `right`, or a fault of the color image: `noisy` (50 gray levels), `other` (of another scene),
//! `swapped` (red and blue), `shadow`, `shifted` (by 5 pixels) or `overexposed`. A pose fails if
//! its MSSD is above a tenth of the diameter; no symmetry is declared. Half of the objects are
//! symmetric in depth.

use hicp_sim::{Lighting, Texture, stream};
use hicp_tests::painted::Painted;
use hicp_tests::tabletop::MaskKind;
use hicp_tests::{household, mean, median, points_of};
use hybrid_icp::core::{ColorImage, Isometry3, Observation, PixelRegion};
use hybrid_icp::icp::Alternative;
use hybrid_icp::{Preset, Refinement, Refiner, presets};

const FAULTS: [&str; 7] = [
    "right",
    "noisy",
    "other",
    "swapped",
    "shadow",
    "shifted",
    "overexposed",
];

/// The failures of a pipeline.
#[derive(Default)]
struct Row {
    failed: usize,
    in_depth: usize,
    turned: usize,
    ambiguous: usize,
    warned_wrongly: usize,
    /// Errors of the right poses, as shares of the diameter.
    errors: Vec<f64>,
    milliseconds: Vec<f64>,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let cases: usize = arguments.next().map_or(Ok(200), |text| text.parse())?;
    let objects = household(arguments.next().as_deref().unwrap_or("tuning"))?;
    let fault = arguments.next().unwrap_or_else(|| FAULTS[0].to_owned());
    if !FAULTS.contains(&fault.as_str()) {
        return Err(format!("{fault}: expected one of {FAULTS:?}").into());
    }
    let words: Vec<String> = arguments.collect();
    let has = |word: &str| words.iter().any(|given| given == word);
    let only_refine = has("refine");
    let textures = if has("plain") {
        vec![Texture::None]
    } else {
        vec![Texture::Logos, Texture::Text]
    };
    let painted = Painted::new(&objects, &textures)?;
    let scenes = &painted.scenes;
    let points = points_of(scenes);
    let mut searching = Refiner::boxed(presets::color());
    let mut estimating = Refiner::preset(Preset::Local);
    let mut auto = Refiner::preset(Preset::Auto);
    let mut local = Refiner::preset(Preset::Local);
    let names = ["auto", "color", "estimate", "estimate, then color"];
    let mut rows: [[Row; 4]; 2] = Default::default();
    let mut n = [0; 2];
    let mut by_depth = (0.0, Isometry3::identity());
    // Of `auto` and `color`, where color changes nothing and where it has a choice.
    let mut costs: [Vec<[f64; 2]>; 2] = Default::default();
    'scenes: for seed in 1000.. {
        for seen in scenes.scene(seed)? {
            let mut random = stream(seed, &["light"], n.iter().sum::<usize>() as u64);
            let mut lighting = Lighting::draw(&mut random);
            match fault.as_str() {
                "shadow" => lighting.shadow = 0.3,
                "noisy" => lighting.noise = 50.0,
                "overexposed" => lighting.exposure = 5.0,
                _ => {}
            }
            let model = &scenes.objects[seen.model].1;
            let right = painted.observe(&seen, MaskKind::Exact, &lighting, seed)?;
            let color = spoil(right.color().ok_or("no color")?, &fault);
            let create = || Observation::new(seen.depth.clone(), seen.visible.clone(), seen.camera);
            let (depth, colored) = (create()?, create()?.with_color(color)?);
            let init = seen.near(&mut random, 1.0);
            let symmetric = usize::from(painted.motions[seen.model].len() > 1);
            n[symmetric] += 1;
            for (index, row) in rows[symmetric].iter_mut().enumerate() {
                if only_refine && index > 1 {
                    continue;
                }
                let start = processor_time();
                let refined: Refinement = match index {
                    0 => auto.refine(model, &depth, &init),
                    1 => searching.refine(model, &colored, &init),
                    2 => local.estimate(model, &depth),
                    _ => estimating.estimate(model, &colored),
                };
                let milliseconds = processor_time() - start;
                row.milliseconds.push(milliseconds);
                if index == 0 {
                    by_depth = (milliseconds, refined.outcome.camera_from_object);
                }
                if index == 1 {
                    let ambiguous = |other: &Alternative| other.gap < Alternative::AMBIGUOUS_GAP;
                    let choice = searching.alternatives().iter().any(ambiguous);
                    let moved = refined.outcome.camera_from_object != by_depth.1;
                    costs[usize::from(choice || moved)].push([by_depth.0, milliseconds]);
                }
                let error =
                    points[seen.model].mssd(&refined.outcome.camera_from_object, &seen.truth);
                let error = error / points[seen.model].diameter();
                let failed = error > 0.1;
                if !failed {
                    row.errors.push(error);
                }
                let ambiguous = refined.runner_up.is_some_and(|other| other.is_ambiguous());
                row.failed += usize::from(failed);
                row.ambiguous += usize::from(ambiguous);
                row.warned_wrongly += usize::from(ambiguous && !failed);
                let pose = refined.outcome.camera_from_object;
                let motions = painted.motions[seen.model].iter();
                let in_depth = motions
                    .map(|motion| points[seen.model].mssd(&(seen.truth * motion), &pose))
                    .fold(f64::INFINITY, f64::min);
                let fits = in_depth < 0.1 * points[seen.model].diameter();
                row.in_depth += usize::from(fits);
                row.turned += usize::from(fits && failed);
            }
            if n.iter().sum::<usize>() == cases {
                break 'scenes;
            }
        }
    }
    println!(
        "| objects | pipeline | failed | right in depth, but turned | ambiguous | ambiguous and right | error of the right, median | 90 % | ms, median | mean |\n|---|---|---|---|---|---|---|---|---|---|"
    );
    for (kind, (rows, n)) in ["others", "symmetric in depth"]
        .iter()
        .zip(rows.iter_mut().zip(n))
    {
        let pipelines = if only_refine { 2 } else { 4 };
        for (name, row) in names.iter().zip(rows).take(pipelines) {
            let percent = |count: usize| 100.0 * count as f64 / n.max(1) as f64;
            let mean = mean(&row.milliseconds);
            row.errors.sort_by(f64::total_cmp);
            let error = |share: f64| {
                let index = share * row.errors.len().saturating_sub(1) as f64;
                100.0 * row.errors.get(index as usize).copied().unwrap_or(f64::NAN)
            };
            println!(
                "| {kind}: {n} | {name} | {:.1} % | {:.1} % | {:.1} % | {:.1} % | {:.2} % | {:.2} % | {:.1} | {mean:.1} |",
                percent(row.failed),
                100.0 * row.turned as f64 / row.in_depth.max(1) as f64,
                percent(row.ambiguous),
                percent(row.warned_wrongly),
                error(0.5),
                error(0.9),
                median(&mut row.milliseconds)
            );
        }
    }
    println!(
        "\n| color | cases | auto, ms | ratio | ms more, median | mean |\n|---|---|---|---|---|---|"
    );
    for (kind, costs) in ["changes nothing", "has a choice"].iter().zip(&costs) {
        let mut auto: Vec<f64> = costs.iter().map(|[auto, _]| *auto).collect();
        let mut ratios: Vec<f64> = costs.iter().map(|[auto, color]| color / auto).collect();
        let mut more: Vec<f64> = costs.iter().map(|[auto, color]| color - auto).collect();
        let mean = mean(&more);
        let (auto, ratio, more) = (median(&mut auto), median(&mut ratios), median(&mut more));
        println!(
            "| {kind} | {} | {auto:.1} | {ratio:.2} | {more:.1} | {mean:.1} |",
            costs.len()
        );
    }
    Ok(())
}

/// Returns the processor time of this thread, milliseconds.
#[cfg(unix)]
fn processor_time() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 * 1e-6
}

/// Returns the time, milliseconds. Only Unix has a portable clock of a thread.
#[cfg(not(unix))]
fn processor_time() -> f64 {
    let epoch = std::time::UNIX_EPOCH.elapsed().unwrap_or_default();
    epoch.as_secs_f64() * 1e3
}

/// Returns the color image with a fault.
fn spoil(color: &ColorImage, fault: &str) -> ColorImage {
    let (width, height) = (color.width(), color.height());
    let at = |u: u32, v: u32| color.get(u % width, v % height).unwrap_or_default();
    let pixels = PixelRegion::of_image(width, height).pixels();
    let pixels = pixels.map(|(u, v)| match fault {
        "other" => at(width - 1 - u, height - 1 - v),
        "swapped" => {
            let [r, g, b] = at(u, v);
            [b, g, r]
        }
        "shifted" => at(u + 4, v + 3),
        _ => at(u, v),
    });
    ColorImage::new(width, height, pixels.collect()).expect("the same size")
}

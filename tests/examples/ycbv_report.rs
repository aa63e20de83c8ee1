//! Refines the estimates of four detectors on five real YCB-Video frames with every preset.
//!
//! The table shows the median ADI and MVE before and after, and the error of refinements that start
//! at the ground truth. Times are relative to nn-point-to-point. It shows the ratios of medians and
//! of means, because a search that runs for few rows changes the mean only.
//!
//! Run `cargo run --release -p hicp-tests --example ycbv_report`.

use std::collections::BTreeMap;
use std::time::Instant;

use hicp_io::bop::{Dataset, read_results};
use hicp_tests::median;
use hicp_tests::ycbv::{Instance, instances, root};
use hybrid_icp::core::Isometry3;
use hybrid_icp::score::adi;
use hybrid_icp::{Preset, Refiner};

const ESTIMATORS: [(&str, &str); 4] = [
    ("CosyPose", "cosypose_ycbv-test.csv"),
    ("PoseCNN", "posecnn-rss2018_ycbv-test.csv"),
    ("AAE", "sundermeyer_ycbv-test.csv"),
    ("PoseCNN+ICP", "posecnn-icp-rss2018_ycbv-test.csv"),
];

fn main() {
    let Some(root) = root() else {
        eprintln!("skipped: no ycbv dataset; set BOP_PATH to the folder that holds it");
        return;
    };
    let dataset = Dataset::open(&root).expect("the dataset opens");
    let instances = instances(&dataset);
    let adi_mm = |instance: &Instance, pose: &Isometry3<f64>| {
        1e3 * adi(pose, &instance.truth, instance.model.mesh().vertices())
    };

    println!(
        "| pipeline | {} | from truth: max ADI mm | ms median | time, ratio of medians | of means | without observing, ratio |",
        ESTIMATORS
            .map(|(name, _)| format!("{name} ADI mm | MVE"))
            .join(" | ")
    );
    println!(
        "|---|{}---|---|---|---|---|",
        "---|---|".repeat(ESTIMATORS.len())
    );
    let starts: Vec<Vec<(usize, Isometry3<f64>)>> = ESTIMATORS
        .iter()
        .map(|(_, file)| {
            read_results(root.join("results").join(file))
                .expect("the results read")
                .iter()
                .map(|row| {
                    let key = (row.scene_id, row.im_id, row.obj_id);
                    let index = instances.iter().position(|i| i.key == key);
                    (index.expect("an instance"), row.camera_from_object())
                })
                .collect()
        })
        .collect();

    let (mut baseline, mut mean_baseline, mut refine_baseline) = (0.0, 0.0, 0.0);
    let mut lines = BTreeMap::new();
    let mut order = Preset::ALL.to_vec();
    // The baseline of the time ratios runs first.
    order.sort_by_key(|p| *p != Preset::NnPointToPoint);
    for preset in order {
        let mut cells = Vec::new();
        let (mut times, mut refine_times) = (Vec::new(), Vec::new());
        for starts in &starts {
            let (mut errors, mut scores) = (Vec::new(), Vec::new());
            for (index, init) in starts {
                let instance = &instances[*index];
                // A new observation each time, so that the time includes normals and trees.
                let mut refiner = Refiner::preset(preset);
                let start = Instant::now();
                let observation = instance.observe();
                let observed = Instant::now();
                let refined = refiner.refine(&instance.model, &observation, init);
                times.push(start.elapsed().as_secs_f64() * 1e3);
                refine_times.push(observed.elapsed().as_secs_f64() * 1e3);
                let pose = refined.outcome.camera_from_object;
                assert!(pose.translation.vector.iter().all(|x| x.is_finite()));
                errors.push(adi_mm(instance, &pose));
                scores.push(refined.mve);
            }
            cells.push(format!(
                "{:.2} | {:.3}",
                median(&mut errors),
                median(&mut scores)
            ));
        }
        let from_truth = instances
            .iter()
            .map(|instance| {
                let mut refiner = Refiner::preset(preset);
                let refined = refiner.refine(&instance.model, &instance.observe(), &instance.truth);
                adi_mm(instance, &refined.outcome.camera_from_object)
            })
            .fold(0.0, f64::max);
        let mean_time = times.iter().sum::<f64>() / times.len() as f64;
        let time = median(&mut times);
        let refine_time = median(&mut refine_times);
        if preset == Preset::NnPointToPoint {
            (baseline, mean_baseline, refine_baseline) = (time, mean_time, refine_time);
        }
        lines.insert(
            Preset::ALL.iter().position(|p| *p == preset),
            format!(
                "| {preset} | {} | {from_truth:.2} | {time:.2} | {:.2} | {:.2} | {:.2} |",
                cells.join(" | "),
                time / baseline,
                mean_time / mean_baseline,
                refine_time / refine_baseline
            ),
        );
    }
    let mut cells = Vec::new();
    for starts in &starts {
        let (mut errors, mut scores) = (Vec::new(), Vec::new());
        for (index, init) in starts {
            let instance = &instances[*index];
            errors.push(adi_mm(instance, init));
            scores.push(Refiner::preset(Preset::Hybrid).mve(
                &instance.model,
                &instance.observe(),
                init,
            ));
        }
        cells.push(format!(
            "{:.2} | {:.3}",
            median(&mut errors),
            median(&mut scores)
        ));
    }
    println!("| initial | {} | 0 | | | | |", cells.join(" | "));
    for line in lines.values() {
        println!("{line}");
    }
}

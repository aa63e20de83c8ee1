//! Refines the estimates of four detectors on five real YCB-Video frames with every preset.
//!
//! The table shows the median ADI and MVE before and after, and the error of refinements that start
//! at the ground truth. Its last columns are the shares of all estimates with an MSSD below a tenth
//! of the diameter, and of those of objects without symmetries with such an ADD. The row ray-shift
//! moves the estimate along its viewing ray by the median depth difference. Times are relative to
//! nn-point-to-point. It shows the ratios of medians and of means, because a search that runs for
//! few rows changes the mean only.
//!
//! Run `cargo run --release -p hicp-tests --example ycbv_report`.

use std::collections::BTreeMap;
use std::time::Instant;

use hicp_io::bop::{Dataset, read_results};
use hicp_tests::ycbv::{Instance, instances, root};
use hicp_tests::{mean, median};
use hybrid_icp::core::Isometry3;
use hybrid_icp::icp::RayShift;
use hybrid_icp::score::{ModelPoints, adi};
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
        "| pipeline | {} | from truth: max ADI mm | ms median | time, ratio of medians | of means | without observing, ratio | MSSD < 0.1 d | ADD < 0.1 d |",
        ESTIMATORS
            .map(|(name, _)| format!("{name} ADI mm | MVE"))
            .join(" | ")
    );
    println!(
        "|---|{}---|---|---|---|---|---|---|",
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

    let points: Vec<ModelPoints> = instances
        .iter()
        .map(|i| ModelPoints::new(&i.model))
        .collect();
    let (mut baseline, mut mean_baseline, mut refine_baseline) = (0.0, 0.0, 0.0);
    let mut lines = BTreeMap::new();
    let mut order: Vec<Option<Preset>> = Preset::ALL.map(Some).to_vec();
    // The baseline of the time ratios runs first.
    order.sort_by_key(|p| *p != Some(Preset::NnPointToPoint));
    order.push(None);
    for preset in order {
        let create = || match preset {
            Some(preset) => Refiner::preset(preset),
            None => Refiner::boxed(RayShift::default()),
        };
        let mut success = Success::default();
        let mut cells = Vec::new();
        let (mut times, mut refine_times) = (Vec::new(), Vec::new());
        for starts in &starts {
            let (mut errors, mut scores) = (Vec::new(), Vec::new());
            for (index, init) in starts {
                let instance = &instances[*index];
                // A new observation each time, so that the time includes normals and trees.
                let mut refiner = create();
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
                success.count(&points[*index], &pose, &instance.truth);
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
                let mut refiner = create();
                let refined = refiner.refine(&instance.model, &instance.observe(), &instance.truth);
                adi_mm(instance, &refined.outcome.camera_from_object)
            })
            .fold(0.0, f64::max);
        let mean_time = mean(&times);
        let time = median(&mut times);
        let refine_time = median(&mut refine_times);
        if preset == Some(Preset::NnPointToPoint) {
            (baseline, mean_baseline, refine_baseline) = (time, mean_time, refine_time);
        }
        lines.insert(
            Preset::ALL.iter().position(|p| Some(*p) == preset),
            format!(
                "| {} | {} | {from_truth:.2} | {time:.2} | {:.2} | {:.2} | {:.2} | {} |",
                preset.map_or("ray-shift", Preset::name),
                cells.join(" | "),
                time / baseline,
                mean_time / mean_baseline,
                refine_time / refine_baseline,
                success.cells()
            ),
        );
    }
    let mut cells = Vec::new();
    let mut success = Success::default();
    for starts in &starts {
        let (mut errors, mut scores) = (Vec::new(), Vec::new());
        for (index, init) in starts {
            let instance = &instances[*index];
            success.count(&points[*index], init, &instance.truth);
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
    let success = success.cells();
    println!(
        "| initial | {} | 0 | | | | | {success} |",
        cells.join(" | ")
    );
    for line in lines.values() {
        println!("{line}");
    }
}

/// The estimates within a tenth of the diameter.
#[derive(Default)]
struct Success {
    mssd: usize,
    all: usize,
    add: usize,
    asymmetric: usize,
}

impl Success {
    fn count(&mut self, points: &ModelPoints, pose: &Isometry3<f64>, truth: &Isometry3<f64>) {
        let limit = 0.1 * points.diameter();
        self.all += 1;
        self.mssd += usize::from(points.mssd(pose, truth) < limit);
        if !points.is_symmetric() {
            self.asymmetric += 1;
            self.add += usize::from(points.add(pose, truth) < limit);
        }
    }

    fn cells(&self) -> String {
        let percent = |count: usize, of: usize| 100.0 * count as f64 / of.max(1) as f64;
        let (mssd, add) = (
            percent(self.mssd, self.all),
            percent(self.add, self.asymmetric),
        );
        format!("{mssd:.1} % | {add:.1} %")
    }
}

//! Compares refinements with imperfect masks to refinements with exact ones, as Markdown tables.
//!
//! Run `cargo run --release -p hicp-tests --example masks [CASES] [SET] [PIPELINE…]`. SET is
//! `tuning`, `test`, `ycbv` or `ycbv-near`. A pipeline is a preset or a TOML file; the default is
//! `local` and `auto`.
//!
//! The cases are the visible objects of `hicp_tests::tabletop`. Each starts at the mean error of an
//! estimator (6.2 mm, 9.5°), every fourth at twice that. With `ycbv`, they are the estimates of
//! four detectors on real frames. With `ycbv-near`, they are the true poses on these frames, each
//! perturbed CASES times by the same error. A pose has failed if its MSSD is above 0.1 diameters,
//! up to declared symmetries. Differences to the exact mask are paired. The score is that of
//! imperfect masks.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use hicp_io::bop::{Dataset, read_results};
use hicp_sim::{Household, perturb, stream};
use hicp_tests::tabletop::{MaskKind, Tabletop};
use hicp_tests::{mean, median};
use hybrid_icp::core::{Isometry3, Model, Observation, Problem};
use hybrid_icp::icp::{BoxedStage, Workspace};
use hybrid_icp::pipeline::PipelineFile;
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::{MeanVsd, ModelPoints, Score};
use hybrid_icp::{Preset, Refiner};

type Failure = Box<dyn std::error::Error>;

/// The results of a pipeline with a kind of mask.
#[derive(Clone, Default)]
struct Results {
    failed: Vec<bool>,
    /// Errors of the right poses, percent of the diameter.
    errors: Vec<f64>,
    milliseconds: Vec<f64>,
}

/// All pipelines with all kinds of masks.
struct Study {
    refiners: Vec<(String, Refiner<BoxedStage>, Vec<Results>)>,
    workspace: Workspace,
    /// Scores of the true pose, by kind of mask.
    scores: Vec<Vec<f64>>,
    done: usize,
}

impl Study {
    fn new(pipelines: Vec<(String, BoxedStage)>) -> Self {
        let kinds = MaskKind::ALL.len();
        let results = || vec![Results::default(); kinds];
        let refiners = pipelines.into_iter();
        Self {
            refiners: refiners
                .map(|(name, stage)| (name, Refiner::new(stage), results()))
                .collect(),
            workspace: Workspace::new(Rasterizer::default()),
            scores: vec![Vec::new(); kinds],
            done: 0,
        }
    }

    /// Refines a pose with every pipeline and kind of mask.
    fn add(
        &mut self,
        model: &Model,
        exact: &Observation,
        truth: &Isometry3<f64>,
        init: &Isometry3<f64>,
    ) -> Result<(), Failure> {
        let points = ModelPoints::new(model);
        self.done += 1;
        for (index, kind) in MaskKind::ALL.into_iter().enumerate() {
            let mask = kind.apply(exact.mask())?;
            // A new observation each time, so that the time includes everything it derives.
            let observe = || {
                let depth = Arc::clone(exact.shared_depth());
                Observation::new(depth, mask.clone(), *exact.camera())
            };
            let observation = observe()?;
            let mut context = self.workspace.context(&Problem::new(model, &observation));
            self.scores[index].push(MeanVsd::imperfect_mask().score(&mut context, truth));
            for (_, refiner, results) in &mut self.refiners {
                let start = Instant::now();
                let observation = observe()?;
                let refined = refiner.refine(model, &observation, init);
                let time = start.elapsed().as_secs_f64() * 1e3;
                results[index].milliseconds.push(time);
                let mssd = points.mssd(&refined.outcome.camera_from_object, truth);
                let error = 100.0 * mssd / model.diameter();
                results[index].failed.push(error > 10.0);
                results[index]
                    .errors
                    .extend(Some(error).filter(|error| *error <= 10.0));
            }
        }
        Ok(())
    }

    fn print(&mut self) {
        println!("{} cases per kind of mask.\n", self.done);
        for (name, _, results) in &self.refiners {
            println!(
                "| `{name}`: mask | failed % | difference, points, 95 % | error of the right poses, % of d | ms | time ratio | score of the true pose |"
            );
            println!("|---|---:|---:|---:|---:|---:|---:|");
            let exact = &results[0];
            for (index, results) in results.iter().enumerate() {
                let pairs = results.failed.iter().zip(&exact.failed);
                let differences: Vec<f64> = pairs
                    .map(|(a, b)| 100.0 * (f64::from(u8::from(*a)) - f64::from(u8::from(*b))))
                    .collect();
                let n = differences.len() as f64;
                let difference = mean(&differences);
                let squares = differences.iter().map(|d| (d - difference).powi(2));
                let half = 1.96 * (squares.sum::<f64>() / (n * (n - 1.0))).sqrt();
                let failed = results.failed.iter().filter(|failed| **failed).count();
                let time = mean(&results.milliseconds);
                println!(
                    "| {} | {:.2} | {difference:+.2} ± {half:.2} | {:.2} | {time:.2} | {:.2} | {:.3} |",
                    MaskKind::ALL[index].name(),
                    100.0 * failed as f64 / n,
                    mean(&results.errors),
                    time / mean(&exact.milliseconds),
                    median(&mut self.scores[index]),
                );
            }
            println!();
        }
    }
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let cases = arguments.first().map_or(Ok(2000), |text| text.parse())?;
    let names = match arguments.get(2..) {
        Some(names) if !names.is_empty() => names.to_vec(),
        _ => vec!["local".to_owned(), "auto".to_owned()],
    };
    let pipelines: Result<Vec<_>, Failure> = names.into_iter().map(pipeline).collect();
    let mut study = Study::new(pipelines?);
    match arguments.get(1).map(String::as_str) {
        Some("ycbv") => real(&mut study)?,
        Some("ycbv-near") => perturbed(&mut study, cases)?,
        Some("tuning") => simulated(&mut study, &Household::TUNING, 0, cases)?,
        _ => simulated(&mut study, &Household::TEST, 1_000_000, cases)?,
    }
    study.print();
    Ok(())
}

/// Builds a preset or the pipeline of a file.
fn pipeline(name: String) -> Result<(String, BoxedStage), Failure> {
    let stage = match name.parse::<Preset>() {
        Ok(preset) => preset.build(),
        Err(_) => PipelineFile::read(&name)?.build()?,
    };
    Ok((name, stage))
}

fn simulated(
    study: &mut Study,
    objects: &[Household],
    first_seed: u64,
    cases: usize,
) -> Result<(), Failure> {
    let tabletop = Tabletop::new(objects)?;
    for seed in first_seed.. {
        if study.done >= cases {
            break;
        }
        for (index, seen) in (0..).zip(tabletop.scene(seed)?) {
            let mut random = stream(seed, &["start"], index);
            let init = seen.near(&mut random, if study.done % 4 == 3 { 2.0 } else { 1.0 });
            let model = &tabletop.objects[seen.model].1;
            study.add(model, &seen.observe(MaskKind::Exact)?, &seen.truth, &init)?;
        }
    }
    Ok(())
}

/// Returns the folder of the real frames.
fn root() -> Result<PathBuf, Failure> {
    Ok(hicp_tests::ycbv::root().ok_or("no ycbv dataset; set BOP_PATH to its folder")?)
}

fn perturbed(study: &mut Study, starts: usize) -> Result<(), Failure> {
    let instances = hicp_tests::ycbv::instances(&Dataset::open(root()?)?);
    for (index, instance) in (0..).zip(&instances) {
        for start in 0..starts as u64 {
            let mut random = stream(start, &["perturbed"], index);
            let init = perturb(&mut random, &instance.truth, 0.0062, 9.5_f64.to_radians());
            study.add(&instance.model, &instance.observe(), &instance.truth, &init)?;
        }
    }
    Ok(())
}

fn real(study: &mut Study) -> Result<(), Failure> {
    let root = root()?;
    let instances = hicp_tests::ycbv::instances(&Dataset::open(&root)?);
    for name in [
        "cosypose_ycbv-test.csv",
        "posecnn-rss2018_ycbv-test.csv",
        "sundermeyer_ycbv-test.csv",
        "posecnn-icp-rss2018_ycbv-test.csv",
    ] {
        for row in read_results(root.join("results").join(name))? {
            let key = (row.scene_id, row.im_id, row.obj_id);
            let instance = instances.iter().find(|instance| instance.key == key);
            let instance = instance.ok_or("an estimate without ground truth")?;
            let init = row.camera_from_object();
            study.add(&instance.model, &instance.observe(), &instance.truth, &init)?;
        }
    }
    Ok(())
}

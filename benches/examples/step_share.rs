//! What a step of the sequential estimator costs beyond the ICP inside it, as a share of that ICP, and what fusing ten estimates costs.
//!
//! `cargo run --release -p hicp-benches --example step_share [ROUNDS]`: 200 rounds along ten images unless told otherwise; medians over
//! the rounds at the tenth image. The step is timed with a stage that hands out recorded outcomes, so that its share is no difference of
//! two large numbers. Where the fuser or the gate asks for the MVE, its render and score are told apart: they judge the image, as the
//! stages of a pipeline that switches do themselves.
#![allow(
    clippy::print_stdout,
    clippy::cast_precision_loss,
    reason = "an example shows its results"
)]

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use hicp_sim::{AxialPolynomial, Household, perturb, rng};
use hybrid_icp::core::{Isometry3, Mask, Model, Observation, PinholeCamera, Problem, Vector3};
use hybrid_icp::fusion::{
    BoxedFuser, CameraMotion, CovarianceModel, FuserConfig, Fusion, FusionLimits, FusionMethod,
    Gated, MveCovariance, PoseEstimate, SharedError, SymmetryAware, UnitCovariance,
};
use hybrid_icp::icp::{Outcome, Session, Stage};
use hybrid_icp::raster::render_depth_image;
use hybrid_icp::score::MeanVsd;
use hybrid_icp::{BoxedStage, Calibration, Preset, SequentialConfig, SequentialEstimator};

type Failed = Box<dyn std::error::Error>;

const IMAGES: usize = 10;

/// An object that a camera approaches.
struct Approach {
    model: Model,
    images: Vec<(Observation, CameraMotion)>,
    init: Isometry3<f64>,
}

/// Outcomes of a stage, one per image.
type Tape = Arc<Mutex<Vec<Outcome>>>;

/// Runs a stage, keeps what it returns and how long it takes.
struct Recorder {
    stage: BoxedStage,
    tape: Tape,
    seconds: Arc<Mutex<Vec<f64>>>,
}

/// Returns what was recorded, in turn.
struct Player {
    tape: Tape,
    next: usize,
}

impl Stage for Recorder {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        let start = Instant::now();
        let outcome = self.stage.run(problem, init, session);
        let seconds = start.elapsed().as_secs_f64();
        let mut all = self.seconds.lock().unwrap_or_else(PoisonError::into_inner);
        all.push(seconds);
        let mut tape = self.tape.lock().unwrap_or_else(PoisonError::into_inner);
        if tape.len() < IMAGES {
            tape.push(outcome);
        }
        outcome
    }
}

impl Stage for Player {
    fn run(&mut self, _: &Problem<'_>, _: &Isometry3<f64>, _: &mut Session<'_>) -> Outcome {
        let tape = self.tape.lock().unwrap_or_else(PoisonError::into_inner);
        let outcome = tape[self.next % tape.len()];
        self.next += 1;
        outcome
    }
}

fn main() -> Result<(), Failed> {
    let rounds: usize = std::env::args()
        .nth(1)
        .map_or(Ok(200), |text| text.parse())?;
    let approach = Approach::new()?;
    println!("fusing 10 estimates: {:.1} µs", fusing(rounds)?);
    println!(
        "{:31} {:30} {:>9} {:>9} {:>7} {:>9}",
        "pipeline", "method", "ICP, µs", "step, µs", "share", "with MVE"
    );
    for preset in [Preset::ProjectiveCascadePointPlane, Preset::Hybrid] {
        for method in FusionMethod::ALL {
            measure(&approach, preset, method, false, rounds)?;
        }
        measure(
            &approach,
            preset,
            FusionMethod::WeightedAverage,
            true,
            rounds,
        )?;
    }
    Ok(())
}

impl Approach {
    /// A mug from 60 cm, 2 cm nearer with every image, with a D435's noise.
    fn new() -> Result<Self, Failed> {
        let camera = PinholeCamera::new(572.4, 573.6, 325.3, 242.0, 640, 480)?;
        let model = Household::Mug.model()?;
        let mut random = rng(11);
        let mut truth =
            Isometry3::new(Vector3::new(0.01, -0.01, 0.6), Vector3::new(2.1, 0.7, -0.4));
        let init = perturb(&mut random, &truth, 0.0062, 9.5_f64.to_radians());
        let mut images = Vec::new();
        for image in 0..IMAGES {
            let motion = match image {
                0 => CameraMotion::none(),
                _ => CameraMotion::new(Isometry3::translation(0.0, 0.0, -0.02))?,
            };
            truth = motion.apply(&truth);
            let depth = render_depth_image(model.mesh(), &camera, &truth);
            let seen = depth.pixels().iter().map(|z| *z > 0.0).collect();
            let mask = Mask::new(camera.width(), camera.height(), seen)?;
            let depth = AxialPolynomial::d435_ahn2019_axial().apply(&mut random, &depth);
            images.push((Observation::new(depth, mask, camera)?, motion));
        }
        Ok(Self {
            model,
            images,
            init,
        })
    }

    fn unit(&self) -> Result<UnitCovariance, Failed> {
        Ok(UnitCovariance::about_object(
            self.model.center(),
            self.model.radius(),
        )?)
    }

    fn estimator(
        &self,
        stage: impl Stage + Send + 'static,
        method: FusionMethod,
        calibration: Option<Calibration>,
        score: Option<MeanVsd>,
    ) -> Result<SequentialEstimator, Failed> {
        let unit = self.unit()?;
        let fuser = method.build(FuserConfig {
            unit,
            ..FuserConfig::default()
        });
        let mve = CovarianceModel::Mve(MveCovariance {
            unit,
            ..MveCovariance::default()
        });
        let (fuser, covariance): (BoxedFuser, _) = match calibration {
            None => (fuser, mve),
            // As `SequentialEstimator::calibrated`, which always scores.
            Some(calibration) => {
                let gated = Gated::new(fuser, calibration.gate)?;
                let shared = SharedError::new(gated, unit, calibration.shared)?;
                let (model, center) = (&self.model, self.model.center());
                let symmetries = model.symmetries().clone();
                let fuser = SymmetryAware::new(shared, symmetries, center, model.radius())?;
                let covariance = CovarianceModel::Inflated(calibration.covariance(unit));
                (Box::new(fuser), covariance)
            }
        };
        let config = SequentialConfig { covariance, score };
        Ok(SequentialEstimator::new(stage, fuser, config, &self.init)?)
    }

    /// Seconds of the step at the last image, per round.
    fn run(&self, estimator: &mut SequentialEstimator, rounds: usize) -> Result<Vec<f64>, Failed> {
        let mut seconds = Vec::new();
        for _ in 0..rounds {
            estimator.restart(&self.init)?;
            let mut last = 0.0;
            for (observation, motion) in &self.images {
                let start = Instant::now();
                std::hint::black_box(estimator.step(&self.model, observation, motion));
                last = start.elapsed().as_secs_f64();
            }
            seconds.push(last);
        }
        Ok(seconds)
    }
}

/// Prints a line of the table.
fn measure(
    approach: &Approach,
    preset: Preset,
    method: FusionMethod,
    calibrated: bool,
    rounds: usize,
) -> Result<(), Failed> {
    let calibration = calibrated.then(|| Calibration::of(preset));
    let (tape, seconds) = (Tape::default(), Arc::default());
    let recorder = Recorder {
        stage: preset.build(),
        tape: Arc::clone(&tape),
        seconds: Arc::clone(&seconds),
    };
    let mut estimator =
        approach.estimator(recorder, method, calibration, Some(MeanVsd::default()))?;
    approach.run(&mut estimator, rounds.div_ceil(10))?;
    let all = seconds.lock().unwrap_or_else(PoisonError::into_inner);
    let icp = median(all.iter().skip(IMAGES - 1).step_by(IMAGES).copied());
    let play = |score| {
        let player = Player {
            tape: Arc::clone(&tape),
            next: 0,
        };
        let mut estimator = approach.estimator(player, method, calibration, score)?;
        Ok::<_, Failed>(median(approach.run(&mut estimator, rounds)?.into_iter()))
    };
    let (bare, scored) = (play(None)?, play(Some(MeanVsd::default()))?);
    let prefix = if calibrated { "calibrated-" } else { "" };
    let name = format!("{prefix}{method}");
    println!(
        "{:31} {name:30} {:9.0} {:9.2} {:6.2}% {:8.1}%",
        preset.name(),
        icp * 1e6,
        bare * 1e6,
        100.0 * bare / icp,
        100.0 * scored / icp
    );
    Ok(())
}

/// Microseconds for inverting ten covariances and solving from the first pose: estimates 4 mm and 4° apart, of unequal uncertainty.
fn fusing(rounds: usize) -> Result<f64, Failed> {
    let approach = Approach::new()?;
    let (unit, mut random) = (approach.unit()?, rng(7));
    let mut estimates = Vec::new();
    for k in 0..10 {
        let pose = perturb(&mut random, &approach.init, 0.004, 4.0_f64.to_radians());
        let mve = 0.05 + 0.02 * f64::from(k);
        estimates.push(PoseEstimate::new(pose, unit.at(&pose) * mve)?);
    }
    let mut fusion = Fusion::new(FusionLimits::default());
    let seconds = (0..rounds.max(10)).map(|_| {
        let start = Instant::now();
        fusion.clear();
        for estimate in std::hint::black_box(&estimates) {
            fusion.push(estimate);
        }
        std::hint::black_box(fusion.solve(estimates[0].camera_from_object()));
        start.elapsed().as_secs_f64()
    });
    Ok(1e6 * median(seconds))
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

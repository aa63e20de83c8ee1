//! Fits `Calibration` on the tuning objects and prints how well the covariances match the errors.
//!
//! It prints the share of single-image errors inside the 50, 90 and 99 % ellipsoids, before and
//! after the fit, on the tuning and on the test objects.
//!
//! Run it with `cargo run --release -p hicp-experiments --example calibration [TRAJECTORIES]`. The
//! argument is the number of trajectories per object, 10 by default. Trajectories are those of the
//! sequential study (starts in ten bins, a D435's axial noise, reconstructions from such images
//! with camera poses off by 5 mm and 1.1°), with another seed. Objects with a continuous symmetry
//! and estimates that the calibrated gate rejects are left out.
#![allow(clippy::print_stdout, reason = "an example shows its results")]

use hicp_core::{Isometry3, Matrix6, Vector6, se3};
use hicp_experiments::{Subject, TrajectoryConfig, TrajectoryStep, watch_trajectories};
use hicp_sim::Household;
use hybrid_icp::fusion::{InflatedCovariance, MveCovariance, UnitCovariance, probability_within};
use hybrid_icp::{Calibration, Preset};

type Failed = Box<dyn std::error::Error>;

const SEED: u64 = 5;
/// Seconds per estimate. All pipelines get the same number of images.
const SECONDS: f64 = 0.3;

/// An estimate and its error.
struct Sample {
    /// The object, and the index of the trajectory.
    trajectory: (String, u64),
    pose: Isometry3<f64>,
    truth: Isometry3<f64>,
    error: Vector6<f64>,
    unit: UnitCovariance,
    mve: f64,
    registration: Option<Matrix6<f64>>,
}

fn main() -> Result<(), Failed> {
    let trajectories = std::env::args()
        .nth(1)
        .map_or(Ok(10), |text| text.parse())?;
    for preset in [
        Preset::Hybrid,
        Preset::ProjectiveCascadePointPlane,
        Preset::Auto,
    ] {
        let shipped = Calibration::of(preset);
        let tuning = samples(&Household::TUNING, preset, trajectories)?;
        let test = samples(&Household::TEST, preset, trajectories)?;
        println!("{preset}: {} and {} estimates", tuning.len(), test.len());
        let scatter = fit(shipped, &[|m| &mut m.scale, |m| &mut m.floor], |model| {
            scatter_loss(&tuning, model)
        });
        println!(
            "  scatter along a trajectory: scale {:.2}, floor {:.4}",
            scatter.scale, scatter.floor
        );
        let shared: [Factor; 3] = [|m| &mut m.shared, |m| &mut m.mve_gain, |m| &mut m.mve_power];
        let fitted = fit(shipped, &shared, |model| total_loss(&tuning, model));
        println!(
            "  errors, with scale {} and floor {}: shared {:.4}, gain {:.1}, power {:.2}",
            fitted.scale, fitted.floor, fitted.shared, fitted.mve_gain, fitted.mve_power
        );
        for (name, samples) in [("tuning", &tuning), ("test", &test)] {
            show(name, "e_MVE·U", samples, f64::INFINITY, |s| {
                let model = MveCovariance {
                    unit: s.unit,
                    ..MveCovariance::default()
                };
                model.covariance(&s.pose, Some(s.mve))
            });
            show(name, "uncalibrated", samples, f64::INFINITY, |s| {
                let model = InflatedCovariance::uncalibrated(s.unit);
                model.covariance(&s.pose, Some(s.mve), s.registration.as_ref())
            });
            for (label, model) in [("fitted", fitted), ("shipped", shipped)] {
                let nu = model.degrees_of_freedom;
                show(name, label, samples, nu, |s| total(&model, s));
            }
        }
    }
    Ok(())
}

/// Registers images along trajectories, and keeps the estimates that pass the calibrated gate.
fn samples(
    objects: &[Household],
    preset: Preset,
    trajectories: u64,
) -> Result<Vec<Sample>, Failed> {
    let max_mve = Calibration::of(preset).gate.max_mve.unwrap_or(1.0);
    let subjects = Subject::household(objects)?;
    let mut config = TrajectoryConfig::new(&subjects, &[preset], 1, SEED)?;
    config.methods = vec!["gated-weighted-average".to_owned()];
    config.underlying[0].seconds_per_estimate = SECONDS;
    config.underlying[0].seconds_per_mve = 0.0;
    let (mut kept, mut failed) = (Vec::new(), None);
    let mut watch = |seen: &TrajectoryStep<'_>| match sample(seen) {
        Ok(found) => kept.extend(found.filter(|s| s.mve <= max_mve)),
        Err(error) => failed = Some(error),
    };
    watch_trajectories(&config, &subjects, 0..trajectories, &mut watch)?;
    failed.map_or(Ok(kept), Err)
}

fn sample(seen: &TrajectoryStep<'_>) -> Result<Option<Sample>, Failed> {
    let (step, symmetries) = (seen.step, seen.object.model.symmetries());
    let Some(mve) = step.mve.filter(|_| symmetries.continuous.is_empty()) else {
        return Ok(None);
    };
    let pose = step.outcome.camera_from_object;
    let truth = seen.nearest_truth(&pose);
    let quality = step.outcome.quality.as_ref();
    Ok(Some(Sample {
        trajectory: (seen.object.name.clone(), seen.trajectory),
        pose,
        truth,
        error: se3::log(&(truth * pose.inverse())),
        unit: UnitCovariance::about_object(seen.believed.center(), seen.believed.radius())?,
        mve,
        registration: quality.and_then(|q| q.covariance()),
    }))
}

/// Returns the covariance of an estimate without the error that all estimates share.
fn own(model: &Calibration, s: &Sample) -> Matrix6<f64> {
    let covariance = model.covariance(s.unit);
    covariance.covariance(&s.pose, Some(s.mve), s.registration.as_ref())
}

/// Returns the covariance of an estimate with the error that all estimates share.
fn total(model: &Calibration, s: &Sample) -> Matrix6<f64> {
    own(model, s) + s.unit.at(&s.pose) * (model.shared * model.shared)
}

/// Returns the negative logarithm of Student's density of an error, up to a constant.
fn surprise(error: &Vector6<f64>, covariance: &Matrix6<f64>, nu: f64) -> f64 {
    let Some(cholesky) = covariance.cholesky() else {
        return 1e3;
    };
    let squared = error.dot(&cholesky.solve(error));
    let log_root_determinant: f64 = cholesky.l().diagonal().map(f64::ln).sum();
    log_root_determinant + 0.5 * (nu + 6.0) * (squared / nu).ln_1p()
}

fn total_loss(samples: &[Sample], model: &Calibration) -> f64 {
    let nu = model.degrees_of_freedom;
    let each = samples.iter();
    each.map(|s| surprise(&s.error, &total(model, s), nu)).sum()
}

/// Returns the loss of the differences between neighbors on a trajectory.
///
/// The shared error cancels in these differences, which are those in the camera frame of the second
/// one.
fn scatter_loss(samples: &[Sample], model: &Calibration) -> f64 {
    let neighbors = samples
        .windows(2)
        .filter(|two| two[0].trajectory == two[1].trajectory);
    let each = neighbors.map(|two| {
        let motion = se3::adjoint(&(two[1].truth * two[0].truth.inverse()));
        let difference = two[1].error - motion * two[0].error;
        let covariance = motion * own(model, &two[0]) * motion.transpose() + own(model, &two[1]);
        surprise(&difference, &covariance, model.degrees_of_freedom)
    });
    each.sum()
}

/// Selects a factor of a calibration.
type Factor = fn(&mut Calibration) -> &mut f64;

/// Changes one factor after another, in smaller and smaller steps, as long as the loss falls.
fn fit(start: Calibration, factors: &[Factor], loss: impl Fn(&Calibration) -> f64) -> Calibration {
    let (mut best, mut least) = (start, loss(&start));
    let mut step: f64 = 2.0;
    while step > 1.01 {
        let mut better = false;
        for which in factors {
            for change in [step, 1.0 / step] {
                let mut tried = best;
                *which(&mut tried) *= change;
                let found = loss(&tried);
                if found < least {
                    (best, least, better) = (tried, found, true);
                }
            }
        }
        if !better {
            step = step.sqrt();
        }
    }
    best
}

fn show(
    objects: &str,
    label: &str,
    samples: &[Sample],
    nu: f64,
    covariance: impl Fn(&Sample) -> Matrix6<f64>,
) {
    let within = |s: &Sample| {
        let squared = covariance(s)
            .cholesky()
            .map_or(f64::INFINITY, |c| s.error.dot(&c.solve(&s.error)));
        probability_within(squared, nu)
    };
    let within: Vec<f64> = samples.iter().map(within).collect();
    let inside = [0.5, 0.9, 0.99].map(|level| {
        let count = within.iter().filter(|p| **p <= level).count();
        100.0 * count as f64 / within.len().max(1) as f64
    });
    println!(
        "  {objects:6} {label:12} inside 50 %: {:5.1}, 90 %: {:5.1}, 99 %: {:5.1}",
        inside[0], inside[1], inside[2]
    );
}

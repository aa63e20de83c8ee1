//! Are covariances what the errors say? Fits `InflatedCovariance` on the tuning objects and prints the share of errors inside the
//! 50, 90 and 99 % ellipsoids, before and after, on the tuning and on the test objects.
//!
//! Run with `cargo run --release -p hicp-experiments --example calibration [CASES]`: cases per object, 40 unless told otherwise.
//! Images with a D435's axial noise from up to 1 m, reconstructions with 5 mm and 1.1°, initial poses off by 6.2 mm and 9.5°.
//! Objects that turn freely about an axis are left out; estimates with an MVE above 0.4 too, as the gate does.
#![allow(clippy::print_stdout, reason = "an example shows its results")]

use hicp_core::{Isometry3, Matrix6, Observation, PinholeCamera, Problem, Vector6, se3};
use hicp_experiments::Subject;
use hicp_sim::{
    AxialPolynomial, CaseConfig, CaseMaker, Corruption, DepthNoise, DepthSensor, Household,
    InitialPose, Reconstruction, ReconstructionNoise,
};
use hybrid_icp::fusion::{
    BatchFuser, FuserConfig, InflatedCovariance, MveCovariance, SymmetryAware, UnitCovariance,
};
use hybrid_icp::{MeanVsd, Preset, Rasterizer, Score, Session, Stage, Workspace};

type Failed = Box<dyn std::error::Error>;

/// Quantiles of χ²₆.
const QUANTILES: [f64; 3] = [5.348, 10.645, 16.812];
/// Degrees of freedom of the Student distribution that is fitted: failures that pass the gate do not decide.
const STUDENT: f64 = 4.0;
const SEED: u64 = 11;

/// One estimate and how far off it is.
struct Sample {
    pose: Isometry3<f64>,
    error: Vector6<f64>,
    unit: UnitCovariance,
    mve: f64,
    registration: Option<Matrix6<f64>>,
}

fn main() -> Result<(), Failed> {
    let cases = std::env::args()
        .nth(1)
        .map_or(Ok(40), |text| text.parse())?;
    for preset in [Preset::Hybrid, Preset::ProjectiveCascadePointPlane] {
        let tuning = samples(&Household::TUNING, preset, cases)?;
        let test = samples(&Household::TEST, preset, cases)?;
        let before = InflatedCovariance::uncalibrated(UnitCovariance::Identity);
        let after = fit(&tuning, before);
        println!("{preset}: {} and {} estimates", tuning.len(), test.len());
        println!(
            "  s = {:.3}, f = {:.5}, g = {:.4}, p = {}, undetermined {:.3}",
            after.scale, after.floor, after.mve_gain, after.mve_power, after.undetermined
        );
        for (name, samples) in [("tuning", &tuning), ("test", &test)] {
            let paper = samples.iter().map(|s| {
                let model = MveCovariance {
                    unit: s.unit,
                    ..MveCovariance::default()
                };
                distance(s, &model.covariance(&s.pose, Some(s.mve)))
            });
            show(name, "e_MVE·U", paper);
            for (label, model) in [("uncalibrated", before), ("calibrated", after)] {
                let found = samples.iter().map(|s| distance(s, &inflated(&model, s)));
                show(name, label, found);
            }
        }
    }
    Ok(())
}

/// Registers cases of objects, and keeps what the gate would.
fn samples(objects: &[Household], preset: Preset, cases: u64) -> Result<Vec<Sample>, Failed> {
    let camera = PinholeCamera::new(572.4, 573.6, 325.3, 242.0, 640, 480)?;
    let mut maker = CaseMaker::new(CaseConfig {
        max_distance_meters: 1.0,
        ..CaseConfig::new(camera, InitialPose::mean_error())
    })?;
    let sensor = DepthSensor {
        noise: DepthNoise::Axial(AxialPolynomial::d435_ahn2019_axial()),
        ..DepthSensor::default()
    };
    let seen = Corruption {
        sensor,
        ..Corruption::default()
    };
    let noise = ReconstructionNoise {
        translation_meters: 0.005,
        rotation_degrees: 1.1,
        ..ReconstructionNoise::default()
    };
    let (mut stage, mut score) = (preset.build(), MeanVsd::default());
    let mut workspace = Workspace::new(Rasterizer::default());
    let mut kept = Vec::new();
    for subject in Subject::household(objects)? {
        let symmetries = subject.model.symmetries().clone();
        if !symmetries.continuous.is_empty() {
            continue;
        }
        let believed =
            Reconstruction::new(camera, noise).reconstruct(&subject.model, &subject.name, SEED)?;
        let (center, radius) = (believed.center(), believed.radius());
        let unit = UnitCovariance::about_object(center, radius)?;
        let fuser = BatchFuser::average(FuserConfig::default());
        let symmetric = SymmetryAware::new(fuser, symmetries, center, radius)?;
        for index in 0..cases {
            let case = maker.case(&subject.model, &subject.name, SEED, index)?;
            let observation: Observation = seen.observe(&case)?;
            let problem = Problem::new(&believed, &observation);
            let outcome = stage.run(
                &problem,
                &case.init,
                &mut Session::new(&mut workspace, &mut ()),
            );
            if outcome.evaluation.is_none() {
                continue;
            }
            let pose = outcome.camera_from_object;
            let mve = score.score(&mut workspace.context(&problem), &pose);
            if mve > 0.4 {
                continue;
            }
            let truth = symmetric.representative(&case.camera_from_object, &pose);
            kept.push(Sample {
                pose,
                error: se3::log(&(truth * pose.inverse())),
                unit,
                mve,
                registration: outcome.quality.as_ref().and_then(|q| q.covariance()),
            });
        }
    }
    Ok(kept)
}

fn inflated(model: &InflatedCovariance, s: &Sample) -> Matrix6<f64> {
    let model = InflatedCovariance {
        unit: s.unit,
        ..*model
    };
    model.covariance(&s.pose, Some(s.mve), s.registration.as_ref())
}

/// ξᵀΣ⁻¹ξ; infinite where Σ is not positive definite.
fn distance(s: &Sample, covariance: &Matrix6<f64>) -> f64 {
    covariance
        .cholesky()
        .map_or(f64::INFINITY, |c| s.error.dot(&c.solve(&s.error)))
}

/// Negative logarithm of the likelihood of all samples, as Student's distribution has it.
fn loss(samples: &[Sample], model: &InflatedCovariance) -> f64 {
    let one = |s: &Sample| {
        let Some(cholesky) = inflated(model, s).cholesky() else {
            return 1e3;
        };
        let squared = s.error.dot(&cholesky.solve(&s.error));
        let determinant = cholesky.l().diagonal().map(f64::ln).sum();
        determinant + 0.5 * (STUDENT + 6.0) * (squared / STUDENT).ln_1p()
    };
    samples.iter().map(one).sum()
}

/// Fits the factors by turns, then scales all of them until 90 % of the errors are inside their ellipsoid.
fn fit(samples: &[Sample], start: InflatedCovariance) -> InflatedCovariance {
    let mut best = (start, loss(samples, &start));
    for power in [0.5, 1.0, 2.0] {
        let mut model = InflatedCovariance {
            mve_power: power,
            ..start
        };
        let mut least = loss(samples, &model);
        let mut step: f64 = 2.0;
        while step > 1.02 {
            let mut better = false;
            for index in 0..4 {
                for factor in [step, 1.0 / step] {
                    let tried = scaled(model, [index], factor);
                    let found = loss(samples, &tried);
                    if found < least {
                        (model, least, better) = (tried, found, true);
                    }
                }
            }
            if !better {
                step = step.sqrt();
            }
        }
        if least < best.1 {
            best = (model, least);
        }
    }
    let mut distances: Vec<f64> = samples
        .iter()
        .map(|s| distance(s, &inflated(&best.0, s)))
        .collect();
    distances.sort_by(f64::total_cmp);
    let ninth = distances.get(distances.len() * 9 / 10).copied();
    scaled(
        best.0,
        [0, 1, 2, 3],
        (ninth.unwrap_or(QUANTILES[1]) / QUANTILES[1]).sqrt(),
    )
}

/// Multiplies some factors: of the registration, the floor, the gain, and where nothing is determined.
fn scaled<const N: usize>(
    mut model: InflatedCovariance,
    which: [usize; N],
    factor: f64,
) -> InflatedCovariance {
    let factors = [
        &mut model.scale,
        &mut model.floor,
        &mut model.mve_gain,
        &mut model.undetermined,
    ];
    for (index, value) in factors.into_iter().enumerate() {
        if which.contains(&index) {
            *value *= factor;
        }
    }
    model
}

fn show(objects: &str, model: &str, distances: impl Iterator<Item = f64>) {
    let distances: Vec<f64> = distances.collect();
    let inside = QUANTILES.map(|limit| {
        let count = distances.iter().filter(|d| **d <= limit).count();
        100.0 * count as f64 / distances.len().max(1) as f64
    });
    println!(
        "  {objects:6} {model:12} inside 50 %: {:5.1}, 90 %: {:5.1}, 99 %: {:5.1}",
        inside[0], inside[1], inside[2]
    );
}

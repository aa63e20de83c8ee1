//! Fusion of estimates, and a step of the sequential estimator compared with the ICP inside it.
//!
//! Run `cargo bench -p hicp-benches --bench fuse`.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use hicp_benches::case;
use hicp_sim::{Household, perturb, rng};
use hybrid_icp::core::{Problem, Vector6, se3};
use hybrid_icp::fusion::{
    CameraMotion, Fuser, FuserConfig, Fusion, FusionLimits, FusionMethod, PoseEstimate,
    UnitCovariance,
};
use hybrid_icp::icp::{Session, Workspace};
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::{Preset, SequentialEstimator};

/// Returns estimates 4 mm and 4° apart, with the unequal covariances of a pipeline's output.
fn estimates(count: usize) -> (Vec<PoseEstimate>, UnitCovariance) {
    let case = case(Household::Mug);
    let mut rng = rng(7);
    let model = &case.scene.model;
    let unit = UnitCovariance::about_object(model.center(), model.radius())
        .unwrap_or(UnitCovariance::Identity);
    let estimates = (0..count)
        .filter_map(|k| {
            let pose = perturb(&mut rng, &case.scene.truth, 0.004, 4.0_f64.to_radians());
            #[allow(clippy::cast_precision_loss)]
            let mve = 0.05 + 0.02 * (k % 10) as f64;
            PoseEstimate::new(pose, unit.at(&pose) * mve).ok()
        })
        .collect();
    (estimates, unit)
}

/// Measures the inversion of all covariances and the solution: an update of a batch fuser.
fn fuse(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("fuse");
    for count in [2, 10, 100] {
        let (estimates, _) = estimates(count);
        let mut fusion = Fusion::new(FusionLimits::default());
        group.bench_function(format!("{count}-estimates"), |bencher| {
            bencher.iter(|| {
                fusion.clear();
                for estimate in black_box(&estimates) {
                    fusion.push(estimate);
                }
                fusion.solve(estimates[0].camera_from_object())
            });
        });
    }
    group.finish();
}

/// Measures the update with the tenth image: nine estimates exist, and the camera has moved.
fn update(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("fuse-update");
    let (estimates, unit) = estimates(10);
    let advance = se3::exp(&Vector6::new(0.0, 0.0, -0.01, 0.0, 0.001, 0.0));
    let motion = CameraMotion::new(advance).unwrap_or_else(|_| CameraMotion::none());
    for method in FusionMethod::ALL {
        let mut ninth = method.build(FuserConfig {
            unit,
            // The window keeps ten estimates however often the bench runs.
            window: Some(10),
            ..FuserConfig::default()
        });
        for estimate in &estimates[..9] {
            ninth.update(estimate);
        }
        let mut carried = advance;
        group.bench_function(BenchmarkId::new(method.name(), 10), |bencher| {
            bencher.iter(|| {
                ninth.propagate(&motion);
                let pose = carried * estimates[9].camera_from_object();
                carried = advance * carried;
                carried.rotation.renormalize();
                let tenth = PoseEstimate::new(pose, unit.at(&pose) * 0.1);
                tenth.map(|tenth| ninth.update(&tenth)).is_ok()
            });
        });
    }
    group.finish();
}

/// Compares ICP alone with a whole step of the estimator from the same start.
fn step(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("sequential");
    for preset in [Preset::ProjectiveCascadePointPlane, Preset::Hybrid] {
        let case = case(Household::Mug);
        let (model, observation) = (&case.scene.model, &case.scene.observation);
        let problem = Problem::new(model, observation);
        let mut workspace = Workspace::new(Rasterizer::default());
        let mut stage = preset.build();
        group.bench_function(BenchmarkId::new("icp", preset.name()), |bencher| {
            bencher.iter(|| {
                stage.run(
                    &problem,
                    &case.init,
                    &mut Session::new(&mut workspace, &mut ()),
                )
            });
        });
        let method = FusionMethod::Average;
        for (id, made) in [
            // Without the MVE, which `average` does not need: measures the fuser and the
            // bookkeeping.
            (
                "step",
                SequentialEstimator::paper(preset.build(), method, &case.init),
            ),
            (
                "step-with-mve",
                SequentialEstimator::for_object(preset.build(), method, model, &case.init),
            ),
        ] {
            let Ok(mut estimator) = made else { continue };
            group.bench_function(BenchmarkId::new(id, preset.name()), |bencher| {
                bencher.iter(|| {
                    estimator
                        .restart(&case.init)
                        .map(|()| estimator.step(model, observation, &CameraMotion::none()))
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, fuse, update, step);
criterion_main!(benches);

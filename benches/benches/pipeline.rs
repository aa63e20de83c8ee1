//! Whole pipelines: every preset, from an observation to a pose and from a depth image to a pose.
//!
//! Run `cargo bench -p hicp-benches --bench pipeline`.

use std::cell::RefCell;

use criterion::{BatchSize, BenchmarkId, Criterion, criterion_group, criterion_main};
use hicp_benches::{OBJECTS, case, forget_renders};
use hybrid_icp::core::{Observation, Problem, Translation3, UnitQuaternion, Vector3};
use hybrid_icp::{Preset, Refiner};

/// Measures warm refinements.
///
/// The observation, its search tree, the scratch memory and the cached renders already exist.
fn pipeline(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("pipeline");
    for object in OBJECTS {
        let case = case(object);
        for preset in Preset::ALL {
            let mut refiner = Refiner::preset(preset);
            group.bench_function(BenchmarkId::new(preset.name(), case.name), |bencher| {
                bencher.iter(|| {
                    refiner.refine(&case.scene.model, &case.scene.observation, &case.init)
                });
            });
        }
    }
    group.finish();
}

/// Measures refinements from the depth image.
///
/// The time includes the observation, the search tree, every render, the refinement and both
/// scores.
fn cold(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("pipeline-cold");
    for object in OBJECTS {
        let case = case(object);
        let observation = &case.scene.observation;
        for preset in [Preset::Hybrid, Preset::NnPointToPoint] {
            group.bench_function(BenchmarkId::new(preset.name(), case.name), |bencher| {
                let refiner = RefCell::new(Refiner::preset(preset));
                let problem = Problem::new(&case.scene.model, observation);
                bencher.iter_batched(
                    || {
                        forget_renders(refiner.borrow_mut().workspace_mut(), &problem, &case.init);
                        (observation.depth().clone(), observation.mask().clone())
                    },
                    |(depth, mask)| {
                        Observation::new(depth, mask, *observation.camera()).map(|o| {
                            refiner
                                .borrow_mut()
                                .refine(&case.scene.model, &o, &case.init)
                        })
                    },
                    BatchSize::PerIteration,
                );
            });
        }
    }
    group.finish();
}

/// Measures `auto` from starts that it leaves by a search, and the estimate of a pose without a
/// start.
///
/// The starts are rotated by 180° around the x axis of the object, through its center.
fn search(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("pipeline");
    let mut refiner = Refiner::preset(Preset::Auto);
    for object in OBJECTS {
        let case = case(object);
        let (model, observation) = (&case.scene.model, &case.scene.observation);
        let center = model.center().coords;
        let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        let around_center = Translation3::from(center) * turn * Translation3::from(-center);
        let turned = case.init * around_center;
        group.bench_function(BenchmarkId::new("auto-searching", case.name), |bencher| {
            bencher.iter(|| refiner.refine(model, observation, &turned));
        });
        group.bench_function(BenchmarkId::new("estimate", case.name), |bencher| {
            bencher.iter(|| refiner.estimate(model, observation));
        });
    }
    group.finish();
}

criterion_group!(benches, pipeline, search, cold);
criterion_main!(benches);

//! One iteration of projective point-to-plane over every visible pixel.
//!
//! Compares the loop written by hand in AVX2 with the traits.
//!
//! Run `cargo bench -p hicp-benches --bench fused`. The throughput counts source points, so its
//! inverse is the time per pixel and iteration.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use hicp_benches::fused::Fused;
use hicp_benches::{OBJECTS, case, selected};
use hybrid_icp::association::{DataAssociation, Projective, Stride, VisibleSurface};
use hybrid_icp::core::{Correspondences, Iteration, Problem};
use hybrid_icp::metric::{ErrorMetric, Minimize, PointToPlane};

fn fused(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("fused");
    for object in OBJECTS {
        let case = case(object);
        let problem = Problem::new(&case.scene.model, &case.scene.observation);
        let mut every_pixel = VisibleSurface::with_stride(Stride::Pixels(1));
        let (source, mut workspace) = selected(&case.scene, &case.init, &mut every_pixel);
        let mut context = workspace.context(&problem);
        group.throughput(Throughput::Elements(source.len() as u64));

        if let Some(fused) = Fused::new(&case.scene.observation, &source) {
            let pivot = case.init * case.scene.model.center();
            group.bench_function(BenchmarkId::new("avx2", case.name), |bencher| {
                bencher.iter(|| fused.step(black_box(&case.init), &pivot));
            });
        } else {
            println!("fused/avx2/{}: skipped, no AVX2 with FMA", case.name);
        }

        let mut association: Box<dyn DataAssociation> = Box::new(Projective);
        let mut metric: Box<dyn ErrorMetric> = Box::new(PointToPlane);
        let mut pairs = Correspondences::new();
        group.bench_function(BenchmarkId::new("traits", case.name), |bencher| {
            bencher.iter(|| {
                pairs.begin(black_box(&case.init), source.len());
                association.associate(&mut context, &source, &case.init, &mut pairs);
                metric.minimize(&Iteration::default(), &pairs)
            });
        });
    }
    group.finish();
}

criterion_group!(benches, fused);
criterion_main!(benches);

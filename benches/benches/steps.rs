//! Steps of the data flow, one group each.
//!
//! The groups are `render`, `observe`, `select`, `associate`, `metric`, `score` and `fused`.
//!
//! Run `cargo bench -p hicp-benches --bench steps`.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use hicp_benches::fused::Fused;
use hicp_benches::{Case, OBJECTS, case, selected};
use hybrid_icp::association::{
    AllSamples, DataAssociation, NearestNeighbor, PointSelection, Projective, Stride,
    VisibleSurface,
};
use hybrid_icp::core::{Correspondences, Iteration, Observation, Problem, RenderedView, Renderer};
use hybrid_icp::icp::Workspace;
use hybrid_icp::metric::{ErrorMetric, Minimize, PointToPlane, PointToPoint};
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::{MeanVsd, SampledMve, Score};

fn cases() -> Vec<Case> {
    OBJECTS.into_iter().map(case).collect()
}

fn render(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("render");
    for case in cases() {
        let camera = *case.scene.observation.camera();
        let mut rasterizer = Rasterizer::default();
        let mut view = RenderedView::default();
        let id = BenchmarkId::new("depth", case.name);
        group.bench_function(id, |bencher| {
            bencher.iter(|| {
                let mesh = black_box(case.scene.model.mesh());
                rasterizer.render(mesh, &camera, &case.init, &camera.region(), &mut view);
                black_box(view.depth().len())
            });
        });
    }
    group.finish();
}

fn observe(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("observe");
    for case in cases() {
        let observation = &case.scene.observation;
        group.throughput(Throughput::Elements(observation.n_measured() as u64));
        let id = BenchmarkId::new("observation", case.name);
        group.bench_function(id, |bencher| {
            bencher.iter_batched(
                || (observation.depth().clone(), observation.mask().clone()),
                |(depth, mask)| {
                    // The normals are estimated when they are asked for.
                    Observation::new(depth, mask, *observation.camera())
                        .map(|observation| (observation.n_surfels(), observation))
                },
                criterion::BatchSize::LargeInput,
            );
        });
    }
    group.finish();
}

fn select(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("select");
    for case in cases() {
        let problem = Problem::new(&case.scene.model, &case.scene.observation);
        let mut selections: [Box<dyn PointSelection>; 2] =
            [Box::new(AllSamples), Box::new(VisibleSurface::default())];
        for selection in &mut selections {
            // The render is in the cache, so this measures the selection alone.
            let (mut source, mut workspace) = selected(&case.scene, &case.init, selection);
            group.bench_function(BenchmarkId::new(selection.name(), case.name), |bencher| {
                bencher.iter(|| {
                    source.clear();
                    let mut context = workspace.context(&problem);
                    selection.select(&mut context, &case.init, &mut source);
                    black_box(source.len())
                });
            });
        }
    }
    group.finish();
}

fn associate(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("associate");
    for case in cases() {
        let problem = Problem::new(&case.scene.model, &case.scene.observation);
        let (source, mut workspace) =
            selected(&case.scene, &case.init, &mut VisibleSurface::default());
        group.throughput(Throughput::Elements(source.len() as u64));
        let mut associations: [Box<dyn DataAssociation>; 2] =
            [Box::new(Projective), Box::new(NearestNeighbor::default())];
        for association in &mut associations {
            let mut pairs = Correspondences::new();
            let id = BenchmarkId::new(association.name(), case.name);
            group.bench_function(id, |bencher| {
                bencher.iter(|| {
                    pairs.begin(&case.init, source.len());
                    let mut context = workspace.context(&problem);
                    association.associate(&mut context, &source, &case.init, &mut pairs);
                    black_box(pairs.len())
                });
            });
        }
    }
    group.finish();
}

fn metric(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("metric");
    for case in cases() {
        let problem = Problem::new(&case.scene.model, &case.scene.observation);
        let (source, mut workspace) =
            selected(&case.scene, &case.init, &mut VisibleSurface::default());
        let mut pairs = Correspondences::new();
        let mut context = workspace.context(&problem);
        Projective.associate(&mut context, &source, &case.init, &mut pairs);
        group.throughput(Throughput::Elements(pairs.len() as u64));
        let mut metrics: [Box<dyn Minimize>; 2] = [Box::new(PointToPoint), Box::new(PointToPlane)];
        for metric in &mut metrics {
            group.bench_function(BenchmarkId::new(metric.label(), case.name), |bencher| {
                bencher.iter(|| metric.minimize(&Iteration::default(), black_box(&pairs)));
            });
        }
    }
    group.finish();
}

fn score(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("score");
    let scores: [(&str, Box<dyn Score>); 2] = [
        ("mve", Box::new(MeanVsd::default())),
        ("sampled-mve", Box::new(SampledMve::default())),
    ];
    for (name, mut score) in scores {
        for case in cases() {
            let problem = Problem::new(&case.scene.model, &case.scene.observation);
            let mut workspace = Workspace::new(Rasterizer::default());
            group.bench_function(BenchmarkId::new(name, case.name), |bencher| {
                bencher.iter(|| score.score(&mut workspace.context(&problem), &case.init));
            });
        }
    }
    group.finish();
}

/// Compares an iteration of projective point-to-plane, written by hand in AVX2, with the traits.
///
/// Both use every visible pixel. The throughput counts source points, so its inverse is the time
/// per pixel and iteration.
fn fused(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("fused");
    for case in cases() {
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

criterion_group!(
    benches, render, observe, select, associate, metric, score, fused
);
criterion_main!(benches);

//! Steps of the data flow, one group each.
//!
//! The groups are `render`, `observe`, `select`, `associate`, `metric` and `score`.
//!
//! Run `cargo bench -p hicp-benches --bench steps`.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use hicp_benches::{Case, OBJECTS, case};
use hybrid_icp::association::{
    AllSamples, DataAssociation, NearestNeighbor, PointSelection, Projective, VisibleSurface,
};
use hybrid_icp::core::Iteration;
use hybrid_icp::core::{Correspondences, Observation, Problem, RenderedView, Renderer, Surfel};
use hybrid_icp::icp::Workspace;
use hybrid_icp::metric::Minimize;
use hybrid_icp::metric::{PointToPlane, PointToPoint};
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

/// Selects once and returns the points with the workspace that rendered them.
fn selected(case: &Case, selection: &mut dyn PointSelection) -> (Vec<Surfel>, Workspace) {
    let mut workspace = Workspace::new(Rasterizer::default());
    let problem = Problem::new(&case.scene.model, &case.scene.observation);
    let mut source = Vec::new();
    selection.select(&mut workspace.context(&problem), &case.init, &mut source);
    (source, workspace)
}

fn select(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("select");
    for case in cases() {
        let problem = Problem::new(&case.scene.model, &case.scene.observation);
        let mut selections: [Box<dyn PointSelection>; 2] =
            [Box::new(AllSamples), Box::new(VisibleSurface::default())];
        for selection in &mut selections {
            // The render is in the cache, so this measures the selection alone.
            let (mut source, mut workspace) = selected(&case, selection);
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
        let (source, mut workspace) = selected(&case, &mut VisibleSurface::default());
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
        let (source, mut workspace) = selected(&case, &mut VisibleSurface::default());
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
    for case in cases() {
        let problem = Problem::new(&case.scene.model, &case.scene.observation);
        let mut workspace = Workspace::new(Rasterizer::default());
        // The first call renders. The other calls measure the score alone.
        group.bench_function(BenchmarkId::new("mve", case.name), |bencher| {
            bencher.iter(|| {
                let mut context = workspace.context(&problem);
                MeanVsd::default().score(&mut context, &case.init)
            });
        });
    }
    // Poses per second of a ranking.
    for case in cases() {
        let problem = Problem::new(&case.scene.model, &case.scene.observation);
        let mut workspace = Workspace::new(Rasterizer::default());
        let mut sampled = SampledMve::default();
        group.throughput(Throughput::Elements(1));
        group.bench_function(BenchmarkId::new("sampled-mve", case.name), |bencher| {
            bencher.iter(|| sampled.score(&mut workspace.context(&problem), &case.init));
        });
    }
    group.finish();
}

criterion_group!(benches, render, observe, select, associate, metric, score);
criterion_main!(benches);

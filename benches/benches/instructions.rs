//! Instruction counts of every step, measured by valgrind.
//!
//! Counts vary by less than a percent between runs, while times vary by tens of percent.
//!
//! Run `cargo xtask instructions`. Alternatively, install valgrind and a `gungraun-runner` of the
//! library's version, and run
//! `cargo bench -p hicp-benches --features instructions --bench instructions`. The instructions of
//! a setup are not counted. A processor without AVX2 runs other code with other counts.
#![allow(missing_docs, unused_qualifications)] // Caused by the macros.

use std::hint::black_box;

use gungraun::{
    Callgrind, EventKind, LibraryBenchmarkConfig, library_benchmark, library_benchmark_group, main,
};
use hicp_benches::{Case, case, selected};
use hicp_sim::Household;
use hybrid_icp::association::{
    AllSamples, DataAssociation, NearestNeighbor, PointSelection, Projective, VisibleSurface,
};
use hybrid_icp::core::{
    Correspondences, DepthImage, Isometry3, Iteration, Mask, Observation, PinholeCamera, Problem,
    RenderedView, Renderer, Surfel,
};
use hybrid_icp::icp::Workspace;
use hybrid_icp::metric::{Minimize, PointToPlane, PointToPoint, Step};
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::{MeanVsd, Score};
use hybrid_icp::{Preset, Refinement, Refiner};

/// Returns a configuration that fails a bench that executes 3 % more than `instructions`.
///
/// That is the count when the limit was set, with the compiler that
/// `xtask/src/measure/instructions.rs` names. A commit that changes a limit gives the reason.
fn limit(instructions: u64) -> LibraryBenchmarkConfig {
    let mut callgrind = Callgrind::default();
    callgrind.hard_limits([(EventKind::Ir, instructions * 103 / 100)]);
    let mut config = LibraryBenchmarkConfig::default();
    config.tool(callgrind);
    config
}

/// A case with a cached render at the initial pose, and the points selected and paired there.
struct Ready {
    case: Case,
    workspace: Workspace,
    source: Vec<Surfel>,
    pairs: Correspondences,
}

fn ready_with(selection: &mut dyn PointSelection, association: &mut dyn DataAssociation) -> Ready {
    let case = case(Household::Mug);
    let (source, mut workspace) = selected(&case.scene, &case.init, selection);
    let problem = Problem::new(&case.scene.model, &case.scene.observation);
    let _ = workspace.context(&problem).view(&case.init);
    let mut ready = Ready {
        case,
        workspace,
        source,
        pairs: Correspondences::new(),
    };
    pair(&mut ready, association);
    ready
}

fn projective() -> Ready {
    ready_with(&mut VisibleSurface::default(), &mut Projective)
}

fn nearest() -> Ready {
    ready_with(&mut AllSamples, &mut NearestNeighbor::default())
}

fn raster() -> (Case, Rasterizer, RenderedView) {
    let case = case(Household::Mug);
    let (mut rasterizer, mut view) = (Rasterizer::default(), RenderedView::default());
    draw(&case, &mut rasterizer, &mut view);
    (case, rasterizer, view)
}

fn draw(case: &Case, rasterizer: &mut Rasterizer, view: &mut RenderedView) {
    let camera = case.scene.observation.camera();
    let mesh = case.scene.model.mesh();
    rasterizer.render(mesh, camera, &case.init, &camera.region(), view);
}

#[library_benchmark]
#[bench::mug(setup = raster, config = limit(2_151_650))]
fn render(state: (Case, Rasterizer, RenderedView)) -> (Case, Rasterizer, RenderedView) {
    let (case, mut rasterizer, mut view) = state;
    draw(&case, &mut rasterizer, &mut view);
    black_box((case, rasterizer, view))
}

fn image() -> (DepthImage, Mask, PinholeCamera) {
    let scene = case(Household::Mug).scene;
    let observation = &scene.observation;
    (
        observation.depth().clone(),
        observation.mask().clone(),
        *observation.camera(),
    )
}

#[library_benchmark]
#[bench::mug(setup = image, config = limit(6_810_508))]
fn observe(image: (DepthImage, Mask, PinholeCamera)) -> Option<Observation> {
    let (depth, mask, camera) = image;
    let observation = Observation::new(depth, mask, camera).ok()?;
    // The normals are estimated when they are asked for.
    black_box(observation.n_surfels());
    Some(observation)
}

#[library_benchmark]
#[bench::visible_surface_mug(setup = projective, config = limit(315_626))]
fn select(mut ready: Ready) -> Ready {
    let problem = Problem::new(&ready.case.scene.model, &ready.case.scene.observation);
    ready.source.clear();
    let mut context = ready.workspace.context(&problem);
    VisibleSurface::default().select(&mut context, &ready.case.init, &mut ready.source);
    black_box(ready)
}

fn pair(ready: &mut Ready, association: &mut dyn DataAssociation) {
    let problem = Problem::new(&ready.case.scene.model, &ready.case.scene.observation);
    let (init, source) = (&ready.case.init, &ready.source);
    ready.pairs.begin(init, source.len());
    let mut context = ready.workspace.context(&problem);
    association.associate(&mut context, source, init, &mut ready.pairs);
}

#[library_benchmark]
#[bench::mug(setup = projective, config = limit(192_363))]
fn associate_projective(mut ready: Ready) -> Ready {
    pair(&mut ready, &mut Projective);
    black_box(ready)
}

#[library_benchmark]
#[bench::mug(setup = nearest, config = limit(2_549_731))]
fn associate_nearest_neighbor(mut ready: Ready) -> Ready {
    pair(&mut ready, &mut NearestNeighbor::default());
    black_box(ready)
}

#[library_benchmark]
#[bench::mug(setup = projective, config = limit(112_233))]
fn metric_point_to_point(ready: Ready) -> (Ready, Option<Step>) {
    let step = PointToPoint.minimize(&Iteration::default(), &ready.pairs);
    black_box((ready, step))
}

#[library_benchmark]
#[bench::mug(setup = projective, config = limit(159_127))]
fn metric_point_to_plane(ready: Ready) -> (Ready, Option<Step>) {
    let step = PointToPlane.minimize(&Iteration::default(), &ready.pairs);
    black_box((ready, step))
}

#[library_benchmark]
#[bench::mve_mug(setup = projective, config = limit(364_026))]
fn score(mut ready: Ready) -> (Ready, f64) {
    let problem = Problem::new(&ready.case.scene.model, &ready.case.scene.observation);
    let mut context = ready.workspace.context(&problem);
    let mve = MeanVsd::default().score(&mut context, &ready.case.init);
    black_box((ready, mve))
}

fn warm() -> (Case, Refiner) {
    let case = case(Household::Mug);
    let mut refiner = Refiner::preset(Preset::Hybrid);
    // The first run starts at another pose, so that the measured run finds none of its renders.
    let elsewhere = Isometry3::translation(0.001, 0.0, 0.0) * case.init;
    refiner.refine(&case.scene.model, &case.scene.observation, &elsewhere);
    (case, refiner)
}

#[library_benchmark]
#[bench::hybrid_mug(setup = warm, config = limit(22_780_023))]
fn pipeline(state: (Case, Refiner)) -> (Case, Refiner, Refinement) {
    let (case, mut refiner) = state;
    let refined = refiner.refine(&case.scene.model, &case.scene.observation, &case.init);
    black_box((case, refiner, refined))
}

library_benchmark_group!(
    name = steps,
    benchmarks = [
        render,
        observe,
        select,
        associate_projective,
        associate_nearest_neighbor,
        metric_point_to_point,
        metric_point_to_plane,
        score,
        pipeline
    ]
);

main!(library_benchmark_groups = steps);

//! A renderer of one's own: what selections and scores see of the model.
//!
//! `cargo run --release -p hybrid-icp --example 13_own_renderer`

#![allow(clippy::print_stdout)]

use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use hybrid_icp::{
    Isometry3, PinholeCamera, PixelRegion, Preset, Problem, Rasterizer, RenderedView, Renderer,
    Session, Stage, TriMesh, Workspace,
};

mod scene;

/// Lets another renderer draw, and adds up the time that it takes. One on a GPU is put in likewise.
struct Timed<R> {
    inner: R,
    nanoseconds: Arc<AtomicU64>,
}

impl<R: Renderer> Renderer for Timed<R> {
    fn render(
        &mut self,
        mesh: &TriMesh,
        camera: &PinholeCamera,
        camera_from_object: &Isometry3<f64>,
        region: &PixelRegion,
        view: &mut RenderedView,
    ) {
        let start = Instant::now();
        self.inner
            .render(mesh, camera, camera_from_object, region, view);
        let elapsed = u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
        self.nanoseconds.fetch_add(elapsed, Ordering::Relaxed);
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let given = scene::Scene::new()?;
    let (model, observation) = given.problem()?;
    let problem = Problem::new(&model, &observation);
    let nanoseconds = Arc::new(AtomicU64::new(0));
    // A workspace holds the renderer of a thread; `Refiner` makes one with the rasterizer.
    let mut workspace = Workspace::new(Timed {
        inner: Rasterizer::default(),
        nanoseconds: Arc::clone(&nanoseconds),
    });
    let mut stage = Preset::Hybrid.build();
    let start = Instant::now();
    let mut observer = ();
    let mut session = Session::new(&mut workspace, &mut observer);
    let outcome = stage.run(&problem, &given.detected, &mut session);
    println!(
        "{} iterations took {:.2?}, of which {} renders {:.2?}",
        outcome.iterations,
        start.elapsed(),
        workspace.renders(),
        Duration::from_nanos(nanoseconds.load(Ordering::Relaxed))
    );
    if workspace.renders() == 0 {
        return Err("nothing was rendered".into());
    }
    Ok(())
}

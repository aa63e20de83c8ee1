//! A custom renderer, which selections and scores use.
//!
//! `cargo run --release -p hybrid-icp --example 13_own_renderer`

#![allow(clippy::print_stdout)]

use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use hybrid_icp::core::{Isometry3, PinholeCamera, PixelRegion, RenderedView, Renderer, TriMesh};
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::{Refiner, presets};

mod scene;

/// Adds up the time that another renderer takes. One on a GPU is passed in the same way.
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
    let nanoseconds = Arc::new(AtomicU64::new(0));
    let renderer = Timed {
        inner: Rasterizer::default(),
        nanoseconds: Arc::clone(&nanoseconds),
    };
    let mut refiner = Refiner::with_renderer(presets::hybrid(), renderer);
    let start = Instant::now();
    let refined = refiner.refine(&model, &observation, &given.detected);
    let renders = refiner.workspace_mut().renders();
    println!(
        "{} iterations took {:.2?}, of which {renders} renders {:.2?}",
        refined.outcome.iterations,
        start.elapsed(),
        Duration::from_nanos(nanoseconds.load(Ordering::Relaxed))
    );
    if renders == 0 {
        return Err("nothing was rendered".into());
    }
    Ok(())
}

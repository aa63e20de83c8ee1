//! A custom point selection: the part of the model that is registered.
//!
//! `cargo run --release -p hybrid-icp --example 09_own_selection`

use std::error::Error;

use hybrid_icp::association::{PointSelection, Projective, VisibleSurface};
use hybrid_icp::core::{Context, Isometry3, Surfel};
use hybrid_icp::icp::{Divergence, Icp, IterationLimit, SmallMotion};
use hybrid_icp::metric::PointToPlane;

mod scene;

/// Drops surface that the camera sees at a grazing angle from another selection: its depth is the
/// least certain.
struct NotGrazing<P> {
    inner: P,
    min_cosine: f32,
}

impl<P: PointSelection> PointSelection for NotGrazing<P> {
    fn select(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
        source: &mut Vec<Surfel>,
    ) {
        self.inner.select(context, camera_from_object, source);
        // Selected points are in the object frame; so is the camera, seen from there.
        let eye = camera_from_object
            .inverse()
            .translation
            .vector
            .cast::<f32>();
        source.retain(|surfel| {
            let toward_camera = (eye - surfel.point.coords).normalize();
            surfel.normal.dot(&toward_camera) > self.min_cosine
        });
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    scene::Scene::new()?.refine(Icp {
        selection: NotGrazing {
            inner: VisibleSurface::default(),
            min_cosine: 0.3,
        },
        association: Projective,
        filter: (),
        metric: PointToPlane,
        stop: (
            Divergence::count_aware(),
            SmallMotion::default(),
            IterationLimit(50),
        ),
    })
}

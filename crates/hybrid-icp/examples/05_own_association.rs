//! A custom data association: pairs model points with observed points.
//!
//! `cargo run --release -p hybrid-icp --example 05_own_association`

use std::error::Error;

use hybrid_icp::association::DataAssociation;
use hybrid_icp::core::{Context, Correspondences, Pair, RigidTransform, Surfel};
use hybrid_icp::prelude::*;

mod scene;

/// Pairs a model point with the observed point at its pixel, if both surfaces face the same way.
struct SamePixelSameWay {
    min_cosine: f32,
}

impl DataAssociation for SamePixelSameWay {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        camera_from_object: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        let Some(observation) = context.problem.observation() else {
            return;
        };
        let mover = RigidTransform::new(camera_from_object);
        for (source_index, surfel) in (0..).zip(source) {
            let source = mover.surfel(surfel); // In the camera frame now, as pairs are.
            let Some(pixel) = observation.camera().project(&source.point.cast()) else {
                continue; // Behind the camera.
            };
            #[allow(clippy::cast_possible_truncation)] // Pixels need no f64.
            let Some(index) = observation.index_near(pixel.x as f32, pixel.y as f32) else {
                continue; // Outside the mask.
            };
            let Some(target) = observation.surfel(index) else {
                continue; // No depth there.
            };
            if source.normal.dot(&target.normal) > self.min_cosine && source.point.z.is_finite() {
                pairs.push(Pair::new(source_index, source, index, *target));
            }
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    scene::Scene::new()?.refine(Icp {
        selection: VisibleSurface::default(),
        association: SamePixelSameWay { min_cosine: 0.7 },
        filter: (),
        metric: PointToPlane,
        stop: (
            Divergence::count_aware(),
            SmallMotion::default(),
            IterationLimit(50),
        ),
    })
}

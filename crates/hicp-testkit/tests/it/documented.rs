//! Tests that the examples on trait pages keep the laws of their traits.

use hicp_testkit::{AssociationLaws, check_association};
use hybrid_icp::association::DataAssociation;
use hybrid_icp::core::{Context, Correspondences, Isometry3, Pair, RigidTransform, Surfel};

/// The example on the page of [`DataAssociation`].
#[derive(Debug)]
struct SamePixel;

impl DataAssociation for SamePixel {
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
            let source = mover.surfel(surfel);
            // Pairs must be finite.
            if !source.point.iter().all(|x| x.is_finite()) {
                continue;
            }
            let Some(pixel) = observation.camera().project(&source.point.cast()) else {
                continue;
            };
            let Some(target_index) = observation.index_near(pixel.x as f32, pixel.y as f32) else {
                continue;
            };
            if let Some(target) = observation.surfel(target_index) {
                pairs.push(Pair::new(source_index, source, target_index, *target));
            }
        }
    }
}

#[test]
fn the_documented_association_keeps_the_laws() {
    check_association(|| SamePixel, AssociationLaws::default());
}

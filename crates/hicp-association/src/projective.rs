//! Projective data association.

use hicp_core::{Context, Correspondences, Isometry3, Mover, Pair, Surfel};

use crate::association::DataAssociation;
use crate::pixel_projection::PixelProjection;

/// Pairs a model point with the observed point stored at the pixel that it projects to (§III-A.1; Blais & Levine 1995).
///
/// The model point is moved by the current estimate and projected with the observation's camera; the pixel whose square
/// contains the projection gives the target, if it is masked and has a surfel. Points at or behind the camera plane have no pair.
/// Cost: constant per point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Projective;

impl DataAssociation for Projective {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        camera_from_object: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        let observation = context.problem.observation;
        let projection = PixelProjection::new(observation.camera());
        let mover = Mover::new(camera_from_object);
        pairs.reserve(source.len());
        for (source_index, surfel) in (0..).zip(source) {
            let point = mover.point(&surfel.point);
            let Some((u, v)) = projection.project(&point) else {
                continue;
            };
            let Some(target_index) = observation.index_near(u, v) else {
                continue;
            };
            if let Some(target) = observation.surfel(target_index) {
                let source = mover.surfel(surfel);
                pairs.push(Pair::new(source_index, source, target_index, *target));
            }
        }
    }

    fn name(&self) -> &'static str {
        "projective"
    }
}

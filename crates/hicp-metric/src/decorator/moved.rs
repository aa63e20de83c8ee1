//! Pairs with moved sources.

use hicp_core::{Correspondences, Isometry3, Pair, Surfel, UnitVector3};

/// Fills `moved` with the pairs, whose sources and pose are moved by an increment.
///
/// It starts from the original pairs, so that roundings to `f32` do not accumulate.
pub(crate) fn move_sources(
    pairs: &Correspondences,
    increment: &Isometry3<f64>,
    moved: &mut Correspondences,
) {
    moved.begin(
        &(increment * pairs.camera_from_object()),
        pairs.n_candidates(),
    );
    moved.extend(pairs.as_slice().iter().map(|pair| {
        let normal = increment.rotation * pair.source.normal.cast::<f64>().into_inner();
        let source = Surfel {
            point: (increment * pair.source.point.cast::<f64>()).cast(),
            normal: UnitVector3::new_unchecked(normal.cast()),
        };
        Pair { source, ..*pair }
    }));
}

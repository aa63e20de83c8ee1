//! Single stages that benches and the comparison with other libraries run.

use hybrid_icp::BoxedStage;
use hybrid_icp::association::{
    DataAssociation, MaxDistance, NearestNeighbor, Projective, Stride, VisibleSurface,
};
use hybrid_icp::icp::{Icp, IterationLimit, SmallMotion};
use hybrid_icp::metric::{ErrorMetric, Generalized, PointToPlane, PointToPoint};

/// Maximum distance of a pair in all stages, meters.
///
/// It is larger than the error of any start. The other libraries use the same value.
pub const GATE_METERS: f32 = 0.03;

/// Stop rule: the next increment is below 0.1 mm and 0.01°, or there were 100 evaluations.
pub const STOP: (SmallMotion, IterationLimit) = (
    SmallMotion {
        translation_meters: 1e-4,
        rotation_degrees: 0.01,
    },
    IterationLimit(100),
);

/// Creates a stage of visible points with pairs of at most [`GATE_METERS`], which runs until
/// [`STOP`].
pub fn visible<A, M>(stride: Stride, association: A, metric: M) -> BoxedStage
where
    A: DataAssociation + Send + 'static,
    M: ErrorMetric + Send + 'static,
{
    Box::new(Icp {
        selection: VisibleSurface::with_stride(stride),
        association,
        filter: MaxDistance::meters(GATE_METERS),
        metric,
        stop: STOP,
    })
}

/// Returns every stage with its name.
///
/// `every-pixel` uses each visible pixel. The others use about 2,000 of them.
#[must_use]
pub fn all() -> Vec<(&'static str, BoxedStage)> {
    let some = Stride::AboutPoints(2000);
    let nearest = NearestNeighbor::default;
    vec![
        (
            "projective-point-to-plane-every-pixel",
            visible(Stride::Pixels(1), Projective, PointToPlane),
        ),
        (
            "projective-point-to-plane",
            visible(some, Projective, PointToPlane),
        ),
        (
            "projective-point-to-point",
            visible(some, Projective, PointToPoint),
        ),
        ("nn-point-to-point", visible(some, nearest(), PointToPoint)),
        ("nn-point-to-plane", visible(some, nearest(), PointToPlane)),
        (
            "nn-generalized",
            visible(some, nearest(), Generalized::default()),
        ),
    ]
}

//! A custom error metric: the cost of a pair, and its derivative by the pose.
//!
//! `cargo run --release -p hybrid-icp --example 06_own_metric`

use std::error::Error;

use hybrid_icp::association::{Projective, VisibleSurface};
use hybrid_icp::core::{Pair, Vector3};
use hybrid_icp::icp::{Divergence, Icp, IterationLimit, SmallMotion};
use hybrid_icp::metric::{ErrorMetric, NormalEquations, PointToPlane, WeightedSum};

mod scene;

/// E = (p_z − c_z)²: the difference of depths.
struct DepthDifference;

impl ErrorMetric for DepthDifference {
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        let model = pair.source.point.cast::<f64>();
        let observed = pair.target.point.cast::<f64>();
        // One row: the point, the direction in which its motion changes the residual, and the
        // residual. Gauss–Newton, information, covariance and observability follow from it.
        let residual = model.z - observed.z;
        system.add_row(&model, &Vector3::z(), residual, f64::from(pair.weight));
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    scene::Scene::new()?.refine(Icp {
        selection: VisibleSurface::default(),
        association: Projective,
        filter: (),
        // Depth alone leaves three directions free; point-to-plane determines them.
        metric: WeightedSum {
            terms: ((1.0, PointToPlane), (0.2, DepthDifference)),
        },
        stop: (
            Divergence::count_aware(),
            SmallMotion::default(),
            IterationLimit(50),
        ),
    })
}

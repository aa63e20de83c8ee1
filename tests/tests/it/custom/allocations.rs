//! Checks that a warm run with custom components makes no heap allocation.
//!
//! The conformance kit cannot test this.

use super::association::SoftProjective;
use super::metric::AlongRay;
use hicp_sim::{Household, rng};
use hicp_tests::allocations::allocations;
use hicp_tests::perturbed_scene;
use hybrid_icp::Refiner;
use hybrid_icp::association::{DataAssociation, VisibleSurface};
use hybrid_icp::core::{Context, Correspondences, Isometry3, Surfel};
use hybrid_icp::icp::{Divergence, Icp, IterationLimit};
use hybrid_icp::metric::{PointToPlane, WeightedSum};

/// Returns the allocations and iterations of the second of two equal refinements.
fn warm_allocations(association: impl DataAssociation + Send + 'static) -> (u64, u64) {
    let (scene, init) = perturbed_scene(Household::Mug, 1.0, &mut rng(3), (0.004, 0.08));
    let along_ray = AlongRay { min_cosine: 0.2 };
    let mut refiner = Refiner::new(Icp {
        selection: VisibleSurface::default(),
        association,
        filter: (),
        metric: WeightedSum {
            terms: ((1.0, PointToPlane), (0.5, along_ray)),
        },
        stop: (Divergence::count_aware(), IterationLimit(20)),
    });
    refiner.refine(&scene.model, &scene.observation, &init);
    let before = allocations();
    let refined = refiner.refine(&scene.model, &scene.observation, &init);
    (allocations() - before, refined.outcome.iterations as u64)
}

const SOFT: SoftProjective = SoftProjective {
    radius_pixels: 2,
    sigma_meters: 0.003,
};

#[test]
fn a_warm_run_with_custom_parts_allocates_nothing() {
    let (allocations, iterations) = warm_allocations(SOFT);
    assert_eq!(allocations, 0);
    assert!(iterations > 1, "{iterations}");
}

/// Copies the points in every iteration.
struct Wasteful;

impl DataAssociation for Wasteful {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        pose: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        let mut soft = SOFT;
        let copy = source.to_vec();
        soft.associate(context, &copy, pose, pairs);
    }
}

#[test]
fn an_association_that_allocates_is_detected() {
    let (allocations, iterations) = warm_allocations(Wasteful);
    assert!(
        allocations >= iterations,
        "{allocations} in {iterations} iterations"
    );
}

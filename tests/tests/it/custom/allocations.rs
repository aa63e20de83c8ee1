//! Checks that a warm run with custom components makes no heap allocation.
//!
//! The conformance kit cannot test this.

use super::association::SoftProjective;
use super::metric::AlongRay;
use hicp_sim::{Household, rng};
use hicp_tests::allocations::allocations;
use hicp_tests::perturbed_scene;
use hybrid_icp::Refiner;
use hybrid_icp::association::VisibleSurface;
use hybrid_icp::icp::{Divergence, Icp, IterationLimit};
use hybrid_icp::metric::{PointToPlane, WeightedSum};

#[test]
fn a_warm_run_with_custom_parts_allocates_nothing() {
    let (scene, init) = perturbed_scene(Household::Mug, 1.0, &mut rng(3), (0.004, 0.08));
    let soft = SoftProjective {
        radius_pixels: 2,
        sigma_meters: 0.003,
    };
    let along_ray = AlongRay { min_cosine: 0.2 };
    let mut refiner = Refiner::new(Icp {
        selection: VisibleSurface::default(),
        association: soft,
        filter: (),
        metric: WeightedSum {
            terms: ((1.0, PointToPlane), (0.5, along_ray)),
        },
        stop: (Divergence::count_aware(), IterationLimit(20)),
    });
    refiner.refine(&scene.model, &scene.observation, &init);
    let before = allocations();
    let refined = refiner.refine(&scene.model, &scene.observation, &init);
    assert_eq!(allocations() - before, 0);
    assert!(refined.outcome.iterations > 1, "{refined:?}");
}

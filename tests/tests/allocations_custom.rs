//! A warm run with parts of one's own makes no heap allocation: the test that a conformance kit cannot bring, to be copied.

#[path = "custom_association.rs"]
mod custom_association;
#[path = "custom_metric.rs"]
mod custom_metric;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use custom_association::SoftProjective;
use custom_metric::AlongRay;
use hicp_sim::{Household, perturb, rng};
use hicp_tests::scene;
use hybrid_icp::{
    Context, Correspondences, DataAssociation, Divergence, Icp, Isometry3, IterationLimit,
    PointToPlane, Refiner, Surfel, VisibleSurface, WeightedSum,
};

/// Counts the allocations of the thread that asks.
struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call is passed on to the system's allocator unchanged; counting touches only a thread-local integer,
// which needs no allocation itself.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        unsafe { System.realloc(pointer, layout, new_size) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Allocations of the second of two equal refinements, and how many iterations it took.
fn warm_allocations(association: impl DataAssociation + Send + 'static) -> (usize, usize) {
    let mut rng = rng(3);
    let scene = scene(Household::Mug, 1.0, &mut rng);
    let init = perturb(&mut rng, &scene.truth, 0.004, 0.08);
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
    let before = ALLOCATIONS.get();
    let refined = refiner.refine(&scene.model, &scene.observation, &init);
    (ALLOCATIONS.get() - before, refined.outcome.iterations)
}

const SOFT: SoftProjective = SoftProjective {
    radius_pixels: 2,
    sigma_meters: 0.003,
};

#[test]
fn a_warm_run_with_parts_of_ones_own_allocates_nothing() {
    let (allocations, iterations) = warm_allocations(SOFT);
    assert_eq!(allocations, 0);
    assert!(iterations > 1, "{iterations}");
}

/// Makes a copy of the points in every iteration.
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
fn an_association_that_allocates_is_found_out() {
    let (allocations, iterations) = warm_allocations(Wasteful);
    assert!(
        allocations >= iterations,
        "{allocations} in {iterations} iterations"
    );
}

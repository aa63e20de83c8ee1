//! A warm run makes no heap allocation, whatever the preset.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use hicp_sim::{Household, perturb, rng};
use hicp_tests::scene;
use hybrid_icp::{Preset, Refiner};

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

#[test]
fn a_warm_run_allocates_nothing() {
    let mut rng = rng(3);
    let scene = scene(Household::Mug, 1.0, &mut rng);
    // One start that is nearly right and one that is far off, so that `hybrid` takes both of its branches.
    let starts = [
        perturb(&mut rng, &scene.truth, 0.004, 0.08),
        perturb(&mut rng, &scene.truth, 0.08, 0.6),
    ];
    for preset in Preset::ALL {
        let mut refiner = Refiner::preset(preset);
        for init in &starts {
            refiner.refine(&scene.model, &scene.observation, init);
        }
        for init in &starts {
            let before = ALLOCATIONS.get();
            let refined = refiner.refine(&scene.model, &scene.observation, init);
            let allocations = ALLOCATIONS.get() - before;
            assert_eq!(allocations, 0, "{preset}: {refined:?}");
        }
    }
    // The counter itself works.
    let before = ALLOCATIONS.get();
    std::hint::black_box(vec![1_u8]);
    assert_eq!(ALLOCATIONS.get() - before, 1);
}

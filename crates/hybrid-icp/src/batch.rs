//! Many refinements on several threads.

use std::num::NonZeroUsize;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use hicp_core::{Isometry3, Model, Observation};
use hicp_icp::Stage;

use crate::refiner::{Refinement, Refiner};

/// Refines many poses on several threads, with one refiner per thread.
///
/// An item is a model, an observation and the initial pose (`camera_from_object`, meters). Models
/// and observations may repeat: their search trees are built once. `threads` is the number of
/// threads, by default that of the machine's cores. `refiner` creates the refiner of a thread.
///
/// The results are in the order of the items and have the bits of [`Refiner::refine`]. Cost: the
/// refinements, some tens of microseconds per thread, and the memory of its refiner. Each thread
/// takes the next item when it is done with one.
///
/// # Panics
///
/// If the system starts no more threads, or with the panic of a custom stage.
///
/// ```
/// use hybrid_icp::core::{Isometry3, Model, Observation};
/// use hybrid_icp::{Preset, Refinement, Refiner, refine_batch};
///
/// fn refine_all(model: &Model, view: &Observation, rough: &[Isometry3<f64>]) -> Vec<Refinement> {
///     let items: Vec<_> = rough.iter().map(|init| (model, view, *init)).collect();
///     refine_batch(&items, None, || Refiner::preset(Preset::Auto))
/// }
/// ```
pub fn refine_batch<S: Stage>(
    items: &[(&Model, &Observation, Isometry3<f64>)],
    threads: Option<NonZeroUsize>,
    refiner: impl Fn() -> Refiner<S> + Sync,
) -> Vec<Refinement> {
    let threads = threads.or_else(|| thread::available_parallelism().ok());
    let threads = threads.map_or(1, usize::from).min(items.len());
    let next = AtomicUsize::new(0);
    let work = || {
        let (mut refiner, mut refined) = (refiner(), Vec::new());
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some((model, observation, init)) = items.get(index) else {
                return refined;
            };
            refined.push((index, refiner.refine(model, observation, init)));
        }
    };
    let mut refined = Vec::with_capacity(items.len());
    thread::scope(|scope| {
        let threads: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        for thread in threads {
            refined.extend(thread.join().unwrap_or_else(|panic| resume_unwind(panic)));
        }
    });
    refined.sort_unstable_by_key(|(index, _)| *index);
    refined.into_iter().map(|(_, refined)| refined).collect()
}

//! Many hypotheses on several threads, with Ctrl-C.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::time::Duration;

use hybrid_icp::core::{Isometry3, Model, Observation};
use hybrid_icp::{Refinement, Refiner, StageRecord, Trace};
use pyo3::prelude::*;

/// How often signals are looked for.
const SIGNALS: Duration = Duration::from_millis(50);

/// One hypothesis refined.
pub(crate) type Refined = (Refinement, Vec<StageRecord>);

/// Refines every hypothesis, one refiner per thread; results are in the order of the hypotheses,
/// with the bits of single calls.
///
/// Called without the GIL. The threads take one hypothesis after the other from a counter and keep
/// their results to themselves; the caller sleeps meanwhile, but for a look at the signals now and
/// then. An exception of a signal handler, such as `KeyboardInterrupt`, ends it after the
/// hypotheses in hand. Threads are started anew for every batch: a pool would be lost, and waited
/// for in vain, in a process that was forked.
pub(crate) fn run(
    model: &Model,
    observation: &Observation,
    inits: &[Isometry3<f64>],
    refiners: &mut [Refiner],
) -> PyResult<Vec<Refined>> {
    let (cancelled, next) = (AtomicBool::new(false), AtomicUsize::new(0));
    let (cancelled, next) = (&cancelled, &next);
    let mut ordered: Vec<Option<Refined>> = inits.iter().map(|_| None).collect();
    std::thread::scope(|scope| {
        // Nothing is sent: that the last thread has dropped its end is the message.
        let (at_work, ended) = mpsc::channel::<()>();
        let threads: Vec<_> = refiners
            .iter_mut()
            .map(|refiner| {
                let at_work = at_work.clone();
                scope.spawn(move || {
                    let mut results = Vec::with_capacity(inits.len());
                    while !cancelled.load(Ordering::Relaxed) {
                        let index = next.fetch_add(1, Ordering::Relaxed);
                        let Some(init) = inits.get(index) else { break };
                        let mut trace = Trace::new();
                        let refined = refiner.refine_observed(model, observation, init, &mut trace);
                        results.push((index, (refined, trace.stages)));
                    }
                    drop(at_work);
                    results
                })
            })
            .collect();
        drop(at_work);
        let waited = wait(&ended);
        cancelled.store(true, Ordering::Relaxed);
        for thread in threads {
            for (index, refined) in thread.join().unwrap_or_else(|panic| resume_unwind(panic)) {
                ordered[index] = Some(refined);
            }
        }
        waited
    })?;
    Ok(ordered.into_iter().flatten().collect())
}

/// Waits until the other end is dropped, and looks for signals meanwhile.
fn wait(ended: &Receiver<()>) -> PyResult<()> {
    while ended.recv_timeout(SIGNALS) == Err(RecvTimeoutError::Timeout) {
        Python::attach(|py| py.check_signals())?;
    }
    Ok(())
}

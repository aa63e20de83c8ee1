//! Refines many hypotheses on several threads, and stops on Ctrl-C.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::time::Duration;

use hybrid_icp::core::{Isometry3, Model, Observation};
use hybrid_icp::icp::Alternative;
use hybrid_icp::{Refinement, Refiner, StageRecord, Trace};
use pyo3::prelude::*;

/// Interval between checks for signals.
const SIGNALS: Duration = Duration::from_millis(50);

/// A refined hypothesis with its stages.
pub(crate) type Refined = (Refinement, Vec<StageRecord>, Vec<Alternative>);

/// Refines every hypothesis, with one refiner per thread.
///
/// The results are in the order of the hypotheses and have the bits of single calls. Call it
/// without the GIL. Each thread takes the next hypothesis from a shared counter and keeps its own
/// results. The caller waits and checks for signals at intervals. If a signal handler raises an
/// exception, such as `KeyboardInterrupt`, the threads finish their current hypotheses and stop.
///
/// Every batch starts new threads. After a fork, the child process would wait forever for the
/// threads of a pool, which exist only in the parent.
pub(crate) fn run(
    model: &Model,
    observation: &Observation,
    inits: &[Isometry3<f64>],
    refiners: &mut [Refiner],
) -> PyResult<Vec<Refined>> {
    let (canceled, next) = (AtomicBool::new(false), AtomicUsize::new(0));
    let (canceled, next) = (&canceled, &next);
    let mut ordered: Vec<Option<Refined>> = inits.iter().map(|_| None).collect();
    std::thread::scope(|scope| {
        // Nothing is sent. The channel closes when the last thread drops its end.
        let (at_work, ended) = mpsc::channel::<()>();
        let threads: Vec<_> = refiners
            .iter_mut()
            .map(|refiner| {
                let at_work = at_work.clone();
                scope.spawn(move || {
                    let mut results = Vec::with_capacity(inits.len());
                    while !canceled.load(Ordering::Relaxed) {
                        let index = next.fetch_add(1, Ordering::Relaxed);
                        let Some(init) = inits.get(index) else { break };
                        let mut trace = Trace::new();
                        let refined = refiner.refine_observed(model, observation, init, &mut trace);
                        let others = refiner.alternatives().to_vec();
                        results.push((index, (refined, trace.stages, others)));
                    }
                    drop(at_work);
                    results
                })
            })
            .collect();
        drop(at_work);
        let waited = wait(&ended);
        canceled.store(true, Ordering::Relaxed);
        for thread in threads {
            for (index, refined) in thread.join().unwrap_or_else(|panic| resume_unwind(panic)) {
                ordered[index] = Some(refined);
            }
        }
        waited
    })?;
    Ok(ordered.into_iter().flatten().collect())
}

/// Waits until the other end is dropped, and checks for signals meanwhile.
fn wait(ended: &Receiver<()>) -> PyResult<()> {
    while ended.recv_timeout(SIGNALS) == Err(RecvTimeoutError::Timeout) {
        Python::attach(|py| py.check_signals())?;
    }
    Ok(())
}

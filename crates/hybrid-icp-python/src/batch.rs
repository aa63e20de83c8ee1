//! Many hypotheses on several threads, with Ctrl-C.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use hybrid_icp::{Isometry3, Model, Observation, Refinement, Refiner, StageRecord, Trace};
use pyo3::prelude::*;

/// How often signals are looked for.
const SIGNALS: Duration = Duration::from_millis(50);

/// One hypothesis refined.
pub(crate) type Refined = (Refinement, Vec<StageRecord>);

/// Refines every hypothesis, one refiner per thread; results are in the order of the hypotheses, with the bits of single calls.
///
/// Called without the GIL. An exception of a signal handler, such as `KeyboardInterrupt`, ends it after the hypotheses in hand.
pub(crate) fn run(
    model: &Model,
    observation: &Observation,
    inits: &[Isometry3<f64>],
    refiners: &mut [Refiner],
) -> PyResult<Vec<Refined>> {
    let (cancelled, next) = (AtomicBool::new(false), AtomicUsize::new(0));
    let (cancelled, next) = (&cancelled, &next);
    std::thread::scope(|scope| {
        let (sender, results) = mpsc::channel();
        for refiner in refiners {
            let sender = sender.clone();
            scope.spawn(move || {
                while !cancelled.load(Ordering::Relaxed) {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(init) = inits.get(index) else { break };
                    let mut trace = Trace::new();
                    let refined = refiner.refine_observed(model, observation, init, &mut trace);
                    if sender.send((index, (refined, trace.stages))).is_err() {
                        break;
                    }
                }
            });
        }
        drop(sender);
        let collected = collect(&results, inits.len());
        cancelled.store(true, Ordering::Relaxed);
        collected
    })
}

/// Puts results in order until there are no more, and looks for signals meanwhile.
fn collect(results: &Receiver<(usize, Refined)>, count: usize) -> PyResult<Vec<Refined>> {
    let mut ordered: Vec<Option<Refined>> = (0..count).map(|_| None).collect();
    let mut looked = Instant::now();
    loop {
        match results.recv_timeout(SIGNALS) {
            Ok((index, refined)) => ordered[index] = Some(refined),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        if looked.elapsed() >= SIGNALS {
            Python::attach(|py| py.check_signals())?;
            looked = Instant::now();
        }
    }
    Ok(ordered.into_iter().flatten().collect())
}

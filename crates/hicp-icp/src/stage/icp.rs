//! Algorithm 1: generic ICP.

use std::ops::ControlFlow;

use hicp_association::{DataAssociation, OutlierFilter, PointSelection};
use hicp_core::{Context, Isometry3, Problem, se3};
use hicp_metric::ErrorMetric;

use crate::observer::{IterationEvent, StageEvent};
use crate::outcome::{Evaluation, Outcome, Quality, Termination, Verdict};
use crate::session::Session;
use crate::stage::stage_trait::Stage;
use crate::stop::stop_rule::{Progress, StopRule};

/// The most evaluations that a stage makes, whatever its stop rules say.
pub const MAX_ITERATIONS: usize = 1000;

/// Generic ICP (Algorithm 1 of the paper) from its five components, each a public field.
///
/// The points are selected once, at the initial pose. A turn then associates at the candidate pose, filters, and minimises,
/// which gives the loss *there* and the next increment; the stop rule judges. A candidate is accepted only after it was
/// evaluated, so the returned pose is the last one that the rules let stand, and rolling back costs nothing.
///
/// Whatever the stop rules say, a stage ends after [`MAX_ITERATIONS`] evaluations: a rule set without a limit may never fire.
///
/// No pairs, or pairs that determine no step, end the stage with the pose accepted last.
///
/// ```
/// use hicp_association::{Projective, VisibleSurface};
/// use hicp_icp::{Convergence, Divergence, Icp, IterationLimit};
/// use hicp_metric::PointToPlane;
///
/// let fine = Icp {
///     selection: VisibleSurface::default(),
///     association: Projective,
///     filter: (),
///     metric: PointToPlane,
///     stop: (Divergence::strict(), Convergence::default(), IterationLimit(50)),
/// };
/// # let _ = fine;
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Icp<P, A, F, M, S> {
    /// Chooses the model points.
    pub selection: P,
    /// Pairs them with observed points.
    pub association: A,
    /// Removes or re-weights pairs.
    pub filter: F,
    /// What is minimised.
    pub metric: M,
    /// When to end.
    pub stop: S,
}

impl<P, A, F, M, S> Stage for Icp<P, A, F, M, S>
where
    P: PointSelection,
    A: DataAssociation,
    F: OutlierFilter,
    M: ErrorMetric,
    S: StopRule,
{
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        let workspace = &mut *session.workspace;
        let (source, pairs) = (&mut workspace.source, &mut workspace.pairs);
        let mut context = Context::new(*problem, &mut workspace.renders);
        source.clear();
        let finite = se3::is_finite(init);
        if finite {
            self.selection.select(&mut context, init, source);
        }
        self.stop.start();

        let mut accepted: Option<(Isometry3<f64>, Evaluation)> = None;
        let mut candidate = *init;
        let mut first = None;
        let mut iteration = 0;
        let termination = loop {
            pairs.begin(&candidate, source.len());
            if finite {
                // Even without a source: an association may start from the observation.
                self.association
                    .associate(&mut context, source, &candidate, pairs);
                self.filter.begin(iteration);
                self.filter.filter(problem, pairs);
                self.metric.begin(iteration, init);
            }
            iteration += 1;
            if pairs.is_empty() {
                break Termination::NoPairs;
            }
            let Some(step) = self.metric.minimize(pairs) else {
                break Termination::Degenerate;
            };
            let current = Evaluation {
                n_pairs: pairs.len(),
                mean_loss: step.mean_loss,
            };
            let first = *first.get_or_insert(current);
            let wish = session.observer.on_iteration(&IterationEvent {
                iteration: iteration - 1,
                camera_from_object: &candidate,
                evaluation: current,
                increment: &step.increment,
            });
            let verdict = self.stop.check(&Progress {
                iteration: iteration - 1,
                current,
                first,
                previous: accepted.map(|(_, evaluation)| evaluation),
                camera_from_object: &candidate,
                init,
                increment: &step.increment,
            });
            match verdict {
                ControlFlow::Break(termination) if termination.is_rollback() => break termination,
                ControlFlow::Break(termination) => {
                    accepted = Some((candidate, current));
                    break termination;
                }
                ControlFlow::Continue(()) => accepted = Some((candidate, current)),
            }
            if wish.is_break() {
                break Termination::Stopped;
            }
            if iteration >= MAX_ITERATIONS {
                break Termination::IterationLimit;
            }
            let mut next = step.increment * candidate;
            // Products of unit quaternions drift off the unit sphere; a long run must stay in SO(3).
            next.rotation.renormalize();
            if !se3::is_finite(&next) {
                break Termination::Degenerate;
            }
            candidate = next;
        };

        let pose = accepted.map_or(*init, |(pose, _)| pose);
        let mut quality = None;
        if accepted.is_some() {
            if *pairs.camera_from_object() != pose {
                // Rolled back: the pairs in hand are those of the rejected pose, one iteration after the accepted one.
                pairs.begin(&pose, source.len());
                self.association
                    .associate(&mut context, source, &pose, pairs);
                let accepted_in = iteration.saturating_sub(2);
                self.filter.begin(accepted_in);
                self.filter.filter(problem, pairs);
                self.metric.begin(accepted_in, init);
            }
            quality = Quality::of(pairs, &mut self.metric);
        }
        let outcome = Outcome {
            camera_from_object: pose,
            termination,
            verdict: if same_bits(&pose, init) {
                Verdict::KeptInitial(termination)
            } else {
                Verdict::Refined
            },
            iterations: iteration,
            evaluation: accepted.map(|(_, evaluation)| evaluation),
            quality,
        };
        session.observer.on_stage_end(&StageEvent {
            selection: self.selection.name(),
            association: self.association.name(),
            metric: self.metric.name(),
            n_source: source.len(),
            outcome: &outcome,
        });
        outcome
    }
}

/// Whether two poses are one to the bit; by value a pose with a NaN would differ from itself.
fn same_bits(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
    let coordinates = |pose: &Isometry3<f64>| {
        let (t, q) = (pose.translation.vector, pose.rotation.coords);
        [t.x, t.y, t.z, q.x, q.y, q.z, q.w].map(f64::to_bits)
    };
    coordinates(a) == coordinates(b)
}

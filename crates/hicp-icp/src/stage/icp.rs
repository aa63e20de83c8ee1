//! Algorithm 1: generic ICP.

use hicp_association::{DataAssociation, OutlierFilter, PointSelection};
use hicp_core::internal::pose_bits;
use hicp_core::{Context, Isometry3, Iteration, Problem, se3};
use hicp_metric::Minimize;

use crate::observer::{IterationEvent, StageEvent};
use crate::outcome::{Evaluation, Outcome, Quality, Termination, Verdict};
use crate::session::Session;
use crate::stage::stage_trait::Stage;
use crate::stop::stop_rule::{Judgment, Progress, StopRule};

/// The largest number of evaluations of a stage, for all stop rules.
pub const MAX_ITERATIONS: usize = 1000;

/// Generic ICP (Algorithm 1 of the paper), with its five components as public fields.
///
/// The points are selected once, at the initial pose. An iteration then associates at the candidate
/// pose, filters, and minimizes, which gives the loss *at the candidate* and the next increment.
/// Then the stop rule judges. A candidate is accepted only after its evaluation. The returned pose
/// is therefore the last one that the rules accept, and a rollback costs nothing.
///
/// A stage ends after [`MAX_ITERATIONS`] evaluations at the latest, because a rule set without a
/// limit may never fire.
///
/// If there are no pairs, or if the pairs do not determine a step, the stage ends with the last
/// accepted pose.
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
    /// Selects the model points.
    pub selection: P,
    /// Pairs the selected points with observed points.
    pub association: A,
    /// Removes or re-weights pairs.
    pub filter: F,
    /// Defines the error that each iteration minimizes.
    pub metric: M,
    /// Decides when the stage ends.
    pub stop: S,
}

impl<P, A, F, M, S> Stage for Icp<P, A, F, M, S>
where
    P: PointSelection,
    A: DataAssociation,
    F: OutlierFilter,
    M: Minimize,
    S: StopRule,
{
    fn name(&self) -> &'static str {
        "icp"
    }

    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        let workspace = &mut *session.workspace;
        let (source, pairs) = (&mut workspace.source, &mut workspace.pairs);
        let mut context =
            Context::new(*problem, &mut workspace.renders).in_cascade(session.cascade_init);
        let unsupported = (self.selection.unsupported(problem))
            .or_else(|| self.association.unsupported(problem))
            .or_else(|| self.filter.unsupported(problem));
        source.clear();
        let finite = se3::is_finite(init);
        if finite && unsupported.is_none() {
            self.selection.select(&mut context, init, source);
        }
        self.stop.start();

        let mut accepted: Option<Accepted<'_>> = None;
        let mut candidate = *init;
        let mut first = None;
        let mut evaluations = 0;
        let termination = loop {
            if let Some(part) = unsupported {
                break Termination::Unsupported(part);
            }
            let iteration = Iteration::new(evaluations, init, *problem);
            pairs.begin(&candidate, source.len());
            if finite {
                // Call it even without a source: an association may start from the observation.
                self.association
                    .associate(&mut context, source, &candidate, pairs);
                self.filter.filter(&iteration, pairs);
            }
            evaluations += 1;
            if pairs.is_empty() {
                break Termination::NoPairs;
            }
            let Some(step) = self.metric.minimize(&iteration, pairs) else {
                // Deviation: pairs that determine no step: §IV-B.2 ends a stage without pairs. Here
                // fewer than 3 pairs (point-to-point) or 6 (point-to-plane) end it too, and the
                // last accepted pose is returned.
                break Termination::Degenerate;
            };
            let current = Evaluation {
                n_pairs: pairs.len(),
                mean_loss: step.mean_loss,
            };
            let first = *first.get_or_insert(current);
            let stops = session.observer.on_iteration(&IterationEvent {
                iteration: iteration.index,
                camera_from_object: &candidate,
                evaluation: current,
                increment: &step.increment,
                pairs: Some(pairs),
            });
            let stops = stops.is_break();
            let progress = Progress {
                current,
                first,
                previous: accepted.map(|a| a.evaluation),
                camera_from_object: &candidate,
                increment: &step.increment,
                pairs,
            };
            let judgment = self.stop.check(&iteration, &progress);
            // Deviation: last increment: §III-A, Algorithm 1, applies the increment of its last
            // iteration without another evaluation. Here a pose is returned only after its pairs
            // and its loss were computed, because the rules of §IV-B judge these.
            if let Judgment::Reject(termination) = judgment {
                break if stops {
                    Termination::Stopped
                } else {
                    termination
                };
            }
            accepted = Some(Accepted {
                camera_from_object: candidate,
                evaluation: current,
                iteration,
            });
            if stops {
                break Termination::Stopped;
            }
            if let Judgment::Accept(termination) = judgment {
                break termination;
            }
            if evaluations >= MAX_ITERATIONS {
                break Termination::IterationLimit;
            }
            let next = se3::compose(&step.increment, &candidate);
            if !se3::is_finite(&next) {
                break Termination::Degenerate;
            }
            candidate = next;
        };

        let pose = accepted.map_or(*init, |a| a.camera_from_object);
        let quality = accepted.and_then(|accepted| {
            if *pairs.camera_from_object() != pose {
                // After a rollback the buffer holds the pairs of the rejected pose.
                pairs.begin(&pose, source.len());
                self.association
                    .associate(&mut context, source, &pose, pairs);
                self.filter.filter(&accepted.iteration, pairs);
            }
            Quality::of(&accepted.iteration, pairs, &mut self.metric)
        });
        let outcome = Outcome {
            camera_from_object: pose,
            termination,
            // By value, a pose with a NaN would differ from itself.
            verdict: if pose_bits(&pose) == pose_bits(init) {
                Verdict::KeptInitial(termination)
            } else {
                Verdict::Refined
            },
            iterations: evaluations,
            evaluation: accepted.map(|a| a.evaluation),
            quality,
        };
        let names = &mut workspace.names;
        names.clear();
        self.filter.names(names);
        let n_filters = names.len();
        self.stop.names(names);
        let (filters, stop_rules) = names.split_at(n_filters);
        session.observer.on_stage_end(&StageEvent {
            selection: self.selection.name(),
            association: self.association.name(),
            filters,
            metric: self.metric.label(),
            stop_rules,
            n_source: source.len(),
            outcome: &outcome,
        });
        outcome
    }
}

/// The last accepted pose, and the iteration that evaluated it.
#[derive(Clone, Copy)]
struct Accepted<'a> {
    camera_from_object: Isometry3<f64>,
    evaluation: Evaluation,
    iteration: Iteration<'a>,
}

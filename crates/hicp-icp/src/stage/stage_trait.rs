//! The trait of stages: one verb, closed under composition.

use std::time::Duration;

use hicp_core::internal::type_label;
use hicp_core::{Isometry3, Problem};

use crate::outcome::Outcome;
use crate::session::Session;

/// Refines a pose.
///
/// [`Icp`](crate::Icp), [`Cascade`](crate::Cascade), [`Repeat`](crate::Repeat) and `Switch` are
/// stages, and so is any composition of them: Hybrid ICP is a struct literal.
///
/// # Contract
///
/// - Never fails and never panics on data. The [`Outcome`] states how the stage ended, and its pose
///   is finite if `init` is.
/// - The returned pose was evaluated, or is `init` bit for bit.
/// - Pure: equal inputs give equal bits, whatever ran before. `&mut self` and the session's
///   workspace are scratch.
/// - After a break of the observer, it ends with [`Termination::Stopped`](crate::Termination), and
///   calls the observer for no other iteration.
/// - A warm run (the same stage and workspace before, on inputs that are not larger) allocates
///   nothing on the heap.
///
/// A stage with its own loop reports to the observer, which can end it:
///
/// ```
/// use hicp_association::{DataAssociation, NearestNeighbor};
/// use hicp_core::{Correspondences, Isometry3, Problem};
/// use hicp_icp::{Evaluation, IterationEvent, Outcome, Session, Stage, StageEvent, Termination};
/// use hicp_metric::{ErrorMetric, PointToPoint};
///
/// /// Evaluates ten poses at most.
/// #[derive(Default)]
/// struct TenPoses {
///     nearest: NearestNeighbor,
///     pairs: Correspondences,
/// }
///
/// impl Stage for TenPoses {
///     fn run(
///         &mut self,
///         problem: &Problem<'_>,
///         init: &Isometry3<f64>,
///         session: &mut Session<'_>,
///     ) -> Outcome {
///         let ended = Termination::Custom("ten_poses");
///         let source = problem.source().map_or(&[][..], |source| source.surfels());
///         let (mut pose, mut outcome) = (*init, Outcome::kept(init, ended));
///         for iteration in 0..10 {
///             self.pairs.begin(&pose, source.len());
///             let mut context = session.context(problem);
///             self.nearest.associate(&mut context, source, &pose, &mut self.pairs);
///             let Some(step) = PointToPoint.step(&self.pairs) else { break };
///             let (n_pairs, mean_loss) = (self.pairs.len(), step.mean_loss);
///             let evaluation = Evaluation { n_pairs, mean_loss };
///             let event = IterationEvent::new(iteration, &pose, evaluation, &step.increment);
///             let stops = session.observer.on_iteration(&event).is_break();
///             // Composed stages end after a stage with this reason.
///             let ended = if stops { Termination::Stopped } else { ended };
///             outcome = match iteration {
///                 0 => Outcome::kept(init, ended),
///                 _ => Outcome::refined(pose, ended),
///             };
///             if stops {
///                 break;
///             }
///             pose = step.increment * pose;
///         }
///         let mut event = StageEvent::new(&outcome);
///         event.association = self.nearest.name();
///         session.observer.on_stage_end(&event);
///         outcome
///     }
/// }
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a stage",
    label = "this must implement `Stage`",
    note = "stages are `Icp` (whose five fields must implement `PointSelection`, `DataAssociation`, `OutlierFilter`, `ErrorMetric` and `StopRule`), `Cascade` of a tuple of up to eight stages or of a `Vec`, `Repeat`, `Switch`, and compositions of them; a `Preset` becomes one by `.build()`"
)]
pub trait Stage {
    /// Runs the stage from `init`, the initial `camera_from_object`.
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome;

    /// Returns the time limit of a run, if the stage has one.
    ///
    /// A stage around another one returns the limit of the inner stage. A caller that starts a
    /// search with this stage as its last step uses the limit for the whole search. The provided
    /// method returns `None`.
    fn time_limit(&self) -> Option<Duration> {
        None
    }

    /// Returns the name of the stage, for its [`DecisionEvent`](crate::DecisionEvent)s.
    ///
    /// Other events do not contain it: a [`StageEvent`](crate::StageEvent) has the names of the
    /// components.
    fn name(&self) -> &'static str {
        type_label::<Self>()
    }
}

/// A boxed stage, for stages that a name or a file selects.
///
/// It runs the same code as the struct literal and gives the same bits.
pub type BoxedStage = Box<dyn Stage + Send>;

macro_rules! forward {
    ($($pointer:ty),+) => {$(
        impl<T: Stage + ?Sized> Stage for $pointer {
            fn run(
                &mut self,
                problem: &Problem<'_>,
                init: &Isometry3<f64>,
                session: &mut Session<'_>,
            ) -> Outcome {
                (**self).run(problem, init, session)
            }

            fn time_limit(&self) -> Option<Duration> {
                (**self).time_limit()
            }

            fn name(&self) -> &'static str {
                (**self).name()
            }
        }
    )+};
}
forward!(Box<T>, &mut T);

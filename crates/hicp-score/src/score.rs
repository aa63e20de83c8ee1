//! The trait of scores.

use hicp_core::internal::type_label;
use hicp_core::{Context, Isometry3, Problem};

/// Scores a pose against the observation: 0 is perfect, higher is worse.
///
/// Guards, switchers and searches compare poses by a score. It receives the context, so that it can
/// share the render at the pose ([`Context::view`]) with the selection that starts there.
///
/// # Contract
///
/// - Never negative and never NaN. If a needed side of the problem is absent, no pose is better
///   than another: most scores then return 1.
/// - Pure: equal inputs give equal bits. `&mut self` is scratch.
///
/// ```
/// use hicp_core::{Context, Isometry3};
/// use hicp_score::Score;
///
/// /// The share of the measured pixels of the mask that the model does not cover.
/// struct Uncovered;
///
/// impl Score for Uncovered {
///     fn score(&mut self, context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> f64 {
///         let Some((_, observation)) = context.problem.sides() else { return 1.0 };
///         let Some(view) = context.view(camera_from_object) else { return 1.0 };
///         let (depth, mask) = (observation.depth(), observation.mask());
///         let measured = |u, v| mask.get(u, v) == Some(true) && depth.get(u, v) > Some(0.0);
///         let covered = view.covered().filter(|&(u, v)| measured(u, v)).count();
///         1.0 - covered as f64 / observation.n_measured().max(1) as f64
///     }
/// }
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a score",
    label = "this must implement `Score`",
    note = "`Score` is implemented by `MeanVsd`, `SampledMve`, `Vsd` and boxes of scores"
)]
pub trait Score {
    /// Returns the score of a pose `camera_from_object`; never NaN.
    fn score(&mut self, context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> f64;

    /// Returns the name in traces.
    fn name(&self) -> &'static str {
        type_label::<Self>()
    }

    /// Returns the name of the component that does not support a problem, or `None`.
    ///
    /// For example, a projection needs a depth image and does not support two point clouds. A stage
    /// ends with `Termination::Unsupported` and this name before its first iteration. A component
    /// around another one forwards the call. The provided method returns `None`.
    fn unsupported(&self, _problem: &Problem<'_>) -> Option<&'static str> {
        None
    }
}

macro_rules! forward {
    ($($pointer:ty),*) => {$(
        impl<T: Score + ?Sized> Score for $pointer {
            fn score(&mut self, context: &mut Context<'_>, pose: &Isometry3<f64>) -> f64 {
                (**self).score(context, pose)
            }

            fn name(&self) -> &'static str {
                (**self).name()
            }

            fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
                (**self).unsupported(problem)
            }
        }
    )*};
}

forward!(Box<T>, &mut T);

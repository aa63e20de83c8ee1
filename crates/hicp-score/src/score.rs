//! The trait of scores.

use hicp_core::internal::type_label;
use hicp_core::{Context, Isometry3, Problem};

/// Scores a pose: 0 is perfect, higher is worse.
///
/// It is pure: equal inputs give equal bits. Use `context.view(pose)` for the render at the pose. A
/// selection that starts from the same pose then shares it.
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

    /// Returns the name of the part that cannot work on a problem, such as a projection between
    /// point clouds.
    ///
    /// A stage then ends with that name before it runs. The provided method returns `None`.
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

//! The trait of switchers.

use hicp_core::internal::type_label;
use hicp_core::{Context, Isometry3, Problem};
use hicp_icp::{Regime, RegimeEvent};

/// Selects the regime of a pose from the image (Dynamic Switching, §IV-A).
///
/// A switch calls it at the initial pose, before it runs a stage, so the image decides which
/// registration can succeed. The result includes the score that decided, if there is one. Observers
/// report it, and [`SwitchUntilStall`](crate::SwitchUntilStall) keeps the pose with the lowest
/// score. Without a score, that stage keeps its initial pose.
///
/// Pure: equal inputs give equal results. `&mut self` is scratch.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a switcher",
    label = "this must implement `Switcher`",
    note = "`Switch::switcher` accepts a `Switcher`, such as `Threshold`, or a fixed `Regime`"
)]
pub trait Switcher {
    /// Returns the regime of a pose `camera_from_object`, with the score that decided.
    fn regime(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
    ) -> RegimeEvent;

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
    ($($pointer:ty),+) => {$(
        impl<T: Switcher + ?Sized> Switcher for $pointer {
            fn regime(
                &mut self,
                context: &mut Context<'_>,
                camera_from_object: &Isometry3<f64>,
            ) -> RegimeEvent {
                (**self).regime(context, camera_from_object)
            }

            fn name(&self) -> &'static str {
                (**self).name()
            }

            fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
                (**self).unsupported(problem)
            }
        }
    )+};
}
forward!(Box<T>, &mut T);

/// Always selects this regime, which disables Dynamic Switching.
impl Switcher for Regime {
    fn regime(&mut self, _: &mut Context<'_>, _: &Isometry3<f64>) -> RegimeEvent {
        RegimeEvent {
            regime: *self,
            score: None,
        }
    }

    fn name(&self) -> &'static str {
        Regime::name(*self)
    }
}

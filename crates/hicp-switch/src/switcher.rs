//! The trait of switchers.

use hicp_core::internal::type_label;
use hicp_core::{Context, Isometry3, Problem};
use hicp_icp::{Regime, RegimeEvent};

/// Selects the regime of the current estimate from the image (Dynamic Switching, §IV-A).
///
/// It is pure: equal inputs give equal results, and `&mut self` is scratch.
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

    /// Returns the name of the part that cannot work on a problem, such as a projection between
    /// point clouds.
    ///
    /// A stage then ends with that name before it runs. The provided method returns `None`.
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

/// Selects always the same regime, which disables Dynamic Switching.
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

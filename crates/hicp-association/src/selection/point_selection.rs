//! The trait of point selections.

use hicp_core::internal::type_label;
use hicp_core::{Context, Isometry3, Problem, Surfel};

/// Selects the model points oᵢ that a stage registers (the first of the five ICP components, §II).
///
/// It is called once per stage run, at the stage's initial estimate. Points and normals are in the
/// object frame, in meters. `source` is empty at the call. Selecting nothing is not an error: the
/// stage then ends with "no pairs".
///
/// A selection is pure: equal inputs give equal points, and `&mut self` is scratch.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a point selection",
    label = "this must implement `PointSelection`",
    note = "`Icp::selection` accepts a `PointSelection`, or `()` for an association that starts from the observation"
)]
pub trait PointSelection {
    /// Fills `source` with the selected surfels.
    fn select(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
        source: &mut Vec<Surfel>,
    );

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
        impl<T: PointSelection + ?Sized> PointSelection for $pointer {
            fn select(
                &mut self,
                context: &mut Context<'_>,
                camera_from_object: &Isometry3<f64>,
                source: &mut Vec<Surfel>,
            ) {
                (**self).select(context, camera_from_object, source);
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

/// Selects no model points: for an association that starts from the observed points.
impl PointSelection for () {
    fn select(&mut self, _: &mut Context<'_>, _: &Isometry3<f64>, _: &mut Vec<Surfel>) {}

    fn name(&self) -> &'static str {
        "none"
    }
}

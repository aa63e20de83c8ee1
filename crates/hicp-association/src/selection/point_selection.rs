//! The trait of point selections.

use hicp_core::internal::type_label;
use hicp_core::{Context, Isometry3, Problem, Surfel};

/// Selects the model points oᵢ that a stage registers (the first of the five ICP components, §II).
///
/// It is called once per stage run, at the stage's initial pose, and not in every iteration. Only
/// over the same points are the losses and the numbers of pairs of two iterations comparable, which
/// stop rules need.
///
/// # Contract
///
/// - `source` is empty at the call. Its points and normals are in the object frame, in meters and
///   finite; normals have unit length.
/// - Selecting nothing is not an error. Unless the association starts from the observation, the
///   stage then ends with "no pairs".
/// - Pure: equal inputs give equal points. `&mut self` is scratch.
/// - For a render at the pose, it uses [`Context::view`], which a score at the same pose shares.
///
/// ```
/// use hicp_association::PointSelection;
/// use hicp_core::{Context, Isometry3, Problem, Surfel};
///
/// /// Removes points of another selection that the camera sees at a grazing angle.
/// struct NotGrazing<P>(P);
///
/// impl<P: PointSelection> PointSelection for NotGrazing<P> {
///     fn select(
///         &mut self,
///         context: &mut Context<'_>,
///         camera_from_object: &Isometry3<f64>,
///         source: &mut Vec<Surfel>,
///     ) {
///         self.0.select(context, camera_from_object, source);
///         let camera = camera_from_object.inverse().translation.vector.cast::<f32>();
///         source.retain(|surfel| {
///             let toward_camera = (camera - surfel.point.coords).normalize();
///             surfel.normal.dot(&toward_camera) > 0.3
///         });
///     }
///
///     fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
///         self.0.unsupported(problem)
///     }
/// }
/// ```
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

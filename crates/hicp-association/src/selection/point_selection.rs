//! The trait of point selections.

use hicp_core::{Context, Isometry3, Surfel, type_label};

/// Chooses the model points oᵢ that a stage registers (the first of the five ICP components, §II).
///
/// Called once per stage run, at the stage's initial estimate. Points and normals are in the object frame, metres.
/// `source` arrives empty. Selecting nothing is no error: the stage then ends with "no pairs".
///
/// A selection is pure: equal inputs give equal points, and `&mut self` is for scratch memory only.
pub trait PointSelection {
    /// Fills `source` with the chosen surfels.
    fn select(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
        source: &mut Vec<Surfel>,
    );

    /// Name in traces.
    fn name(&self) -> &'static str {
        type_label::<Self>()
    }
}

impl<T: PointSelection + ?Sized> PointSelection for Box<T> {
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
}

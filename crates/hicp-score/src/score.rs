//! The trait of scores.

use hicp_core::internal::type_label;
use hicp_core::{Context, Isometry3};

/// Says how bad a pose is: 0 is perfect, higher is worse.
///
/// Pure: equal inputs give equal bits. Ask `context.view(pose)` for the render at the pose; the selection that starts from
/// that pose then gets it for free.
pub trait Score {
    /// Returns the score of a pose; never NaN.
    fn score(&mut self, context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> f64;

    /// Name in traces.
    fn name(&self) -> &'static str {
        type_label::<Self>()
    }
}

impl<T: Score + ?Sized> Score for Box<T> {
    fn score(&mut self, context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> f64 {
        (**self).score(context, camera_from_object)
    }

    fn name(&self) -> &'static str {
        (**self).name()
    }
}

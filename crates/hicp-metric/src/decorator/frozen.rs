//! Degrees of freedom that are not refined.

use hicp_core::{Correspondences, Iteration, Point3, UnitQuaternion};

use crate::metric::error_metric::Step;
use crate::metric::minimize::Minimize;
use crate::system::normal_equations::NormalEquations;

/// The axes along which motion is frozen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Frame {
    /// The camera's: x right, y down, z along the optical axis.
    #[default]
    Camera,
    /// The object's, at the pose that the pairs were made at.
    Object,
}

/// A metric minimised over some of the six degrees of freedom: the others' components of the increment are exactly zero.
///
/// `translation` is the displacement of the object's origin, `rotation` the rotation vector about that origin, both along the axes
/// of `frame`. Freezing the rotation about the axis of a bottle, or the height of what stands on a table, are the uses. The
/// components of one increment are zero; several turns about two axes compose to a small one about the third, as rotations do.
///
/// The constraint is on the normal equations (the loss is minimised over what is free, the rest is not cut off after), so the step is
/// Gauss–Newton's also for metrics with a closed form. With nothing frozen it is the metric's own, bit for bit; with all
/// frozen it is the identity. Nested in another, the outer one alone counts. Needs as many rows as unknowns are free.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Frozen<M> {
    /// What is minimised.
    pub metric: M,
    /// Which axes; default the camera's.
    pub frame: Frame,
    /// True where the object's origin must not move along that axis; default all false.
    pub translation: [bool; 3],
    /// True where the object must not turn about that axis; default all false.
    pub rotation: [bool; 3],
}

impl<M: Minimize> Minimize for Frozen<M> {
    fn inner(&mut self, _: &Iteration<'_>) -> Option<&mut dyn Minimize> {
        Some(&mut self.metric)
    }

    fn system(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
    ) -> Option<NormalEquations> {
        let mut system = self.metric.system(iteration, pairs)?;
        let pose = pairs.camera_from_object();
        let axes = match self.frame {
            Frame::Camera => UnitQuaternion::identity(),
            Frame::Object => pose.rotation,
        };
        let origin = Point3::from(pose.translation.vector);
        system.freeze(&axes, &origin, self.translation, self.rotation);
        Some(system)
    }

    fn minimize(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<Step> {
        if !self.translation.contains(&true) && !self.rotation.contains(&true) {
            return self.metric.minimize(iteration, pairs);
        }
        Some(Step {
            increment: self.system(iteration, pairs)?.solve()?,
            mean_loss: self.mean_loss(iteration, pairs)?,
        })
    }

    fn label(&self) -> &'static str {
        "frozen"
    }
}

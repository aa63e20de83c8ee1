//! Degrees of freedom that are not refined.

use hicp_core::{Correspondences, Iteration, Point3, UnitQuaternion};

use crate::metric::error_metric::Step;
use crate::metric::minimize::Minimize;
use crate::system::normal_equations::NormalEquations;

/// The axes along which motion is frozen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Frame {
    /// The camera frame: x right, y down, z along the optical axis.
    #[default]
    Camera,
    /// The object frame at the pose of the pairs.
    Object,
}

/// Minimizes a metric over some of the six degrees of freedom; the others do not change.
///
/// Frozen components of the increment are exactly zero. `translation` is the displacement of the
/// object's origin, and `rotation` the rotation vector around that origin, both along the axes of
/// `frame`. Examples are the rotation around the axis of a bottle, or the height of an object on a
/// table. The components of each increment are zero. Several rotations around two axes still
/// compose to a small one around the third.
///
/// The constraint applies to the normal equations: the loss is minimized over the free components,
/// instead of cutting off the others later. The step is therefore that of Gauss–Newton, even for
/// metrics with a closed form. If nothing is frozen, it is the metric's own step, bit for bit. If
/// all is frozen, it is the identity. Of nested `Frozen`, only the outer one counts. It needs as
/// many rows as free unknowns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Frozen<M> {
    /// The metric to minimize.
    pub metric: M,
    /// The axes; by default those of the camera.
    pub frame: Frame,
    /// Axes along which the object's origin must not move; by default none.
    pub translation: [bool; 3],
    /// Axes around which the object must not rotate; by default none.
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

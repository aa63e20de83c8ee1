//! Sizes of displacements of an object.

use hicp_core::{Isometry3, Matrix6, Model, Point3, UnitVector3, Vector6};
use hicp_score::mssd;

use super::motion::{Motion, difference};

/// Distance between two poses that are different, in diameters.
pub(super) const DIFFERENT_DIAMETERS: f64 = 0.1;

/// The sizes and symmetries of an object that tell how far two poses are apart.
#[derive(Clone, Debug)]
pub(super) struct Extent {
    pub(super) center: Point3<f64>,
    pub(super) radius: f64,
    pub(super) diameter: f64,
    /// Directions of the axes of continuous symmetries, object frame.
    axes: Vec<UnitVector3<f64>>,
    points: Vec<Point3<f32>>,
    symmetries: Vec<Isometry3<f64>>,
}

impl Extent {
    pub(super) fn new(model: &Model) -> Self {
        let axes = model.symmetries().continuous.iter();
        Self {
            center: model.center(),
            radius: model.radius(),
            diameter: model.diameter(),
            axes: axes.map(|axis| axis.direction()).collect(),
            points: model.samples().iter().map(|s| s.point).collect(),
            symmetries: model.symmetries().motions(),
        }
    }

    /// Returns whether two poses are more than a tenth of the diameter apart, up to symmetry.
    pub(super) fn differ(&self, a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
        mssd(a, b, &self.points, &self.symmetries) > DIFFERENT_DIAMETERS * self.diameter
    }

    /// Returns the standard deviation of the least determined displacement, meters.
    ///
    /// Rotations count by the radius. Those around declared axes of symmetry do not count.
    pub(super) fn deviation(&self, motion: &Motion) -> f64 {
        let scale = self.scale(motion.pose());
        let covariance = scale * motion.covariance() * scale.transpose();
        covariance.symmetric_eigenvalues().max().max(0.0).sqrt()
    }

    /// Returns the distance between two poses in the same sense, meters.
    pub(super) fn distance(&self, a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
        (self.scale(b) * difference(a, b, &self.center)).norm()
    }

    /// Returns the map from a displacement of a pose (meters, radians) to one of the surface.
    fn scale(&self, pose: &Isometry3<f64>) -> Matrix6<f64> {
        let radius = self.radius;
        let mut scale = Matrix6::identity();
        for axis in &self.axes {
            let direction = (pose.rotation * axis).into_inner();
            let mut block = scale.fixed_view_mut::<3, 3>(3, 3);
            let free = direction * (direction.transpose() * &block);
            block -= free;
        }
        scale * Matrix6::from_diagonal(&Vector6::new(1.0, 1.0, 1.0, radius, radius, radius))
    }
}

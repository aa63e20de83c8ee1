//! Sizes of displacements of an object.

use hicp_core::internal::small::{eigen3, eigen6, join};
use hicp_core::{
    Isometry3, Matrix3, Matrix6, Model, Point3, Translation3, UnitVector3, Vector3, Vector6, so3,
};
use hicp_score::mssd;

/// Distance between two poses that are different, in diameters.
pub(crate) const DIFFERENT_DIAMETERS: f64 = 0.1;

/// The sizes and symmetries of an object that tell how far two poses are apart.
#[derive(Clone, Debug)]
pub(crate) struct Extent {
    pub(crate) center: Point3<f64>,
    pub(crate) radius: f64,
    pub(crate) diameter: f64,
    /// The map from a rotation vector to the displacement of the surface, object frame, meters per
    /// radian.
    levers: Matrix3<f64>,
    /// Directions of the axes of continuous symmetries, object frame.
    axes: Vec<UnitVector3<f64>>,
    points: Vec<Point3<f32>>,
    symmetries: Vec<Isometry3<f64>>,
}

impl Extent {
    pub(crate) fn new(model: &Model) -> Self {
        let axes = model.symmetries().continuous.iter();
        Self {
            center: model.center(),
            radius: model.radius(),
            diameter: model.diameter(),
            levers: levers(model),
            axes: axes.map(|axis| axis.direction()).collect(),
            points: model.samples().iter().map(|s| s.point).collect(),
            symmetries: model.symmetries().motions(),
        }
    }

    /// Returns whether two poses are more than a tenth of the diameter apart, up to symmetry.
    pub(crate) fn differ(&self, a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
        mssd(a, b, &self.points, &self.symmetries) > DIFFERENT_DIAMETERS * self.diameter
    }

    /// Returns the standard deviation of the least determined displacement, meters.
    ///
    /// `covariance` is that of a displacement of the pose. Rotations around declared axes of
    /// symmetry do not count.
    pub(crate) fn deviation(&self, pose: &Isometry3<f64>, covariance: &Matrix6<f64>) -> f64 {
        let scale = self.scale(pose);
        let covariance = scale * covariance * scale.transpose();
        eigen6(&covariance).map_or(0.0, |eigen| eigen.eigenvalues.max().max(0.0).sqrt())
    }

    /// Returns the distance between two poses in the same sense, meters.
    pub(crate) fn distance(&self, a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
        (self.scale(b) * difference(a, b, &self.center)).norm()
    }

    /// Returns the map from a displacement of a pose (meters, radians) to one of the surface.
    pub(crate) fn displacement(&self, pose: &Isometry3<f64>) -> Matrix6<f64> {
        let rotation = pose.rotation.to_rotation_matrix().into_inner();
        let mut scale = Matrix6::identity();
        let levers = rotation * self.levers * rotation.transpose();
        scale.fixed_view_mut::<3, 3>(3, 3).copy_from(&levers);
        scale
    }

    /// Returns the same map without rotations around declared axes of symmetry.
    pub(crate) fn scale(&self, pose: &Isometry3<f64>) -> Matrix6<f64> {
        let mut scale = self.displacement(pose);
        for axis in &self.axes {
            let direction = (pose.rotation * axis).into_inner();
            let mut block = scale.fixed_view_mut::<3, 3>(3, 3);
            let free = &block * direction * direction.transpose();
            block -= free;
        }
        scale
    }
}

/// Moves the object's center by a displacement, and rotates the object around it.
pub(crate) fn moved(
    pose: &Isometry3<f64>,
    center: &Point3<f64>,
    step: &Vector6<f64>,
) -> Isometry3<f64> {
    let at = pose * center + step.fixed_rows::<3>(0);
    let mut rotation = so3::exp(&step.fixed_rows::<3>(3).into_owned()) * pose.rotation;
    rotation.renormalize();
    let shift = at - rotation * center;
    Isometry3::from_parts(Translation3::from(shift), rotation)
}

/// Returns the displacement from pose `b` to pose `a` around an object's center.
pub(crate) fn difference(
    a: &Isometry3<f64>,
    b: &Isometry3<f64>,
    center: &Point3<f64>,
) -> Vector6<f64> {
    let turn = so3::log(&(a.rotation * b.rotation.inverse()));
    join(&(a * center - b * center), &turn)
}

/// Returns the squares of three translations and three rotations.
pub(crate) fn squares([translation, rotation]: [f64; 2]) -> Vector6<f64> {
    join(
        &Vector3::repeat(translation * translation),
        &Vector3::repeat(rotation * rotation),
    )
}

/// Returns the map from a rotation vector to the largest displacement of the surface.
///
/// It is exact for rotations around the principal axes. Around the long axis of a knife, a rotation
/// moves the surface little.
fn levers(model: &Model) -> Matrix3<f64> {
    let center = model.center();
    let samples = model.samples().iter();
    let points: Vec<_> = samples.map(|s| s.point.cast::<f64>() - center).collect();
    let covariance: Matrix3<f64> = points.iter().map(|p| p * p.transpose()).sum();
    let axes = eigen3(&covariance).map_or_else(Matrix3::identity, |eigen| eigen.eigenvectors);
    let lever = |axis: usize| {
        let distances = points.iter().map(|p| axes.column(axis).cross(p).norm());
        distances.fold(0.0, f64::max)
    };
    let levers = Vector3::new(lever(0), lever(1), lever(2));
    axes * Matrix3::from_diagonal(&levers) * axes.transpose()
}

#[cfg(test)]
mod tests {
    use hicp_core::UnitQuaternion;
    use hicp_sim::Household;

    use super::*;

    #[test]
    fn distances_are_displacements_of_the_surface_around_each_principal_axis() {
        let extent = Extent::new(&Household::Knife.model().unwrap());
        let eigen = extent.levers.symmetric_eigen();
        for axis in eigen.eigenvectors.column_iter() {
            let center = Translation3::from(extent.center.coords);
            let turned = center * UnitQuaternion::new(axis * 0.05) * center.inverse();
            let distance = extent.distance(&turned, &Isometry3::identity());
            let largest = mssd(&turned, &Isometry3::identity(), &extent.points, &[]);
            assert!(
                (distance / largest - 1.0).abs() < 0.01,
                "{distance} {largest}"
            );
        }
        // A rotation around the long axis of a knife moves its surface little.
        assert!(eigen.eigenvalues.min() < 0.2 * eigen.eigenvalues.max());
    }
}

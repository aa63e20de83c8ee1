//! Poses and perturbations (§VI-A.3 to §VI-A.5).

use hicp_core::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_distr::{Distribution, UnitSphere};

use crate::SimRng;

/// Rotation error per translation error of a sampling-based pose estimator, degrees per millimeter
/// (§VI-A.5).
pub const DEGREES_PER_MILLIMETER: f64 = 1.92;

/// Mean translation error of that estimator, meters (§VI-A.5).
pub const MEAN_TRANSLATION_ERROR_METERS: f64 = 0.0062;

/// Mean rotation error of that estimator, degrees (§VI-A.5).
pub const MEAN_ROTATION_ERROR_DEGREES: f64 = 9.5;

/// Returns a uniformly distributed unit vector.
pub fn unit_vector(rng: &mut SimRng) -> Vector3<f64> {
    let direction: [f64; 3] = UnitSphere.sample(rng);
    Vector3::from(direction)
}

/// Returns a uniformly distributed rotation (Shoemake 1992).
pub fn rotation(rng: &mut SimRng) -> UnitQuaternion<f64> {
    let (u, a, b): (f64, f64, f64) = (rng.random(), rng.random(), rng.random());
    let ((sa, ca), (sb, cb)) = (
        (std::f64::consts::TAU * a).sin_cos(),
        (std::f64::consts::TAU * b).sin_cos(),
    );
    let (p, q) = ((1.0 - u).sqrt(), u.sqrt());
    UnitQuaternion::new_normalize(hicp_core::Quaternion::new(q * cb, p * sa, p * ca, q * sb))
}

/// Draws an object pose (`camera_from_object`), in meters, in any orientation (§VI-A.3).
///
/// The distance of the object's center along the optical axis is uniform in `distances`, meters.
/// The optical axis passes within `offset` meters of the center. `center` is in the object frame,
/// meters.
pub fn object_pose(
    rng: &mut SimRng,
    center: &Point3<f64>,
    distances: std::ops::Range<f64>,
    offset: f64,
) -> Isometry3<f64> {
    let rotation = rotation(rng);
    let distance = distances.start + (distances.end - distances.start) * rng.random::<f64>();
    let angle = std::f64::consts::TAU * rng.random::<f64>();
    let radius = offset * rng.random::<f64>().sqrt();
    let aside = Vector3::new(radius * angle.cos(), radius * angle.sin(), 0.0);
    // Open: distance between object and camera: §VI-A.3. It is that of the object's center along
    // the optical axis.
    let seen_at = Vector3::new(0.0, 0.0, distance) + aside;
    Isometry3::from_parts(
        Translation3::from(seen_at - rotation * center.coords),
        rotation,
    )
}

/// Returns a pose with errors of the mean size, [`MEAN_TRANSLATION_ERROR_METERS`] and
/// [`MEAN_ROTATION_ERROR_DEGREES`]; see [`perturb`].
pub fn perturb_by_mean(rng: &mut SimRng, camera_from_object: &Isometry3<f64>) -> Isometry3<f64> {
    let angle = MEAN_ROTATION_ERROR_DEGREES.to_radians();
    perturb(
        rng,
        camera_from_object,
        MEAN_TRANSLATION_ERROR_METERS,
        angle,
    )
}

/// Returns the perturbed pose [R_CO R_δ | t_CO + t_δ] with errors of a given size (§VI-A.4).
///
/// |t_δ| is `translation` meters, and R_δ is a rotation by `angle` radians. Both have uniformly
/// random directions.
pub fn perturb(
    rng: &mut SimRng,
    camera_from_object: &Isometry3<f64>,
    translation: f64,
    angle: f64,
) -> Isometry3<f64> {
    let shift = unit_vector(rng) * translation;
    let turn = UnitQuaternion::new(unit_vector(rng) * angle);
    Isometry3::from_parts(
        Translation3::from(camera_from_object.translation.vector + shift),
        camera_from_object.rotation * turn,
    )
}

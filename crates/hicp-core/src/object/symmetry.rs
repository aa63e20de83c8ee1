//! Symmetries of an object: the motions that do not change its appearance.

use thiserror::Error;

use nalgebra::{Isometry3, Point3, UnitQuaternion, UnitVector3, Vector3};

/// Number of rotations into which BOP divides a continuous symmetry: ⌈π/0.01⌉.
const CONTINUOUS_STEPS: usize = 315;

/// The largest number of motions that symmetries from a file may expand to.
///
/// A thousand times the number for any object.
pub const MAX_SYMMETRY_MOTIONS: usize = 1_000_000;

/// A continuous rotational symmetry: all rotations around an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "Unchecked"))]
pub struct SymmetryAxis {
    direction: UnitVector3<f64>,
    offset: Point3<f64>,
}

/// The fields of a serialized axis, before they are checked.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Unchecked {
    direction: Vector3<f64>,
    offset: Point3<f64>,
}

#[cfg(feature = "serde")]
impl TryFrom<Unchecked> for SymmetryAxis {
    type Error = SymmetryError;

    fn try_from(axis: Unchecked) -> Result<Self, SymmetryError> {
        Self::new(axis.direction, axis.offset)
    }
}

impl SymmetryAxis {
    /// Creates the symmetry around the axis through `offset` along `direction`.
    ///
    /// Both are in the object frame. `offset` is in meters. `direction` need not have unit length.
    ///
    /// # Errors
    ///
    /// [`SymmetryError`] if the direction is zero or a value is not finite.
    pub fn new(direction: Vector3<f64>, offset: Point3<f64>) -> Result<Self, SymmetryError> {
        if !offset.iter().all(|x| x.is_finite()) {
            let (x, y, z) = (offset.x, offset.y, offset.z);
            return Err(SymmetryError::Offset { x, y, z });
        }
        // Scale to unit size first: squares of very long and very short directions overflow and
        // vanish.
        let size = direction.amax();
        if !(size > 0.0 && direction.iter().all(|x| x.is_finite())) {
            let (x, y, z) = (direction.x, direction.y, direction.z);
            return Err(SymmetryError::Axis { x, y, z });
        }
        Ok(Self {
            direction: UnitVector3::new_normalize(direction / size),
            offset,
        })
    }

    /// Direction of the axis, object frame.
    #[must_use]
    pub fn direction(&self) -> UnitVector3<f64> {
        self.direction
    }

    /// A point on the axis, meters, object frame.
    #[must_use]
    pub fn offset(&self) -> Point3<f64> {
        self.offset
    }

    /// Returns the rotation by `angle` radians around the axis, as a motion in the object frame.
    #[must_use]
    pub fn rotation(&self, angle: f64) -> Isometry3<f64> {
        let rotation = UnitQuaternion::from_axis_angle(&self.direction, angle);
        Isometry3::rotation_wrt_point(rotation, self.offset)
    }
}

/// The declared symmetries of an object, in meters in the object frame.
///
/// By default there are none. A motion S is a symmetry if the object looks the same at
/// `camera_from_object` and at `camera_from_object * S`.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Symmetries {
    /// Discrete symmetries, without the identity.
    pub discrete: Vec<Isometry3<f64>>,
    /// Continuous symmetries.
    pub continuous: Vec<SymmetryAxis>,
}

impl Symmetries {
    /// Returns whether no symmetry is declared.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.discrete.is_empty() && self.continuous.is_empty()
    }

    /// Returns the number of motions that [`Symmetries::motions`] returns, without computing them.
    #[must_use]
    pub fn n_motions(&self) -> usize {
        let continuous = self.continuous.len().saturating_mul(CONTINUOUS_STEPS);
        continuous.max(1).saturating_mul(self.discrete.len() + 1)
    }

    /// Returns the pose that is equivalent to `pose` and nearest to `reference`.
    ///
    /// It has the smallest angle to `reference`, and of several the smallest distance. Rotations
    /// around an axis are not limited to the steps of [`Symmetries::motions`]. Cost:
    /// O([`Symmetries::n_motions`]).
    ///
    /// ```
    /// use hicp_core::{Isometry3, Point3, Symmetries, SymmetryAxis, Vector3};
    /// let mut symmetries = Symmetries::default();
    /// symmetries.continuous.push(SymmetryAxis::new(Vector3::z(), Point3::origin()).unwrap());
    /// let turned = Isometry3::rotation(Vector3::z() * 1.234);
    /// let nearest = symmetries.nearest_equivalent(&turned, &Isometry3::identity());
    /// assert!(nearest.rotation.angle() < 1e-6);
    /// ```
    ///
    /// # Panics
    ///
    /// As [`Symmetries::motions`].
    #[must_use]
    pub fn nearest_equivalent(
        &self,
        pose: &Isometry3<f64>,
        reference: &Isometry3<f64>,
    ) -> Isometry3<f64> {
        let between = |pose: &Isometry3<f64>| {
            let angle = pose.rotation.angle_to(&reference.rotation);
            let distance = (pose.translation.vector - reference.translation.vector).norm();
            (angle, distance)
        };
        let mut best = *pose;
        for motion in self.motions() {
            let mut other = pose * motion;
            for axis in &self.continuous {
                let turn = reference.rotation.inverse() * other.rotation;
                let twist = turn.imag().dot(&axis.direction());
                other *= axis.rotation(-2.0 * twist.atan2(turn.w));
            }
            let ((angle, distance), (least, nearest)) = (between(&other), between(&best));
            // Angles of equal rotations differ by rounding.
            if angle < least - 1e-6 || (angle < least + 1e-6 && distance < nearest) {
                best = other;
            }
        }
        best
    }

    /// Returns the symmetry motions as BOP expands them, the identity first.
    ///
    /// Every continuous symmetry becomes 315 rotations, each composed with every discrete symmetry
    /// (continuous ∘ discrete). Readers refuse symmetries of more than [`MAX_SYMMETRY_MOTIONS`].
    ///
    /// # Panics
    ///
    /// If memory cannot hold [`Symmetries::n_motions`] motions.
    #[must_use]
    pub fn motions(&self) -> Vec<Isometry3<f64>> {
        let mut discrete = vec![Isometry3::identity()];
        discrete.extend(self.discrete.iter().copied());
        if self.continuous.is_empty() {
            return discrete;
        }
        let mut motions = Vec::with_capacity(self.n_motions());
        for axis in &self.continuous {
            for step in 0..CONTINUOUS_STEPS {
                let rotation =
                    axis.rotation(std::f64::consts::TAU * step as f64 / CONTINUOUS_STEPS as f64);
                motions.extend(discrete.iter().map(|motion| rotation * motion));
            }
        }
        motions
    }
}

/// The reason why values do not describe a symmetry.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum SymmetryError {
    /// The direction of an axis is zero or not finite.
    #[error("symmetry axis ({x}, {y}, {z}) has no direction, expected a finite non-zero vector")]
    Axis {
        /// x.
        x: f64,
        /// y.
        y: f64,
        /// z.
        z: f64,
    },
    /// A point on the axis is not finite.
    #[error("symmetry offset ({x}, {y}, {z}) is not finite, expected finite coordinates in meters")]
    Offset {
        /// x.
        x: f64,
        /// y.
        y: f64,
        /// z.
        z: f64,
    },
}

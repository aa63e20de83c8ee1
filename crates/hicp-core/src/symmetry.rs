//! Symmetries of an object: the motions that leave it looking the same.

use thiserror::Error;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, UnitVector3, Vector3};

/// Rotations into which BOP divides a continuous symmetry: ⌈π/0.01⌉.
pub const CONTINUOUS_STEPS: usize = 315;

/// The largest number of motions that symmetries read from outside may stand for: a thousand times what any object has.
pub const MAX_SYMMETRY_MOTIONS: usize = 1_000_000;

/// A continuous rotational symmetry: any rotation about a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SymmetryAxis {
    direction: UnitVector3<f64>,
    offset: Point3<f64>,
}

impl SymmetryAxis {
    /// Makes the symmetry of the line through `offset` (metres, object frame) along `direction`, which need not be of unit length.
    ///
    /// # Errors
    ///
    /// [`SymmetryError`] when the direction is zero or anything is not finite.
    pub fn new(direction: Vector3<f64>, offset: Point3<f64>) -> Result<Self, SymmetryError> {
        if !offset.iter().all(|x| x.is_finite()) {
            let (x, y, z) = (offset.x, offset.y, offset.z);
            return Err(SymmetryError::Offset { x, y, z });
        }
        // Brought to unit size first: squares of very long and very short directions overflow and vanish.
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

    /// A point of the axis, metres, object frame.
    #[must_use]
    pub fn offset(&self) -> Point3<f64> {
        self.offset
    }

    /// Returns the rotation by `angle` radians about the axis, as a motion of the object frame.
    #[must_use]
    pub fn rotation(&self, angle: f64) -> Isometry3<f64> {
        let rotation = UnitQuaternion::from_axis_angle(&self.direction, angle);
        let offset = self.offset.coords;
        Isometry3::from_parts(Translation3::from(offset - rotation * offset), rotation)
    }
}

/// The declared symmetries of an object, in its frame, metres.
///
/// The default has none. A motion S is a symmetry when the object looks the same at `camera_from_object` and at
/// `camera_from_object * S`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Symmetries {
    /// Discrete symmetries, the identity not counted.
    pub discrete: Vec<Isometry3<f64>>,
    /// Continuous symmetries.
    pub continuous: Vec<SymmetryAxis>,
}

impl Symmetries {
    /// Returns whether nothing is declared.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.discrete.is_empty() && self.continuous.is_empty()
    }

    /// Returns how many motions [`Symmetries::motions`] returns, without making them.
    #[must_use]
    pub fn n_motions(&self) -> usize {
        let continuous = self.continuous.len().saturating_mul(CONTINUOUS_STEPS);
        continuous.max(1).saturating_mul(self.discrete.len() + 1)
    }

    /// Returns the symmetry motions as BOP expands them, the identity first.
    ///
    /// Every continuous symmetry is divided into [`CONTINUOUS_STEPS`] rotations, each composed with every discrete one (continuous ∘ discrete).
    /// Readers refuse symmetries of more than [`MAX_SYMMETRY_MOTIONS`].
    ///
    /// # Panics
    ///
    /// When [`Symmetries::n_motions`] are more than memory can hold.
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

/// Symmetries that are not rigid motions.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum SymmetryError {
    /// An axis without direction.
    #[error("symmetry axis ({x}, {y}, {z}) has no direction, expected a finite non-zero vector")]
    Axis {
        /// x.
        x: f64,
        /// y.
        y: f64,
        /// z.
        z: f64,
    },
    /// A point on the axis that is not finite.
    #[error("symmetry offset ({x}, {y}, {z}) is not finite")]
    Offset {
        /// x.
        x: f64,
        /// y.
        y: f64,
        /// z.
        z: f64,
    },
}

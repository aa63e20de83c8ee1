//! Symmetries of an object: the motions that do not change its appearance.

use thiserror::Error;

use nalgebra::{Isometry3, Point3, UnitQuaternion, UnitVector3, Vector3};

use crate::pose::{se3, so3};

/// Number of rotations into which BOP divides a continuous symmetry: ⌈π/0.01⌉.
const CONTINUOUS_STEPS: usize = 315;

/// The largest number of motions that symmetries from a file may expand to.
///
/// A thousand times the number for any object.
pub const MAX_SYMMETRY_MOTIONS: usize = 1_000_000;

/// Relative rounding of a length.
const ROUNDING: f64 = 1e-13;

/// Squared sine of an angle below which two axes count as one that is declared twice.
///
/// It is about ten degrees, since the axes of a sphere are far apart.
const PARALLEL: f64 = 0.03;

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
    /// The distance is √(|φ|²r² + |Δc|²), where φ is the rotation between the poses, c the object's
    /// `center` (object frame) and r its `radius` (meters). Continuous symmetries are solved in
    /// closed form for φ, together with every discrete one, since the center of such an object lies
    /// on the axis. Two axes make a sphere, for which every rotation around their intersection is a
    /// symmetry. If `pose` itself is the nearest, it is returned bit for bit.
    ///
    /// Cost: well below a microsecond per discrete symmetry and axis.
    ///
    /// ```
    /// use hicp_core::{Isometry3, Point3, Symmetries, SymmetryAxis, Vector3};
    /// let mut symmetries = Symmetries::default();
    /// symmetries.continuous.push(SymmetryAxis::new(Vector3::z(), Point3::origin()).unwrap());
    /// let (turned, reference) = (Isometry3::rotation(Vector3::z() * 1.234), Isometry3::identity());
    /// let nearest = symmetries.nearest_equivalent(&turned, &reference, &Point3::origin(), 0.1);
    /// assert!(nearest.rotation.angle() < 1e-9);
    /// ```
    #[must_use]
    pub fn nearest_equivalent(
        &self,
        pose: &Isometry3<f64>,
        reference: &Isometry3<f64>,
        center: &Point3<f64>,
        radius: f64,
    ) -> Isometry3<f64> {
        let distance = |pose: &Isometry3<f64>| {
            let (angle, _) = se3::pose_distance(pose, reference);
            let apart = pose * center - reference * center;
            (angle * radius).hypot(apart.norm())
        };
        let mut best = (*pose, distance(pose));
        let places = pose.translation.vector.norm() + reference.translation.vector.norm();
        let rounding = ROUNDING * (radius + places);
        let mut consider = |candidate: Isometry3<f64>| {
            let distance = distance(&candidate);
            // The gain must exceed the rounding of the lengths, so that a pose that is already
            // nearest does not change.
            if distance < best.1 - rounding {
                best = (candidate, distance);
            }
        };
        let identity = Isometry3::identity();
        for discrete in std::iter::once(&identity).chain(&self.discrete) {
            let candidate = se3::compose(pose, discrete);
            consider(candidate);
            for axis in &self.continuous {
                consider(turned(&candidate, reference, axis));
            }
        }
        if let Some(point) = center_of_all_turns(&self.continuous) {
            let rotation = reference.rotation;
            let place = pose * point - rotation * point;
            consider(Isometry3::from_parts(place.into(), rotation));
        }
        best.0
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

/// Returns the intersection of two axes of a sphere, or `None` if all axes are one.
///
/// Declared axes are rounded, so it is the point nearest to both.
fn center_of_all_turns(axes: &[SymmetryAxis]) -> Option<Point3<f64>> {
    let (first, others) = axes.split_first()?;
    others.iter().find_map(|second| {
        let [a, b] = [first, second].map(|axis| axis.direction().into_inner());
        let (normal, between) = (a.cross(&b), second.offset() - first.offset());
        let square = normal.norm_squared();
        (square > PARALLEL).then(|| {
            let along_first = between.cross(&b).dot(&normal) / square;
            let along_second = between.cross(&a).dot(&normal) / square;
            nalgebra::center(
                &(first.offset() + a * along_first),
                &(second.offset() + b * along_second),
            )
        })
    })
}

/// Rotates the object around an axis such that its rotation is nearest to the reference's.
///
/// tr(C_refᵀ C R(θ)) = const + p cos θ + q sin θ, with p = tr M − aᵀMa and q = tr(M a^) for M =
/// C_refᵀ C. It is largest at θ = atan2(q, p).
fn turned(
    pose: &Isometry3<f64>,
    reference: &Isometry3<f64>,
    axis: &SymmetryAxis,
) -> Isometry3<f64> {
    let m = (reference.rotation.inverse() * pose.rotation)
        .to_rotation_matrix()
        .into_inner();
    let direction = axis.direction().into_inner();
    let cosine = m.trace() - direction.dot(&(m * direction));
    let sine = (m * so3::hat(&direction)).trace();
    if cosine.hypot(sine) < 1e-12 {
        // The axes are opposite: all angles have the same distance.
        return *pose;
    }
    se3::compose(pose, &axis.rotation(sine.atan2(cosine)))
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

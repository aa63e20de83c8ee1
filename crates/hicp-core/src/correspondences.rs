//! Pairs of model and observed surface elements.

use nalgebra::{Isometry3, Matrix3, Point3, UnitVector3, Vector3};

use crate::surfel::Surfel;

/// One correspondence (cᵢ, nᵢ, oᵢ, mᵢ) of Algorithm 1, all of it in the camera frame at the current estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// The model point, moved by the current estimate: T_CO oᵢ, and its normal R_CO mᵢ.
    pub source: Surfel,
    /// The observed point cᵢ and its normal nᵢ.
    pub target: Surfel,
    /// Weight, not negative.
    pub weight: f32,
    /// Which source element this is: its index in the selection; for an association that starts from the observation, its index
    /// among the model's elements. Equal indices mean the same element.
    pub source_index: u32,
    /// Which target element this is: its row-major index in the observation's region, see [`crate::Observation::surfel`].
    pub target_index: u32,
}

impl Pair {
    /// Makes a pair of weight 1.
    #[must_use]
    pub fn new(source_index: u32, source: Surfel, target_index: u32, target: Surfel) -> Self {
        Self {
            source,
            target,
            weight: 1.0,
            source_index,
            target_index,
        }
    }

    /// Returns the distance between the two points, metres.
    #[must_use]
    pub fn distance(&self) -> f32 {
        (self.source.point - self.target.point).norm()
    }
}

/// The pairs of one turn, the pose they were made at, and how many were tried. A buffer that is begun anew and refilled; the
/// caller owns it.
#[derive(Clone, Debug, PartialEq)]
pub struct Correspondences {
    pairs: Vec<Pair>,
    camera_from_object: Isometry3<f64>,
    n_candidates: usize,
}

impl Default for Correspondences {
    fn default() -> Self {
        Self {
            pairs: Vec::new(),
            camera_from_object: Isometry3::identity(),
            n_candidates: 0,
        }
    }
}

impl Correspondences {
    /// Makes an empty list.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Removes all pairs, keeps the memory, and notes the pose at which the next ones are made and how many points ask for one.
    pub fn begin(&mut self, camera_from_object: &Isometry3<f64>, n_candidates: usize) {
        self.pairs.clear();
        self.camera_from_object = *camera_from_object;
        self.n_candidates = n_candidates;
    }

    /// The pose at which the pairs were made: their sources are moved by it.
    #[must_use]
    pub fn camera_from_object(&self) -> &Isometry3<f64> {
        &self.camera_from_object
    }

    /// How many points asked for a pair; the matched share of them is the fitness.
    #[must_use]
    pub fn n_candidates(&self) -> usize {
        self.n_candidates
    }

    /// Says how many points asked for a pair, for an association that does not start from the selected ones.
    pub fn set_candidates(&mut self, n_candidates: usize) {
        self.n_candidates = n_candidates;
    }

    /// Makes room for `additional` more pairs.
    ///
    /// # Panics
    ///
    /// When they are more than memory can hold.
    pub fn reserve(&mut self, additional: usize) {
        self.pairs.reserve(additional);
    }

    /// Adds a pair.
    pub fn push(&mut self, pair: Pair) {
        self.pairs.push(pair);
    }

    /// Number of pairs.
    #[must_use]
    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Returns whether there is no pair.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }

    /// The pairs, in the order in which they were added.
    #[must_use]
    pub fn as_slice(&self) -> &[Pair] {
        &self.pairs
    }

    /// The pairs, to be re-weighted.
    pub fn as_mut_slice(&mut self) -> &mut [Pair] {
        &mut self.pairs
    }

    /// Keeps the pairs for which `keep` is true, in order.
    pub fn retain(&mut self, keep: impl FnMut(&Pair) -> bool) {
        self.pairs.retain(keep);
    }
}

impl Extend<Pair> for Correspondences {
    fn extend<I: IntoIterator<Item = Pair>>(&mut self, pairs: I) {
        self.pairs.extend(pairs);
    }
}

impl FromIterator<Pair> for Correspondences {
    fn from_iter<I: IntoIterator<Item = Pair>>(pairs: I) -> Self {
        let pairs: Vec<Pair> = pairs.into_iter().collect();
        Self {
            n_candidates: pairs.len(),
            pairs,
            ..Self::default()
        }
    }
}

/// A rigid motion in `f32`, for moving many surfels.
#[derive(Clone, Copy, Debug)]
pub struct RigidTransform {
    rotation: Matrix3<f32>,
    translation: Vector3<f32>,
}

impl RigidTransform {
    /// Prepares a pose.
    #[must_use]
    pub fn new(pose: &Isometry3<f64>) -> Self {
        Self {
            rotation: pose
                .rotation
                .to_rotation_matrix()
                .into_inner()
                .cast::<f32>(),
            translation: pose.translation.vector.cast::<f32>(),
        }
    }

    /// Returns the moved point.
    #[must_use]
    #[inline]
    pub fn point(&self, point: &Point3<f32>) -> Point3<f32> {
        Point3::from(self.rotation * point.coords + self.translation)
    }

    /// Returns many moved points, given and returned as `[x, y, z]` of each; the bits of [`RigidTransform::point`].
    #[must_use]
    #[inline(always)]
    pub fn points<const N: usize>(&self, points: &[[f32; N]; 3]) -> [[f32; N]; 3] {
        let mut moved = self.vectors(points);
        for (moved, offset) in moved.iter_mut().zip(self.translation.iter()) {
            for value in moved {
                *value += offset;
            }
        }
        moved
    }

    /// Returns many turned vectors, given and returned as `[x, y, z]` of each.
    #[must_use]
    #[inline(always)]
    pub fn vectors<const N: usize>(&self, vectors: &[[f32; N]; 3]) -> [[f32; N]; 3] {
        let [x, y, z] = vectors;
        let mut turned = [[0.0; N]; 3];
        for (axis, turned) in turned.iter_mut().enumerate() {
            let (a, b, c) = (
                self.rotation[(axis, 0)],
                self.rotation[(axis, 1)],
                self.rotation[(axis, 2)],
            );
            for ((turned, x), (y, z)) in turned.iter_mut().zip(x).zip(y.iter().zip(z)) {
                *turned = a * x + b * y + c * z;
            }
        }
        turned
    }

    /// Returns the moved surfel.
    #[must_use]
    #[inline]
    pub fn surfel(&self, surfel: &Surfel) -> Surfel {
        Surfel {
            point: self.point(&surfel.point),
            normal: UnitVector3::new_unchecked(self.rotation * surfel.normal.as_ref()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_move_as_one_does() {
        let mover = RigidTransform::new(&Isometry3::new(
            Vector3::new(0.1, -0.2, 0.7),
            Vector3::new(1.3, -0.4, 0.9),
        ));
        let numbers: [[f32; 7]; 3] = std::array::from_fn(|axis| {
            std::array::from_fn(|i| (1.7 * i as f32 + axis as f32).sin())
        });
        let points = mover.points(&numbers);
        let vectors = mover.vectors(&numbers);
        for i in 0..7 {
            let point = Point3::new(numbers[0][i], numbers[1][i], numbers[2][i]);
            let moved = mover.surfel(&Surfel {
                point,
                normal: UnitVector3::new_unchecked(point.coords),
            });
            for axis in 0..3 {
                assert_eq!(points[axis][i], moved.point[axis]);
                assert_eq!(vectors[axis][i], moved.normal[axis]);
            }
        }
    }
}

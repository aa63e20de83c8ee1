//! Pairs of model and observed surface elements.

use nalgebra::{Isometry3, Matrix3, Point3, UnitVector3, Vector3};

use crate::surfel::Surfel;

/// One correspondence (cᵢ, nᵢ, oᵢ, mᵢ) of Algorithm 1, in the camera frame, meters.
///
/// Between two clouds, the camera frame is the frame of the target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// The model point T_CO oᵢ, moved by the current estimate, and its normal R_CO mᵢ.
    pub source: Surfel,
    /// The observed point cᵢ and its normal nᵢ.
    pub target: Surfel,
    /// Weight, not negative.
    pub weight: f32,
    /// The index of the source element.
    ///
    /// It is an index into the selected points. An association that does not start from them has
    /// its own numbering: of samples, of triangles, or of the pixels of the rendered region. To
    /// look up data of the model or cloud point, search by position with
    /// `hicp_association::PointSearch`.
    pub source_index: u32,
    /// The index of the observed surfel; [`Pair::UNLISTED`] if the target is another point.
    ///
    /// For an observation, it is that of [`Observation::surfel`](crate::Observation::surfel). For a
    /// cloud, it is the position in [`Cloud::surfels`](crate::Cloud::surfels).
    pub target_index: u32,
}

impl Pair {
    /// The `target_index` of a target that is not a surfel of the observation, such as a point
    /// outside of the mask.
    pub const UNLISTED: u32 = u32::MAX;

    /// Creates a pair of weight 1.
    #[must_use]
    #[inline]
    pub fn new(source_index: u32, source: Surfel, target_index: u32, target: Surfel) -> Self {
        Self {
            source,
            target,
            weight: 1.0,
            source_index,
            target_index,
        }
    }

    /// Returns the distance between the two points, meters.
    #[must_use]
    pub fn distance(&self) -> f32 {
        (self.source.point - self.target.point).norm()
    }
}

/// The pairs of one iteration, the pose they were computed at, and the number of candidates.
///
/// The caller owns this buffer and reuses it: every iteration clears it and keeps the memory.
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
    /// Creates an empty list at the identity pose.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Starts an iteration: removes all pairs, keeps the memory, and stores pose and candidate
    /// count.
    ///
    /// `n_candidates` is the number of points that the association tries to pair.
    pub fn begin(&mut self, camera_from_object: &Isometry3<f64>, n_candidates: usize) {
        self.pairs.clear();
        self.camera_from_object = *camera_from_object;
        self.n_candidates = n_candidates;
    }

    /// The pose at which the pairs were computed; it has been applied to their sources.
    #[must_use]
    pub fn camera_from_object(&self) -> &Isometry3<f64> {
        &self.camera_from_object
    }

    /// Number of points that the association tried to pair. The matched share of them is the
    /// fitness.
    #[must_use]
    pub fn n_candidates(&self) -> usize {
        self.n_candidates
    }

    /// Sets the number of candidates, for an association that does not start from the selected
    /// points.
    pub fn set_candidates(&mut self, n_candidates: usize) {
        self.n_candidates = n_candidates;
    }

    /// Reserves memory for `additional` more pairs.
    ///
    /// # Panics
    ///
    /// If memory cannot hold them.
    pub fn reserve(&mut self, additional: usize) {
        self.pairs.reserve(additional);
    }

    /// Adds a pair.
    #[inline]
    pub fn push(&mut self, pair: Pair) {
        self.pairs.push(pair);
    }

    /// Number of pairs.
    #[must_use]
    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Returns whether there are no pairs.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }

    /// Iterates over the pairs, in the order in which they were added.
    pub fn iter(&self) -> std::slice::Iter<'_, Pair> {
        self.pairs.iter()
    }

    /// The pairs, in the order in which they were added.
    #[must_use]
    pub fn as_slice(&self) -> &[Pair] {
        &self.pairs
    }

    /// The pairs, for changing their weights.
    pub fn as_mut_slice(&mut self) -> &mut [Pair] {
        &mut self.pairs
    }

    /// Keeps the pairs for which `keep` is true, in order.
    pub fn retain(&mut self, keep: impl FnMut(&Pair) -> bool) {
        self.pairs.retain(keep);
    }
}

impl<'a> IntoIterator for &'a Correspondences {
    type Item = &'a Pair;
    type IntoIter = std::slice::Iter<'a, Pair>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
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
///
/// Like a pose `b_from_a`, it maps coordinates in frame `a` to frame `b`.
#[derive(Clone, Copy, Debug)]
pub struct RigidTransform {
    rotation: Matrix3<f32>,
    translation: Vector3<f32>,
}

impl RigidTransform {
    /// Converts a pose to `f32`.
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

    /// Returns the moved point, in the unit of its input.
    #[must_use]
    #[inline]
    pub fn point(&self, point: &Point3<f32>) -> Point3<f32> {
        Point3::from(self.rotation * point.coords + self.translation)
    }

    /// Returns many moved points, given and returned as one array per coordinate.
    ///
    /// The bits are those of [`RigidTransform::point`].
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

    /// Returns many rotated vectors, given and returned as one array per coordinate.
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

    /// Returns the moved surfel: its point moved, its normal rotated.
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
    fn many_points_move_as_one_point_does() {
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

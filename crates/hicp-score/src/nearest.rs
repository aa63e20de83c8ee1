//! Exact distances to the nearest of many points.

use hicp_core::{Isometry3, Point3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// A k-d tree over points, in `f64` so that nothing is lost against a search by definition.
#[derive(Debug)]
pub(crate) struct NearestPoints {
    /// `None` without points: the tree would answer with item 0 at an infinite distance.
    tree: Option<ImmutableKdTree<f64, 3>>,
}

impl NearestPoints {
    /// Builds the tree, O(n log n). Points that are not finite are near nothing.
    pub(crate) fn new(points: &[Point3<f32>]) -> Self {
        let finite = |p: &&Point3<f32>| p.iter().all(|x| x.is_finite());
        let points: Vec<[f64; 3]> = points
            .iter()
            .filter(finite)
            .map(|p| p.cast::<f64>().into())
            .collect();
        let tree = if points.is_empty() {
            None
        } else {
            ImmutableKdTree::new_from_slice(&points).ok()
        };
        Self { tree }
    }

    /// Returns the distance to the nearest point; infinite without points and from a place that is not finite.
    fn distance(&self, from: &Point3<f64>) -> f64 {
        let Some(tree) = self.tree.as_ref() else {
            return f64::INFINITY;
        };
        if !from.iter().all(|x| x.is_finite()) {
            return f64::INFINITY;
        }
        let from: [f64; 3] = (*from).into();
        tree.query(&from)
            .nearest_one::<SquaredEuclidean<f64>>()
            .execute()
            .distance
            .sqrt()
    }

    /// Returns ADI of `points`, which must be those of the tree; 0 without points.
    pub(crate) fn adi(
        &self,
        estimate: &Isometry3<f64>,
        truth: &Isometry3<f64>,
        points: &[Point3<f32>],
    ) -> f64 {
        if points.is_empty() {
            return 0.0;
        }
        // The points at the true pose, seen from the frame of the estimate: the tree stays where it is. The translations
        // are subtracted first, so that nothing is lost far from the camera.
        let back = estimate.rotation.inverse();
        let shift = back * (truth.translation.vector - estimate.translation.vector);
        let rotation = (back * truth.rotation).to_rotation_matrix();
        let sum: f64 = points
            .iter()
            .map(|x| self.distance(&Point3::from(rotation * x.coords.cast::<f64>() + shift)))
            .sum();
        sum / points.len() as f64
    }
}

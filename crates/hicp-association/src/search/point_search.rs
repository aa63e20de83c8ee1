//! Nearest-point queries for custom components.

use hicp_core::Point3;

use crate::search::box_tree::Stack;
use crate::search::nearest::Nearest;
use crate::search::point_tree::PointTree;

/// Finds the nearest of a set of points, exactly: for custom associations, filters and metrics.
///
/// It is the tree of [`NearestNeighbor`](crate::NearestNeighbor). Points that are not finite are
/// never found. Of equally near points, the first is found.
///
/// To share it between threads and runs, store it in the `derived()` cache of a model, cloud or
/// observation. The cache is keyed by type and number. Wrap the search in a private type, so that
/// no other component can use the same key for other points.
///
/// It can also look up data of the model or cloud point of a pair, such as a label or a color. A
/// pair holds the moved point, and its index may refer to a selection. Move the point back to the
/// frame of the source, and search there:
///
/// ```
/// use std::sync::Arc;
/// use hicp_association::{OutlierFilter, PointSearch};
/// use hicp_core::{Correspondences, Iteration, RigidTransform};
///
/// /// The tree over the surfels of the source; a private type, so that no other component has it.
/// struct SourceSurfels(PointSearch);
///
/// /// Keeps the pairs of equal labels, one per surfel of the source and of the target.
/// struct SameLabel {
///     source: Vec<u8>,
///     target: Vec<u8>,
/// }
///
/// impl OutlierFilter for SameLabel {
///     fn filter(&mut self, iteration: &Iteration<'_>, pairs: &mut Correspondences) {
///         let Some(source) = iteration.problem.source() else { return };
///         let search: Arc<SourceSurfels> = source.derived().get_or_build(0, || {
///             let points = source.surfels().iter().map(|surfel| surfel.point);
///             SourceSurfels(PointSearch::new(points))
///         });
///         let object_from_camera = RigidTransform::new(&pairs.camera_from_object().inverse());
///         pairs.retain(|pair| {
///             let surfel = search.0.nearest(&object_from_camera.point(&pair.source.point));
///             let source = surfel.and_then(|surfel| self.source.get(surfel.element as usize));
///             source.is_some() && source == self.target.get(pair.target_index as usize)
///         });
///     }
/// }
/// ```
///
/// Cost: O(n log n) to build, and about O(log n) per query.
#[derive(Clone, Debug)]
pub struct PointSearch {
    tree: PointTree,
    /// The index of each point of the tree among those given.
    elements: Vec<u32>,
}

impl PointSearch {
    /// Builds the index.
    #[must_use]
    pub fn new(points: impl IntoIterator<Item = Point3<f32>>) -> Self {
        let finite = |(_, point): &(u32, Point3<f32>)| point.iter().all(|x| x.is_finite());
        let (elements, points): (Vec<_>, Vec<_>) = (0..).zip(points).filter(finite).unzip();
        let mut tree = PointTree::default();
        tree.rebuild(&points);
        Self { tree, elements }
    }

    /// Returns the point nearest to `query`, or `None` if none is at a finite distance.
    #[must_use]
    pub fn nearest(&self, query: &Point3<f32>) -> Option<Nearest> {
        let found = self.tree.nearest(query, &mut Stack::default())?;
        Some(self.given(found))
    }

    /// Replaces the content of `found` by the `count` points nearest to `query`, nearest first.
    pub fn nearest_n(&self, query: &Point3<f32>, count: usize, found: &mut Vec<Nearest>) {
        (self.tree).nearest_n(query, count, &mut Stack::default(), found);
        for nearest in found {
            *nearest = self.given(*nearest);
        }
    }

    /// Returns a result with the index of its point among those given.
    fn given(&self, found: Nearest) -> Nearest {
        let element = self.elements[found.element as usize];
        Nearest { element, ..found }
    }
}

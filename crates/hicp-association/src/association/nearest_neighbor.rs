//! Nearest-neighbor data association.

use hicp_core::internal::{Scratch, VectorLoop, vectorized};
use hicp_core::{Context, Correspondences, Isometry3, Pair, RigidTransform, Surfel, Target};

use crate::association::data_association::DataAssociation;
use crate::search::box_tree::Stack;
#[cfg(feature = "kiddo")]
use crate::search::kd_tree::KdTree;
use crate::search::neighborhood::Neighborhood;
use crate::search::observed_points::ObservedPoints;
use crate::search::point_index::PointIndex;
use crate::search::point_tree::PointTree;
use crate::stride::Stride;

/// Pairs every model point with the closest observed point (§III-A.1; Besl & McKay 1992).
///
/// The index over the observed surfels is built once per observation, stride and kind of index. All
/// threads and hypotheses share it. An observation without surfels gives no pairs.
///
/// Cost: O(n log n) once per observation, then O(log n) per point.
#[derive(Clone, Debug, PartialEq)]
pub struct NearestNeighbor {
    /// Observed pixels that enter the index.
    ///
    /// An index that fits the cache is several times faster, at hardly any loss of accuracy in an
    /// image.
    pub targets: Stride,
    /// The index to search.
    pub index: SearchIndex,
    /// The index that was last searched, and for each source point the points near it.
    near: Scratch<(Option<u64>, Vec<Neighborhood>)>,
}

/// The index that [`NearestNeighbor`] searches.
///
/// Both find an exact nearest neighbor. They differ in time, and in the choice among equally near
/// points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum SearchIndex {
    /// A tree of bounding boxes, eight to a node. The presets use it.
    ///
    /// A search finds the four nearest points. In later iterations, a point that has moved little
    /// since compares these alone (compare Greenspan & Godin 2001). Of equally near points, the
    /// first in the image is returned. The result does not depend on earlier searches.
    #[default]
    BoxTree,
    /// kiddo's k-d tree. Of equally near points, any may be returned.
    #[cfg(feature = "kiddo")]
    KdTree,
}

impl NearestNeighbor {
    /// Creates the association.
    #[must_use]
    pub fn new(targets: Stride, index: SearchIndex) -> Self {
        Self {
            targets,
            index,
            near: Scratch::default(),
        }
    }

    fn search<T: PointIndex>(
        &mut self,
        target: Target<'_>,
        source: &[Surfel],
        camera_from_object: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        let observed = ObservedPoints::<T>::of(target, self.targets);
        let (id, near) = &mut self.near.0;
        if *id != Some(observed.id()) {
            *id = Some(observed.id());
            near.clear();
        }
        // Points near other queries cost time at worst.
        near.resize(source.len(), Neighborhood::UNKNOWN);
        pairs.reserve(source.len());
        vectorized(Search {
            observed: &observed,
            source,
            camera_from_object: RigidTransform::new(camera_from_object),
            near,
            pairs,
        });
    }
}

impl Default for NearestNeighbor {
    /// About 4,000 pixels of an image, or all points of a cloud, in a box tree.
    // Deviation: stride of C for nearest neighbors: §III-A.1 searches all of C. Here the tree has
    // about 4,000 points of it, because a small tree is faster to search at hardly any loss of
    // accuracy. `Stride::Pixels(1)` searches all.
    fn default() -> Self {
        Self::new(Stride::AboutPoints(4000), SearchIndex::default())
    }
}

impl DataAssociation for NearestNeighbor {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        camera_from_object: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        let Some(target) = context.problem.target() else {
            return;
        };
        match self.index {
            SearchIndex::BoxTree => {
                self.search::<PointTree>(target, source, camera_from_object, pairs);
            }
            #[cfg(feature = "kiddo")]
            SearchIndex::KdTree => {
                self.search::<KdTree>(target, source, camera_from_object, pairs);
            }
        }
    }

    fn name(&self) -> &'static str {
        "nearest-neighbor"
    }
}

struct Search<'a, T> {
    observed: &'a ObservedPoints<T>,
    source: &'a [Surfel],
    camera_from_object: RigidTransform,
    near: &'a mut [Neighborhood],
    pairs: &'a mut Correspondences,
}

impl<T: PointIndex> VectorLoop for Search<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let mut stack = Stack::default();
        for ((source_index, surfel), near) in (0..).zip(self.source).zip(self.near) {
            let source = self.camera_from_object.surfel(surfel);
            let point = |element| self.observed.get(element).1.point;
            let index = self.observed.index();
            let found = index.nearest_to_moved(&source.point, near, &mut stack, point);
            let Some(element) = found else { continue };
            let (target_index, target) = self.observed.get(element);
            self.pairs
                .push(Pair::new(source_index, source, target_index, target));
        }
    }
}

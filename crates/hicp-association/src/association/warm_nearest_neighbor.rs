//! Nearest neighbours that are searched from those of the last iteration.

use hicp_core::internal::{VectorLoop, vectorized};
use hicp_core::{Context, Correspondences, Isometry3, Pair, RigidTransform, Surfel};

use crate::association::data_association::DataAssociation;
use crate::scratch::Scratch;
use crate::search::observed_points::ObservedPoints;
use crate::search::wide_tree::WideTree;
use crate::stride::Stride;

/// Pairs every model point with the closest observed point, as `NearestNeighbor` does (§III-A.1; Besl & McKay 1992), and
/// faster along a registration.
///
/// From one iteration to the next a point moves little, so its last match is near: the search begins with it, and looks only
/// into the boxes that something nearer could be in (Greenspan & Godin 2001 start from the last match likewise). The boxes are
/// eight to a node and the points sixteen to a leaf, a few vector operations each. The pairs are exact and do not depend on where
/// a search began: of equally near points the first in the image is taken, where a k-d tree takes any of them.
///
/// The tree over the observed surfels is built once per observation and stride and shared by all threads and hypotheses.
/// An observation without surfels gives no pairs. Cost: O(n log n) once per observation, then O(log n) per point.
#[derive(Clone, Debug, PartialEq)]
pub struct WarmNearestNeighbor {
    /// Which observed pixels enter the tree. A tree that fits the cache answers several times faster, at hardly any loss of accuracy.
    pub targets: Stride,
    /// Per point of the source, the element of the tree that it was paired with last.
    last: Scratch<Vec<u32>>,
}

impl WarmNearestNeighbor {
    /// Makes the association.
    #[must_use]
    pub fn new(targets: Stride) -> Self {
        Self {
            targets,
            last: Scratch::default(),
        }
    }
}

impl Default for WarmNearestNeighbor {
    /// About 4,000 observed points.
    // Deviation: §III-A.1 searches all of C; a strided C is faster to search at hardly any loss of accuracy. `Stride::Pixels(1)` searches all.
    fn default() -> Self {
        Self::new(Stride::AboutPoints(4000))
    }
}

impl DataAssociation for WarmNearestNeighbor {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        camera_from_object: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        let Some(observation) = context.problem.observation() else {
            return;
        };
        let index = ObservedPoints::of(observation, self.targets, WideTree::new);
        let last = &mut self.last.0;
        // Any element is a valid start, so what another run left behind costs time at worst.
        last.resize(source.len(), 0);
        pairs.reserve(source.len());
        vectorized(Search {
            index: &index,
            source,
            mover: RigidTransform::new(camera_from_object),
            last,
            pairs,
        });
    }

    fn name(&self) -> &'static str {
        // The same pairs have the same name in a trace.
        "nearest-neighbor"
    }
}

struct Search<'a> {
    index: &'a ObservedPoints<WideTree>,
    source: &'a [Surfel],
    mover: RigidTransform,
    last: &'a mut [u32],
    pairs: &'a mut Correspondences,
}

impl VectorLoop for Search<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for ((source_index, surfel), last) in (0..).zip(self.source).zip(self.last) {
            let source = self.mover.surfel(surfel);
            let found = self.index.tree().nearest(&source.point, *last);
            let Some(found) = found else { continue };
            *last = found.element;
            let (target_index, target) = self.index.get(found.element);
            self.pairs
                .push(Pair::new(source_index, source, target_index, target));
        }
    }
}

//! The surfels of a target at a stride, searchable by position.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use hicp_core::{Point3, Surfel, Target};

use crate::search::point_index::PointIndex;
use crate::stride::Stride;

/// The number of indices that were built.
static INDICES: AtomicU64 = AtomicU64::new(0);

/// The observed surfels of one stride with their indices, and an index over their positions.
///
/// The index numbers the surfels from 0 in the order of the target.
pub(crate) struct ObservedPoints<T> {
    /// The number of this index, which no other index of the process has.
    id: u64,
    surfels: Vec<(u32, Surfel)>,
    index: T,
}

impl<T: PointIndex> ObservedPoints<T> {
    /// Returns the points of a stride.
    ///
    /// They are built once per target, stride and kind of index, and shared by all threads and
    /// hypotheses.
    pub(crate) fn of(target: Target<'_>, targets: Stride) -> Arc<Self> {
        let stride = match (target, targets) {
            (Target::Cloud(_), Stride::AboutPoints(_)) => 1,
            _ => targets.pixels(target.n_surfels()),
        };
        target.derived().get_or_build(u64::from(stride), || {
            let surfels = target.surfels(stride);
            // Surfels of observations and clouds are finite by construction.
            let points: Vec<Point3<f32>> = surfels.iter().map(|(_, s)| s.point).collect();
            let index = T::new(&points);
            let id = INDICES.fetch_add(1, Ordering::Relaxed);
            Self { id, surfels, index }
        })
    }

    /// Returns the number of the index.
    pub(crate) fn id(&self) -> u64 {
        self.id
    }

    /// Returns the number of surfels.
    pub(crate) fn len(&self) -> usize {
        self.surfels.len()
    }

    /// Returns the index over the positions.
    #[inline(always)]
    pub(crate) fn index(&self) -> &T {
        &self.index
    }

    /// Returns a surfel that the index found, and its index in the target.
    #[inline(always)]
    pub(crate) fn get(&self, element: u32) -> (u32, Surfel) {
        self.surfels[element as usize]
    }
}

//! The observed surfels of a stride, searchable by position.

use std::sync::Arc;

use hicp_core::{Observation, Point3, Surfel};

use crate::box_tree::Found;
use crate::point_tree::PointTree;
use crate::stride::Stride;

/// Built once per observation and stride, shared by all threads and hypotheses.
pub(crate) struct ObservedPoints {
    surfels: Vec<(u32, Surfel)>,
    tree: PointTree,
}

impl ObservedPoints {
    pub(crate) fn of(observation: &Observation, targets: Stride) -> Arc<Self> {
        let stride = targets.pixels(observation.n_surfels());
        observation.derived().get_or_build(u64::from(stride), || {
            let surfels: Vec<(u32, Surfel)> =
                observation.surfels(stride).map(|(i, s)| (i, *s)).collect();
            let mut tree = PointTree::default();
            tree.rebuild(surfels.len(), |i| surfels[i].1.point);
            Self { surfels, tree }
        })
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.surfels.len()
    }

    /// Replaces the content of `found` by the `count` nearest surfels (at least one), nearest first.
    pub(crate) fn nearest_n(&self, query: &Point3<f32>, count: usize, found: &mut Vec<Found>) {
        self.tree.nearest_n(query, count.max(1), found);
    }

    /// Returns what a query found: the index in the observation, and the surfel.
    pub(crate) fn get(&self, found: &Found) -> (u32, Surfel) {
        self.surfels[found.element as usize]
    }
}

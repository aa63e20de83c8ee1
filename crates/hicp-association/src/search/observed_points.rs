//! The observed surfels of a stride, searchable by position.

use std::sync::Arc;

use hicp_core::{Observation, Point3, Surfel};

use crate::stride::Stride;

/// The observed surfels of one stride with their indices, and a tree over their positions.
pub(crate) struct ObservedPoints<T> {
    surfels: Vec<(u32, Surfel)>,
    tree: T,
}

impl<T: Send + Sync + 'static> ObservedPoints<T> {
    /// Built once per observation, stride and kind of tree, shared by all threads and hypotheses.
    ///
    /// `plant` makes the tree over the positions; an observation's surfels are finite by construction.
    pub(crate) fn of(
        observation: &Observation,
        targets: Stride,
        plant: impl Fn(Vec<Point3<f32>>) -> T,
    ) -> Arc<Self> {
        let stride = targets.pixels(observation.n_surfels());
        observation.derived().get_or_build(u64::from(stride), || {
            let surfels: Vec<(u32, Surfel)> =
                observation.surfels(stride).map(|(i, s)| (i, *s)).collect();
            let tree = plant(surfels.iter().map(|(_, s)| s.point).collect());
            Self { surfels, tree }
        })
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.surfels.len()
    }

    /// The tree, which counts the surfels from 0 in the order of the image.
    #[inline]
    pub(crate) fn tree(&self) -> &T {
        &self.tree
    }

    /// Returns the index in the observation and the surfel of one that the tree found.
    #[inline]
    pub(crate) fn get(&self, element: u32) -> (u32, Surfel) {
        self.surfels[element as usize]
    }
}

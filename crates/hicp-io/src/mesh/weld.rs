//! Vertices at equal positions made one, for files that repeat them with every facet.

use std::collections::HashMap;

use hicp_core::Point3;

use super::raw::Reading;
use crate::error::{IoError, Place};
use crate::limits::Limit;

/// The vertices seen so far, by position.
#[derive(Debug, Default)]
pub(super) struct Welder {
    index_at: HashMap<[u64; 3], u32>,
}

impl Welder {
    /// Returns the index of the vertex at a position, which is added to `vertices` if there is none.
    pub(super) fn add(
        &mut self,
        reading: &Reading<'_>,
        place: Place,
        position: [f64; 3],
        vertices: &mut Vec<Point3<f64>>,
    ) -> Result<u32, IoError> {
        reading.check_position(place.clone(), &position)?;
        // Adding 0 turns -0 into +0.
        let key = position.map(|value| (value + 0.0).to_bits());
        // More vertices than that are refused by the mesh.
        let next = u32::try_from(vertices.len()).unwrap_or(u32::MAX);
        let index = *self.index_at.entry(key).or_insert(next);
        if index == next {
            vertices.push(Point3::from(position));
            reading.check(Limit::Vertices, place, vertices.len())?;
        }
        Ok(index)
    }
}

//! Rejection by distance.

use hicp_core::{Correspondences, Problem};

use crate::filter::OutlierFilter;

/// Removes pairs further apart than τ_max (§III-A.1; Turk & Levoy 1994).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaxDistance(Limit);

#[derive(Clone, Copy, Debug, PartialEq)]
enum Limit {
    Meters(f32),
    Diameters(f32),
}

impl MaxDistance {
    /// A limit in metres. NaN or a negative limit removes every pair.
    #[must_use]
    pub fn meters(limit: f32) -> Self {
        Self(Limit::Meters(limit))
    }

    /// A limit as a fraction of the model's diameter, so that it fits objects of any size.
    #[must_use]
    pub fn diameters(fraction: f32) -> Self {
        Self(Limit::Diameters(fraction))
    }
}

impl OutlierFilter for MaxDistance {
    fn filter(&mut self, problem: &Problem<'_>, pairs: &mut Correspondences) {
        let limit = match self.0 {
            Limit::Meters(limit) => limit,
            #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
            Limit::Diameters(fraction) => fraction * problem.model.diameter() as f32,
        };
        pairs.retain(|pair| pair.distance() <= limit);
    }
}

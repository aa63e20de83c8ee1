//! Rejection by the angle between normals.

use hicp_core::{Correspondences, Problem};

use crate::filter::OutlierFilter;

/// Removes pairs whose normals differ by more than θ_max (§III-A.1; Pulli 1999).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaxNormalAngle {
    min_cosine: f32,
}

impl MaxNormalAngle {
    /// A limit in degrees; 180 and more keeps everything, NaN or a negative limit removes every pair.
    #[must_use]
    pub fn degrees(limit: f32) -> Self {
        let min_cosine = if limit >= 180.0 {
            // Rounding may leave the cosine of opposite normals just below −1.
            -2.0
        } else if limit >= 0.0 {
            limit.to_radians().cos()
        } else {
            f32::INFINITY
        };
        Self { min_cosine }
    }
}

impl OutlierFilter for MaxNormalAngle {
    fn filter(&mut self, _problem: &Problem<'_>, pairs: &mut Correspondences) {
        // Rounding may leave the cosine of equal normals just below 1.
        let limit = self.min_cosine - 1e-6;
        pairs.retain(|pair| pair.source.normal.dot(&pair.target.normal) >= limit);
    }
}

//! The point-to-plane error metric.

use hicp_core::{Correspondences, Pair};

use crate::metric::error_metric::ErrorMetric;
use crate::system::normal_equations::NormalEquations;
use crate::system::row_blocks::{Row, system_of_rows};

/// E = (nᵀ (T o − c))² with the observed normal n (§III-A.2), minimized by Gauss–Newton.
///
/// Sources: Chen & Medioni 1991; the rows are those of Low 2004. Surfaces may slide along each
/// other: directions that no normal constrains are damped and do not move. There is no step from
/// fewer than six pairs. Cost: one pass and a 6×6 Cholesky decomposition.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PointToPlane;

impl PointToPlane {
    #[inline(always)]
    fn row(pair: &Pair) -> Row {
        let point = pair.source.point.cast::<f64>();
        let direction = pair.target.normal.cast::<f64>().into_inner();
        Row {
            point,
            direction,
            residual: direction.dot(&(point - pair.target.point.cast::<f64>())),
        }
    }
}

impl ErrorMetric for PointToPlane {
    #[inline(always)]
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        Self::row(pair).add_to(system, pair);
    }

    #[inline]
    fn squared_error(&self, pair: &Pair) -> f64 {
        let offset = pair.source.point.cast::<f64>() - pair.target.point.cast::<f64>();
        pair.target.normal.cast::<f64>().dot(&offset).powi(2)
    }

    fn linearize_all(&self, pairs: &Correspondences) -> Option<NormalEquations> {
        system_of_rows(pairs.as_slice(), Self::row)
    }

    fn name(&self) -> &'static str {
        "point-to-plane"
    }
}

//! The plane-to-point error metric: point-to-plane in the model's tangent planes.

use hicp_core::{Correspondences, Pair};

use crate::metric::error_metric::ErrorMetric;
use crate::system::normal_equations::NormalEquations;
use crate::system::row_blocks::{Row, system_of_rows};

/// E = (mᵀ (T o − c))², where the normal m of the model rotates with it, by Gauss–Newton.
///
/// The model's normals do not have the noise of the depth sensor. Otherwise the metric is like
/// [`PointToPlane`](crate::PointToPlane). By symmetry, its row is that of the observed point: J =
/// [mᵀ, (c × m)ᵀ]. There is no step from fewer than six pairs. Cost: one pass and a 6×6 Cholesky
/// decomposition.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PlaneToPoint;

impl PlaneToPoint {
    #[inline(always)]
    fn row(pair: &Pair) -> Row {
        // m·(ρ + φ × p) + (φ × m)·(p − c) = m·ρ + φ·(c × m): the lever is c and not p, because m
        // rotates, too.
        let point = pair.target.point.cast::<f64>();
        let direction = pair.source.normal.cast::<f64>().into_inner();
        Row {
            point,
            direction,
            residual: direction.dot(&(pair.source.point.cast::<f64>() - point)),
        }
    }
}

impl ErrorMetric for PlaneToPoint {
    #[inline(always)]
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        Self::row(pair).add_to(system, pair);
    }

    #[inline]
    fn squared_error(&self, pair: &Pair) -> f64 {
        let offset = pair.source.point.cast::<f64>() - pair.target.point.cast::<f64>();
        pair.source.normal.cast::<f64>().dot(&offset).powi(2)
    }

    fn linearize_all(&self, pairs: &Correspondences) -> Option<NormalEquations> {
        system_of_rows(pairs.as_slice(), Self::row)
    }

    fn name(&self) -> &'static str {
        "plane-to-point"
    }
}

//! The plane-to-plane metric of Generalized ICP.

use hicp_core::{Pair, Vector3};

use crate::metric::error_metric::ErrorMetric;
use crate::system::normal_equations::NormalEquations;

/// Length of the difference or the sum of two unit normals below which they count as parallel.
const PARALLEL: f64 = 1e-4;

/// E = dᵀ (C_c + R C_o Rᵀ)⁻¹ d, d = c − T o (Generalized ICP), minimized by Gauss–Newton.
///
/// Source: Segal, Haehnel & Thrun 2009. Each point is known well along its normal and badly in its
/// tangent plane: C = I − (1 − ε) n nᵀ, with eigenvalues 1, 1, ε. The original estimates normals
/// from 20 neighbors; here they are those of the surfels. If both normals agree, the error is ½
/// |tangential offset|² + (normal offset)²/(2ε). At ε = 1, it is half of that of
/// [`PointToPoint`](crate::PointToPoint). For ε → 0 and equal normals, it approaches that of
/// point-to-plane over 2ε. The loss is therefore in m², but 1/(2ε) times as large as that of other
/// metrics.
///
/// The rows are whitened: they are the three eigenvectors of C_c + R C_o Rᵀ, known in closed form,
/// weighted by the inverse eigenvalues. The matrix is constant during a step, as in the original.
/// It is the same for n and −n, so the orientation of normals does not matter. There is no step
/// from fewer than two pairs. Cost: three rows per pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Generalized {
    /// Variance along the normal relative to that in the tangent plane, clamped to [10⁻⁶, 1].
    pub epsilon: f64,
}

impl Default for Generalized {
    /// ε = 10⁻³, as in the reference implementations.
    fn default() -> Self {
        Self { epsilon: 1e-3 }
    }
}

impl Generalized {
    /// Returns the unit eigenvectors of C_c + R C_o Rᵀ and their eigenvalues.
    #[inline]
    fn axes(&self, pair: &Pair) -> [(Vector3<f64>, f64); 3] {
        // Normalized in f64, because nearly parallel normals amplify an error of their length by
        // 1/ε.
        let n = pair.target.normal.cast::<f64>().into_inner().normalize();
        let m = pair.source.normal.cast::<f64>().into_inner().normalize();
        let stiffness = 1.0 - self.epsilon.clamp(1e-6, 1.0);
        let (sum, difference) = (n + m, n - m);
        let (along, across) = (sum.norm(), difference.norm());
        let (first, second) = if across < PARALLEL {
            (sum / along, perpendicular(&sum))
        } else if along < PARALLEL {
            (perpendicular(&difference), difference / across)
        } else {
            (sum / along, difference / across)
        };
        // The eigenvalues of n nᵀ + m mᵀ are 1 ± n·m, which is half the squares of sum and
        // difference.
        [
            (first, 2.0 - stiffness * 0.5 * along * along),
            (second, 2.0 - stiffness * 0.5 * across * across),
            (first.cross(&second), 2.0),
        ]
    }
}

impl ErrorMetric for Generalized {
    #[inline(always)]
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        let point = pair.source.point.cast::<f64>();
        let offset = point - pair.target.point.cast::<f64>();
        for (axis, variance) in self.axes(pair) {
            let weight = f64::from(pair.weight) / variance;
            system.add_row(&point, &axis, axis.dot(&offset), weight);
        }
    }

    #[inline]
    fn squared_error(&self, pair: &Pair) -> f64 {
        let offset = pair.source.point.cast::<f64>() - pair.target.point.cast::<f64>();
        self.axes(pair)
            .iter()
            .map(|(axis, variance)| axis.dot(&offset).powi(2) / variance)
            .sum()
    }

    fn name(&self) -> &'static str {
        "generalized"
    }
}

/// Returns a unit vector orthogonal to another.
fn perpendicular(vector: &Vector3<f64>) -> Vector3<f64> {
    let mut other = Vector3::zeros();
    other[vector.iamin()] = 1.0;
    vector.cross(&other).normalize()
}

//! The symmetric error metric.

use hicp_core::{Correspondences, Isometry3, Pair, Point3, Translation3, Vector3, so3};

use crate::metric::error_metric::{ErrorMetric, NO_ROWS, Step};
use crate::system::moments::length_of;
use crate::system::normal_equations::NormalEquations;

/// E = (nᵀ (T^½ o − T^{−½} c))², where n = (n_o + n_c)/2 is the mean of both normals.
///
/// Source: Rusinkiewicz, "A Symmetric Objective Function for ICP", TOG 2019, where n is the sum
/// n_o + n_c. The mean has the scale of the other metrics. Each side takes half of the motion. The
/// error vanishes if both points lie on a common surface of second order. The metric therefore
/// converges from farther away than [`PointToPlane`](crate::PointToPlane) and slides less on curved
/// surfaces.
///
/// One step is *exact* for exact correspondences. With p̃ = p − p̄, q̃ = q − q̄ and the Gibbs
/// vector a = axis · tan θ of the half rotation, this problem is linear without approximation:
///
/// ```text
/// min Σ w [ (p̃ − q̃)·n + ((p̃ + q̃) × n)·a + n·t' ]²,   T = Trans(q̄) Rot(θ) Trans(t' cos θ) Rot(θ) Trans(−p̄)
/// ```
///
/// Directions that no normal constrains do not move, as with
/// [`Degeneracy::Damp`](crate::Degeneracy::Damp).
///
/// Both normals must have the same orientation. Pairs with n_o · n_c ≤ 0 are on different sides and
/// are skipped: they have no row, no part in the mean loss, and the squared error [`NO_ROWS`].
/// There is no step from fewer than six other pairs. Cost: two passes and a 6×6 Cholesky
/// decomposition.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Symmetric;

impl Symmetric {
    /// Returns n and the residual at the identity, or `None` for a skipped pair.
    #[inline]
    fn residual(pair: &Pair) -> Option<(Vector3<f64>, f64)> {
        let source = pair.source.normal.cast::<f64>().into_inner();
        let target = pair.target.normal.cast::<f64>().into_inner();
        if source.dot(&target) <= 0.0 {
            return None;
        }
        let normal = (source + target) * 0.5;
        let offset = pair.source.point.cast::<f64>() - pair.target.point.cast::<f64>();
        Some((normal, normal.dot(&offset)))
    }
}

impl ErrorMetric for Symmetric {
    #[inline(always)]
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        if let Some((normal, residual)) = Self::residual(pair) {
            // Each point takes half of the motion, so the lever is that of their midpoint.
            let middle = nalgebra::center(
                &pair.source.point.cast::<f64>(),
                &pair.target.point.cast::<f64>(),
            );
            system.add_row(&middle, &normal, residual, f64::from(pair.weight));
        }
    }

    #[inline]
    fn squared_error(&self, pair: &Pair) -> f64 {
        Self::residual(pair).map_or(NO_ROWS, |(_, residual)| residual * residual)
    }

    fn step(&self, pairs: &Correspondences) -> Option<Step> {
        let pairs = pairs.as_slice();
        let origin = pairs.first()?.source.point.cast::<f64>();
        let counting = || {
            pairs.iter().filter_map(|pair| {
                let (normal, residual) = Self::residual(pair)?;
                // Relative to one point, so that objects far from the camera lose no digits.
                let source = pair.source.point.cast::<f64>() - origin;
                let target = pair.target.point.cast::<f64>() - origin;
                Some((source, target, normal, residual, f64::from(pair.weight)))
            })
        };
        let (mut source_sum, mut target_sum) = (Vector3::zeros(), Vector3::zeros());
        let (mut squares, mut weight) = (0.0, 0.0);
        for (source, target, _, _, w) in counting() {
            source_sum += source * w;
            target_sum += target * w;
            squares += source.norm_squared() * w;
            weight += w;
        }
        // Without weight, or with points that are not finite, these are not finite either, and the
        // rows have no solution.
        let (source_mean, target_mean) = (source_sum / weight, target_sum / weight);
        let variance = squares / weight - source_mean.norm_squared();
        let middle = (source_mean + target_mean) * 0.5;
        let mut system = NormalEquations::new(Point3::origin(), length_of(variance));
        for (source, target, normal, residual, w) in counting() {
            // The unknowns are u = t' + (q̄ − p̄) and 2a. Undetermined ones are zero, and zero
            // means no motion.
            let lever = Point3::from((source + target) * 0.5 - middle);
            system.add_row(&lever, &normal, residual, w);
        }
        let z = system.exact_twist()?;
        let gibbs: Vector3<f64> = z.fixed_rows::<3>(3) * 0.5;
        let tangent = gibbs.norm();
        let half_angle = if tangent > 0.0 {
            gibbs * (tangent.atan() / tangent)
        } else {
            gibbs
        };
        let half = so3::exp(&half_angle);
        let rotation = half * half;
        let shift = z.fixed_rows::<3>(0) - (target_mean - source_mean);
        let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
        let (source_mean, target_mean) = (origin.coords + source_mean, origin.coords + target_mean);
        let translation = target_mean + half * (shift * cosine) - rotation * source_mean;
        let increment = Isometry3::from_parts(Translation3::from(translation), rotation);
        hicp_core::se3::is_finite(&increment).then_some(Step {
            increment,
            mean_loss: system.loss() / weight,
        })
    }

    fn name(&self) -> &'static str {
        "symmetric"
    }
}

//! The point-to-point error metric.

use hicp_core::{
    Correspondences, Isometry3, Matrix3, Pair, Point3, Translation3, UnitQuaternion, Vector3,
};
use nalgebra::{Rotation3, SymmetricEigen};

use crate::metric::{ErrorMetric, Step};
use crate::normal_equations::NormalEquations;

/// Fewer pairs leave the rotation open.
const MIN_PAIRS: usize = 3;

/// E = ‖T o − c‖² (§III-A.2; Besl & McKay 1992), minimised in closed form.
///
/// The minimiser is Kabsch's with Umeyama's determinant factor (1991), so the result is a rotation even where planar
/// points and noise would make a reflection fit better. One step is exact for exact correspondences. Cost: one pass over
/// the pairs and one decomposition of a 3×3 matrix.
///
/// Collinear sets leave the turn about their line free: it stays zero, and the smallest rotation that aligns the lines is taken.
/// No step from fewer than three pairs, without weight, from points all in one place, nor where a reflection would fit better
/// and several rotations fit next best.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PointToPoint;

impl ErrorMetric for PointToPoint {
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        let point = pair.source.point.cast::<f64>();
        let difference = point - pair.target.point.cast::<f64>();
        let weight = f64::from(pair.weight);
        system.add_row(&point, &Vector3::x(), difference.x, weight);
        system.add_row(&point, &Vector3::y(), difference.y, weight);
        system.add_row(&point, &Vector3::z(), difference.z, weight);
    }

    fn minimize(&mut self, pairs: &Correspondences) -> Option<Step> {
        let pairs = pairs.as_slice();
        let first = pairs.first().filter(|_| pairs.len() >= MIN_PAIRS)?;
        // Sums relative to the first pair, so that objects far from the camera lose no digits.
        let source_origin = first.source.point.cast::<f64>();
        let target_origin = first.target.point.cast::<f64>();
        let (mut source_sum, mut target_sum) = (Vector3::zeros(), Vector3::zeros());
        let mut products = Matrix3::zeros();
        let (mut spread, mut loss, mut weight) = (0.0, 0.0, 0.0);
        for pair in pairs {
            let w = f64::from(pair.weight);
            let source = pair.source.point.cast::<f64>();
            let target = pair.target.point.cast::<f64>();
            let (p, q) = (source - source_origin, target - target_origin);
            source_sum += p * w;
            target_sum += q * w;
            products += (p * w) * q.transpose();
            spread += w * (p.norm_squared() + q.norm_squared());
            loss += w * (source - target).norm_squared();
            weight += w;
        }
        if !(weight > 0.0 && spread.is_finite() && loss.is_finite()) {
            return None;
        }
        let (source_mean, target_mean) = (source_sum / weight, target_sum / weight);
        let covariance = products / weight - source_mean * target_mean.transpose();
        let rotation = nearest_rotation(&covariance)?;
        let source_centroid = source_origin + source_mean;
        let target_centroid = target_origin + target_mean;
        Some(Step {
            increment: about(&source_centroid, &target_centroid, rotation),
            mean_loss: loss / weight,
        })
    }

    #[inline]
    fn squared_error(&self, pair: &Pair) -> f64 {
        (pair.source.point.cast::<f64>() - pair.target.point.cast::<f64>()).norm_squared()
    }

    fn name(&self) -> &'static str {
        "point-to-point"
    }
}

/// The motion that turns about `from` and carries `from` to `to`.
fn about(from: &Point3<f64>, to: &Point3<f64>, rotation: UnitQuaternion<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(to.coords - rotation * from.coords),
        rotation,
    )
}

/// Returns the rotation R that maximises tr(R H) for H = Σ w p qᵀ, as Kabsch's V diag(1, 1, det(V Uᵀ)) Uᵀ.
///
/// With HᵀH = V Σ² Vᵀ the left vectors are u_i = H v_i/σ_i for the two largest singular values; the third pair is completed
/// by cross products, which *is* the determinant factor: both bases are right-handed, so det R = +1, and the smallest
/// singular value, which planar sets do not determine, is never divided by.
fn nearest_rotation(covariance: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    let scale = covariance.amax();
    if !(scale > 0.0 && scale.is_finite()) {
        return None;
    }
    let h = covariance / scale;
    let eigen = SymmetricEigen::new(h.transpose() * h);
    let mut order = [0, 1, 2];
    order.sort_unstable_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let [first, second, _] = order;
    let v1 = eigen.eigenvectors.column(first).into_owned();
    let u1 = h * v1;
    let sigma1 = u1.norm();
    // Eigenvectors of HᵀH carry errors of the order of ε σ₁²: re-orthogonalise in the second direction.
    let v2 = eigen.eigenvectors.column(second).into_owned();
    let v2 = (v2 - v1 * v1.dot(&v2)).try_normalize(0.0)?;
    let u1 = u1 / sigma1;
    let u2 = h * v2;
    let u2 = u2 - u1 * u1.dot(&u2);
    let sigma2 = u2.norm();
    // Collinear points: any turn about their line fits, and the shortest way from line to line has none.
    if sigma2 <= 1e-9 * sigma1 {
        return UnitQuaternion::rotation_between(&u1, &v1);
    }
    let u2 = u2 / sigma2;
    let (u3, v3) = (u1.cross(&u2), v1.cross(&v2));
    // A reflection would fit better and the two smallest singular values agree: the rotation is not unique.
    let sigma3 = u3.dot(&(h * v3));
    if sigma3 < 0.0 && sigma2 + sigma3 <= 1e-9 * sigma1 {
        return None;
    }
    let rotation =
        Matrix3::from_columns(&[v1, v2, v3]) * Matrix3::from_columns(&[u1, u2, u3]).transpose();
    Some(UnitQuaternion::from_rotation_matrix(
        &Rotation3::from_matrix_unchecked(rotation),
    ))
}

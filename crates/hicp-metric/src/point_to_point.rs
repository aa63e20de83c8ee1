//! The point-to-point error metric.

use hicp_core::{
    Correspondences, Isometry3, Matrix3, Pair, Point3, Translation3, UnitQuaternion, Vector3,
};
use nalgebra::{Matrix2, Quaternion, Rotation3, SymmetricEigen};

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
/// No step from fewer than three pairs of positive weight, from points all in one place, nor where a reflection would fit better
/// and several rotations fit next best.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PointToPoint;

impl ErrorMetric for PointToPoint {
    #[inline(always)]
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
        // Sums relative to the first pair that counts, so that objects far from the camera lose no digits, and points all
        // in one place give sums of exact zeros.
        let mut counting = pairs.iter().filter(|pair| pair.weight > 0.0);
        let first = counting.next()?;
        if counting.take(MIN_PAIRS - 1).count() < MIN_PAIRS - 1 {
            return None;
        }
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
/// The largest singular pair (u₁, v₁) comes from the eigenvectors of HᵀH, which know smaller ones only to √ε. What is left is
/// the turn about v₁ that maximises the trace over the planes across u₁ and v₁, an angle in closed form. A turn has
/// determinant +1, so a reflection cannot come out, and no small singular value is ever divided by.
fn nearest_rotation(covariance: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    let scale = covariance.amax();
    if !(scale > 0.0 && scale.is_finite()) {
        return None;
    }
    let h = covariance / scale;
    let eigen = SymmetricEigen::new(h.transpose() * h);
    let v1 = eigen.eigenvectors.column(eigen.eigenvalues.imax());
    let v1 = v1.into_owned().normalize();
    let u1 = h * v1;
    let sigma1 = u1.norm();
    let u1 = u1 / sigma1;
    let ((u2, u3), (v2, v3)) = (plane_across(&u1), plane_across(&v1));
    let (h2, h3) = (h * v2, h * v3);
    let m = Matrix2::new(u2.dot(&h2), u2.dot(&h3), u3.dot(&h2), u3.dot(&h3));
    // Collinear points: any turn about their line fits, and the shortest way from line to line has none.
    if m.norm() <= 1e-9 * sigma1 {
        return Some(shortest_turn(&u1, &v1));
    }
    let (along, across) = (m.m11 + m.m22, m.m12 - m.m21);
    let gain = along.hypot(across);
    // A reflection would fit better and the two smallest singular values agree: every turn fits alike.
    if gain <= 1e-9 * sigma1 {
        return None;
    }
    let (cosine, sine) = (along / gain, across / gain);
    let turned = [v1, v2 * cosine + v3 * sine, v3 * cosine - v2 * sine];
    let rotation =
        Matrix3::from_columns(&turned) * Matrix3::from_columns(&[u1, u2, u3]).transpose();
    Some(UnitQuaternion::from_rotation_matrix(
        &Rotation3::from_matrix_unchecked(rotation),
    ))
}

/// Completes a unit vector to a right-handed basis.
fn plane_across(axis: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let mut other = Vector3::zeros();
    other[axis.iamin()] = 1.0;
    let second = axis.cross(&other).normalize();
    (second, axis.cross(&second))
}

/// Returns the smallest rotation that carries one unit vector to another, one of many when they are opposite.
///
/// The half angle from the sum and the difference of the vectors has full precision at every angle.
fn shortest_turn(from: &Vector3<f64>, to: &Vector3<f64>) -> UnitQuaternion<f64> {
    let normal = from.cross(to);
    let axis = (normal - from * from.dot(&normal))
        .try_normalize(1e-12)
        .unwrap_or_else(|| plane_across(from).0);
    let (cosine, sine) = ((from + to).norm(), (from - to).norm());
    UnitQuaternion::new_normalize(Quaternion::from_parts(cosine, axis * sine))
}

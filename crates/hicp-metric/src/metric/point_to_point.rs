//! The point-to-point error metric.

use hicp_core::internal::small::eigen3;
use hicp_core::internal::{VectorLoop, vectorized};
use hicp_core::{
    Correspondences, Isometry3, Matrix3, Pair, Point3, Translation3, UnitQuaternion, Vector3,
};
use nalgebra::{Matrix2, Quaternion, Rotation3};

use crate::metric::error_metric::{ErrorMetric, Step};
use crate::system::normal_equations::NormalEquations;
use crate::system::pair_block::{BLOCK, LANES, PairBlock, add, add_products, product};
use crate::system::point_blocks::system_of_points;

/// Smallest number of pairs that determines a rotation.
// Open: fewest pairs of point-to-point: §III-A.2. Fewer leave a rotation undetermined.
const MIN_PAIRS: usize = 3;

/// E = ‖T o − c‖² (§III-A.2; Besl & McKay 1992), minimized in closed form.
///
/// The minimizer is Kabsch's with Umeyama's determinant factor (1991). The result is a rotation,
/// even if planar points and noise would make a reflection fit better. One step is exact for exact
/// correspondences. Cost: one pass over the pairs and one decomposition of a 3×3 matrix.
///
/// Collinear points do not determine the rotation around their line, which stays zero: the result
/// is the smallest rotation that aligns the lines. There is no step in these cases:
///
/// - There are fewer than three pairs of positive weight.
/// - All points are at one place.
/// - A reflection would fit better, and several rotations fit next best.
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

    fn linearize_all(&self, pairs: &Correspondences) -> Option<NormalEquations> {
        system_of_points(pairs.as_slice())
    }

    fn step(&self, pairs: &Correspondences) -> Option<Step> {
        let pairs = pairs.as_slice();
        // Sums are relative to the first pair with weight. Objects far from the camera lose no
        // digits, and points at one place give exact zeros.
        let counting = || pairs.iter().filter(|pair| pair.weight > 0.0);
        let first = counting().next()?;
        counting().nth(MIN_PAIRS - 1)?;
        let source_origin = first.source.point.cast::<f64>();
        let target_origin = first.target.point.cast::<f64>();
        let sums = vectorized(SumProducts {
            pairs,
            source_origin,
            target_origin,
        });
        let weight = sums.weight;
        if !(weight > 0.0 && sums.spread.is_finite()) {
            return None;
        }
        let (source_mean, target_mean) = (sums.source / weight, sums.target / weight);
        let covariance = sums.products / weight - source_mean * target_mean.transpose();
        let rotation = nearest_rotation(&covariance)?;
        let source_centroid = source_origin + source_mean;
        let target_centroid = target_origin + target_mean;
        Some(Step {
            increment: about(&source_centroid, &target_centroid, rotation),
            mean_loss: sums.loss / weight,
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

/// Sums over the pairs, where p and q are sources and targets, each relative to an origin.
struct Products {
    /// Σ w p.
    source: Vector3<f64>,
    /// Σ w q.
    target: Vector3<f64>,
    /// Σ w p qᵀ.
    products: Matrix3<f64>,
    /// Σ w (p² + q²).
    spread: f64,
    /// Σ w of the squared distances.
    loss: f64,
    weight: f64,
}

struct SumProducts<'a> {
    pairs: &'a [Pair],
    source_origin: Point3<f64>,
    target_origin: Point3<f64>,
}

impl VectorLoop for SumProducts<'_> {
    type Output = Products;

    #[inline(always)]
    fn run(self) -> Products {
        let zero = [0.0; LANES];
        let (mut source, mut target, mut products) = ([zero; 3], [zero; 3], [[zero; 3]; 3]);
        let (mut spread, mut loss, mut weight) = (zero, zero, zero);
        let mut block = PairBlock::new();
        let (mut p, mut q, mut d) = ([[0.0; BLOCK]; 3], [[0.0; BLOCK]; 3], [[0.0; BLOCK]; 3]);
        let mut w = [0.0; BLOCK];
        for pairs in self.pairs.chunks(BLOCK) {
            block.fill(pairs);
            for axis in 0..3 {
                let origins = (self.source_origin[axis], self.target_origin[axis]);
                for lane in 0..BLOCK {
                    let source = f64::from(block.source[axis][lane]);
                    let target = f64::from(block.target[axis][lane]);
                    p[axis][lane] = source - origins.0;
                    q[axis][lane] = target - origins.1;
                    d[axis][lane] = source - target;
                }
            }
            for (w, weight) in w.iter_mut().zip(&block.weight) {
                *w = f64::from(*weight);
            }
            for axis in 0..3 {
                let (wp, wq) = (product(&p[axis], &w), product(&q[axis], &w));
                add(&mut source[axis], &wp);
                add(&mut target[axis], &wq);
                for (sum, q) in products[axis].iter_mut().zip(&q) {
                    add_products(sum, &wp, q);
                }
                add_products(&mut spread, &wp, &p[axis]);
                add_products(&mut spread, &wq, &q[axis]);
                add_products(&mut loss, &product(&d[axis], &w), &d[axis]);
            }
            add(&mut weight, &w);
        }
        let total = |lanes: [f64; LANES]| lanes.iter().sum::<f64>();
        Products {
            source: source.map(total).into(),
            target: target.map(total).into(),
            products: Matrix3::from_fn(|row, column| total(products[row][column])),
            spread: total(spread),
            loss: total(loss),
            weight: total(weight),
        }
    }
}

/// Returns the motion that rotates around `from` and moves `from` to `to`.
fn about(from: &Point3<f64>, to: &Point3<f64>, rotation: UnitQuaternion<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(to.coords - rotation * from.coords),
        rotation,
    )
}

/// Returns the rotation R that maximizes tr(R H), for H = Σ w p qᵀ.
///
/// It is Kabsch's V diag(1, 1, det(V Uᵀ)) Uᵀ.
///
/// The largest singular pair (u₁, v₁) comes from the eigenvectors of HᵀH, which determine smaller
/// pairs only to √ε. The rest is the rotation around v₁ that maximizes the trace over the planes
/// orthogonal to u₁ and v₁, an angle in closed form. A rotation has determinant +1, so the result
/// is never a reflection, and there is no division by a small singular value.
fn nearest_rotation(covariance: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    let scale = covariance.amax();
    if !(scale > 0.0 && scale.is_finite()) {
        return None;
    }
    let h = covariance / scale;
    let eigen = eigen3(&(h.transpose() * h))?;
    let v1 = eigen.eigenvectors.column(eigen.eigenvalues.imax());
    let v1 = v1.into_owned().normalize();
    let u1 = h * v1;
    let sigma1 = u1.norm();
    let u1 = u1 / sigma1;
    let ((u2, u3), (v2, v3)) = (plane_across(&u1), plane_across(&v1));
    let (h2, h3) = (h * v2, h * v3);
    let m = Matrix2::new(u2.dot(&h2), u2.dot(&h3), u3.dot(&h2), u3.dot(&h3));
    // Collinear points: any rotation around their line fits, and the shortest one from line to line
    // has none.
    if m.norm() <= 1e-9 * sigma1 {
        return Some(shortest_turn(&u1, &v1));
    }
    let (along, across) = (m.m11 + m.m22, m.m12 - m.m21);
    let gain = along.hypot(across);
    // A reflection would fit better and the two smallest singular values agree: all rotations fit
    // alike.
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

/// Returns the smallest rotation of one unit vector to another, one of many if they are opposite.
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

//! Normals of unorganized points.

use hicp_core::internal::{VectorLoop, vectorized};
use hicp_core::{Matrix3, Point3, UnitVector3, Vector3};

use crate::search::nearest::{Nearest, PointIndex};
use crate::search::point_tree::PointTree;

/// Ratio of the two smaller principal variances to the largest below which points lie on a line.
const LINE: f64 = 1e-8;

/// Estimates the normals of points from the plane through the `k` nearest ones, itself included.
///
/// The normal is the direction of least variance (Hoppe et al. 1992). It faces the origin of the
/// frame, where scanners and depth cameras put the sensor. It is `None` if the neighbors lie on a
/// line or in one place, if there are fewer than three, and for points that are not finite.
///
/// 10 to 20 neighbors suit most scans. Fewer follow finer detail, more suppress noise. Cost:
/// O(n log n + n k), about 2 µs per point on one core for 20 neighbors.
#[must_use]
pub fn estimate_normals(points: &[Point3<f32>], k: usize) -> Vec<Option<UnitVector3<f32>>> {
    let finite = |point: &Point3<f32>| point.iter().all(|x| x.is_finite());
    let places: Vec<usize> = (0..points.len()).filter(|i| finite(&points[*i])).collect();
    let finite: Vec<Point3<f32>> = places.iter().map(|i| points[*i]).collect();
    let mut normals = vec![None; points.len()];
    vectorized(Planes {
        points: &finite,
        k,
        take: |element: usize, normal| normals[places[element]] = normal,
    });
    normals
}

struct Planes<'a, F> {
    points: &'a [Point3<f32>],
    k: usize,
    take: F,
}

impl<F: FnMut(usize, Option<UnitVector3<f32>>)> VectorLoop for Planes<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run(mut self) {
        let tree = PointTree::new(self.points);
        let mut neighbors: Vec<Nearest> = Vec::with_capacity(self.k.min(self.points.len()));
        // Neighbors in the order of the tree share its nodes.
        for element in tree.order() {
            let point = &self.points[*element as usize];
            tree.nearest_n(point, self.k, &mut neighbors);
            let offsets = (neighbors.iter())
                .map(|near| (self.points[near.element as usize] - point).cast::<f64>());
            (self.take)(*element as usize, plane_normal(offsets, &point.coords));
        }
    }
}

/// Returns the normal of the plane through some points near `place`, toward the origin.
#[inline(always)]
fn plane_normal(
    offsets: impl Iterator<Item = Vector3<f64>>,
    place: &Vector3<f32>,
) -> Option<UnitVector3<f32>> {
    let (mut count, mut sum, mut squares) = (0.0, Vector3::zeros(), [0.0; 6]);
    for o in offsets {
        count += 1.0;
        sum += o;
        let products = [
            o.x * o.x,
            o.x * o.y,
            o.x * o.z,
            o.y * o.y,
            o.y * o.z,
            o.z * o.z,
        ];
        for (square, product) in squares.iter_mut().zip(products) {
            *square += product;
        }
    }
    let mean = sum / count;
    let [xx, xy, xz, yy, yz, zz] = squares;
    let scatter = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) - sum * mean.transpose();
    let normal = least_direction(&scatter)?.cast::<f32>();
    let normal = UnitVector3::try_new(normal, 0.0)?;
    Some(if normal.dot(place) > 0.0 {
        -normal
    } else {
        normal
    })
}

/// Returns the eigenvector of the smallest eigenvalue of a positive semidefinite matrix.
///
/// Returns `None` if two of the eigenvalues are zero. The adjugate has the same eigenvectors, and
/// as eigenvalues the products of the other two: the wanted one is the largest. Its powers approach
/// the projection on it.
#[inline(always)]
fn least_direction(matrix: &Matrix3<f64>) -> Option<Vector3<f64>> {
    let trace = matrix.trace();
    let m = matrix / trace;
    let (a, b, c) = (m.column(0), m.column(1), m.column(2));
    let mut power = Matrix3::from_columns(&[b.cross(&c), c.cross(&a), a.cross(&b)]);
    // The trace is the sum of the products of two eigenvalues each. False for NaN.
    let determined = trace > 0.0 && power.trace() > LINE;
    if !determined {
        return None;
    }
    for _ in 0..5 {
        power /= power.trace();
        power *= power;
    }
    let diagonal = power.diagonal();
    Some(power.column(diagonal.imax()).normalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_direction_of_least_variance_is_that_of_the_library() {
        for seed in 0..200 {
            let number = |i: usize| ((seed * 9 + i) as f64 * 0.7).sin();
            let root = Matrix3::from_fn(|row, column| number(3 * row + column));
            let matrix = root * root.transpose();
            let library = matrix.symmetric_eigen();
            let mut values = library.eigenvalues;
            values.as_mut_slice().sort_by(f64::total_cmp);
            // Nearly equal variances have no direction.
            if values[0] > 0.5 * values[1] || values[1] < 1e-4 * values[2] {
                continue;
            }
            let expected = library.eigenvectors.column(library.eigenvalues.imin());
            let found = least_direction(&matrix).unwrap();
            assert!(found.dot(&expected).abs() > 1.0 - 1e-9, "{seed}");
        }
        let line = Vector3::new(1.0, 2.0, 3.0);
        for flat in [
            Matrix3::zeros(),
            line * line.transpose(),
            Matrix3::repeat(f64::NAN),
        ] {
            assert_eq!(least_direction(&flat), None);
        }
    }
}

//! Normals of unorganized points.

use hicp_core::internal::{VectorLoop, vectorized};
use hicp_core::{Point3, UnitVector3, Vector3};

use crate::search::box_tree::Stack;
use crate::search::nearest::Nearest;
use crate::search::point_index::PointIndex;
use crate::search::point_tree::PointTree;

/// Ratio of the two smaller principal variances to the largest below which points lie on a line.
const LINE: f64 = 1e-8;

/// Estimates the normal of each point from a plane fit to its `k` nearest points, itself included.
///
/// The normal is the direction of least variance (Hoppe et al. 1992). It faces the origin of the
/// frame, where scanners and depth cameras put the sensor. It is `None` if the neighbors lie on a
/// line or in one place, if there are fewer than three, and for points that are not finite.
///
/// 10 to 20 neighbors suit most scans. Fewer follow finer detail, more suppress noise. Cost:
/// O(n log n + n k), about 1 µs per point on one core for 20 neighbors.
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

/// Number of points whose neighbors bound the next search.
const RECENT: usize = 16;

/// Covers the rounding of a squared distance.
const SLACK: f32 = 1e-5;

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
        let k = self.k.min(self.points.len());
        let mut neighbors: Vec<Nearest> = Vec::with_capacity(3 * k);
        let (mut recent, mut stack) = (Recent::default(), Stack::default());
        // Neighbors in the order of the tree share its nodes.
        for element in tree.order() {
            let point = &self.points[*element as usize];
            tree.gather(
                point,
                k,
                [0.0, recent.bound(point)],
                &mut stack,
                &mut neighbors,
            );
            if neighbors.len() < k {
                tree.gather(point, k, [0.0, f32::MAX], &mut stack, &mut neighbors);
            }
            let farthest = neighbors.iter().map(|near| near.distance_squared);
            recent.add(point, farthest.fold(0.0, f32::max).sqrt());
            let offsets = (neighbors.iter())
                .map(|near| (self.points[near.element as usize] - point).cast::<f64>());
            (self.take)(*element as usize, plane_normal(offsets, &point.coords));
        }
    }
}

/// The last points, and the radii within which their nearest ones lie.
///
/// If k points are within r of a point, k points are within r + d of a place at the distance d from
/// it. This bounds the next search.
struct Recent {
    points: [[f32; RECENT]; 3],
    radii: [f32; RECENT],
    next: usize,
}

impl Default for Recent {
    fn default() -> Self {
        Self {
            points: [[0.0; RECENT]; 3],
            radii: [f32::INFINITY; RECENT],
            next: 0,
        }
    }
}

impl Recent {
    /// Returns a squared distance within which the nearest points of `place` lie.
    #[inline(always)]
    fn bound(&self, place: &Point3<f32>) -> f32 {
        let mut distances = [0.0; RECENT];
        for (points, place) in self.points.iter().zip(place.iter()) {
            for (distance, point) in distances.iter_mut().zip(points) {
                *distance += (point - place) * (point - place);
            }
        }
        for (distance, radius) in distances.iter_mut().zip(&self.radii) {
            *distance = distance.sqrt() + radius;
        }
        let radius = distances.iter().copied().fold(f32::INFINITY, f32::min);
        (radius * radius * (1.0 + SLACK)).min(f32::MAX)
    }

    #[inline(always)]
    fn add(&mut self, point: &Point3<f32>, radius: f32) {
        for (points, coordinate) in self.points.iter_mut().zip(point.iter()) {
            points[self.next] = *coordinate;
        }
        self.radii[self.next] = radius;
        self.next = (self.next + 1) % RECENT;
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
    let [x, y, z] = [sum.x / count, sum.y / count, sum.z / count];
    let [xx, xy, xz, yy, yz, zz] = squares;
    let normal = least_direction([
        xx - sum.x * x,
        xy - sum.x * y,
        xz - sum.x * z,
        yy - sum.y * y,
        yz - sum.y * z,
        zz - sum.z * z,
    ])?;
    let normal = UnitVector3::try_new(normal.cast::<f32>(), 0.0)?;
    Some(if normal.dot(place) > 0.0 {
        -normal
    } else {
        normal
    })
}

/// Returns the eigenvector of the smallest eigenvalue of a positive semidefinite matrix, given as
/// xx, xy, xz, yy, yz, zz.
///
/// Returns `None` if two of the eigenvalues are zero. The adjugate has the same eigenvectors, and
/// as eigenvalues the products of the other two: the wanted one is the largest. Its powers approach
/// the projection on it.
#[inline(always)]
fn least_direction(matrix: [f64; 6]) -> Option<Vector3<f64>> {
    let trace = matrix[0] + matrix[3] + matrix[5];
    let [a, b, c, d, e, f] = matrix.map(|entry| entry / trace);
    let adjugate = [
        d * f - e * e,
        c * e - b * f,
        b * e - c * d,
        a * f - c * c,
        b * c - a * e,
        a * d - b * b,
    ];
    // The trace is the sum of the products of two eigenvalues each. False for NaN.
    let products = adjugate[0] + adjugate[3] + adjugate[5];
    let determined = trace > 0.0 && products > LINE;
    if !determined {
        return None;
    }
    // A square of trace 1 has a trace of at least ⅓, so that nothing vanishes.
    let mut power = adjugate.map(|entry| entry / products);
    for _ in 0..5 {
        let [a, b, c, d, e, f] = power;
        power = [
            a * a + b * b + c * c,
            a * b + b * d + c * e,
            a * c + b * e + c * f,
            b * b + d * d + e * e,
            b * c + d * e + e * f,
            c * c + e * e + f * f,
        ];
    }
    let [a, b, c, d, e, f] = power;
    let column = if a >= d && a >= f {
        Vector3::new(a, b, c)
    } else if d >= f {
        Vector3::new(b, d, e)
    } else {
        Vector3::new(c, e, f)
    };
    Some(column.normalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use hicp_core::Matrix3;

    fn least_direction_of(m: &Matrix3<f64>) -> Option<Vector3<f64>> {
        least_direction([m.m11, m.m12, m.m13, m.m22, m.m23, m.m33])
    }

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
            let found = least_direction_of(&matrix).unwrap();
            assert!(found.dot(&expected).abs() > 1.0 - 1e-9, "{seed}");
        }
        let line = Vector3::new(1.0, 2.0, 3.0);
        for flat in [
            Matrix3::zeros(),
            line * line.transpose(),
            Matrix3::repeat(f64::NAN),
        ] {
            assert_eq!(least_direction_of(&flat), None);
        }
    }
}

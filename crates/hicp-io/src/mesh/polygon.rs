//! Triangulation of polygons.

use hicp_core::{Point2, Point3, Vector3};

/// The comparisons with corners that clipping may cost for all polygons of a file: about a second.
///
/// Ear clipping takes quadratic time at best, so a malicious file could otherwise occupy a program
/// for hours.
pub(super) const CLIPPING_BUDGET: u64 = 1 << 28;

/// Appends the n − 2 triangles of a polygon of n corners, with its winding. They are places in
/// `corners`.
///
/// Appends nothing for fewer than three corners. A convex polygon becomes a fan. A concave polygon
/// is clipped ear by ear in its mean plane. The rest of a polygon that crosses itself becomes a
/// fan.
///
/// Returns whether the budget was sufficient; if not, the triangles are unusable. `corners` must be
/// indices into `vertices`.
pub(super) fn triangulate(
    vertices: &[Point3<f64>],
    corners: &[u32],
    triangles: &mut Vec<[usize; 3]>,
    budget: &mut u64,
) -> bool {
    let n = corners.len();
    if n <= 3 {
        fan(0..n, triangles);
        return true;
    }
    let points = flatten(vertices, corners);
    if (0..n).all(|i| turn(&points[(i + n - 1) % n], &points[i], &points[(i + 1) % n]) >= 0.0) {
        fan(0..n, triangles);
        return true;
    }
    clip_ears(&points, triangles, budget)
}

fn fan(mut corners: impl Iterator<Item = usize>, triangles: &mut Vec<[usize; 3]>) {
    if let (Some(first), Some(mut last)) = (corners.next(), corners.next()) {
        triangles.extend(corners.map(|next| [first, std::mem::replace(&mut last, next), next]));
    }
}

/// Projects the corners along the axis closest to the polygon's normal, so that they are
/// counter-clockwise.
fn flatten(vertices: &[Point3<f64>], corners: &[u32]) -> Vec<Point2<f64>> {
    let positions: Vec<Point3<f64>> = corners.iter().map(|i| vertices[*i as usize]).collect();
    // Newell's normal, relative to the first corner to keep precision for polygons far from the
    // origin.
    let mut normal = Vector3::zeros();
    for (i, p) in positions.iter().enumerate() {
        let next = positions[(i + 1) % positions.len()];
        normal += (p - positions[0]).cross(&(next - positions[0]));
    }
    let axis = normal.iamax();
    let (mut u, mut v) = ((axis + 1) % 3, (axis + 2) % 3);
    if normal[axis] < 0.0 {
        (u, v) = (v, u);
    }
    positions.iter().map(|p| Point2::new(p[u], p[v])).collect()
}

/// Returns twice the signed area of a triangle, positive if it turns left.
fn turn(a: &Point2<f64>, b: &Point2<f64>, c: &Point2<f64>) -> f64 {
    (b - a).perp(&(c - a))
}

fn clip_ears(points: &[Point2<f64>], triangles: &mut Vec<[usize; 3]>, budget: &mut u64) -> bool {
    let mut left: Vec<usize> = (0..points.len()).collect();
    let (mut at, mut misses) = (0, 0);
    while left.len() > 3 && misses < left.len() {
        if *budget == 0 {
            return false;
        }
        let n = left.len();
        at %= n;
        let ear = [left[(at + n - 1) % n], left[at], left[(at + 1) % n]];
        if is_ear(points, &left, ear, budget) {
            triangles.push(ear);
            left.remove(at);
            misses = 0;
        } else {
            misses += 1;
            at += 1;
        }
    }
    fan(left.into_iter(), triangles);
    true
}

/// Returns whether three neighbors form a triangle that contains none of the remaining corners.
fn is_ear(points: &[Point2<f64>], left: &[usize], ear: [usize; 3], budget: &mut u64) -> bool {
    let [a, b, c] = ear.map(|i| points[i]);
    *budget = budget.saturating_sub(1);
    // A straight corner counts as an ear only at the end. Clipped earlier, it would hide a neighbor
    // on the line.
    if turn(&a, &b, &c).is_nan() || turn(&a, &b, &c) <= 0.0 {
        return false;
    }
    let blocking = left.iter().position(|i| {
        let p = points[*i];
        // A bridge to a hole visits corners twice, so equal positions do not block.
        let is_outside = [a, b, c].contains(&p)
            || turn(&a, &b, &p) < 0.0
            || turn(&b, &c, &p) < 0.0
            || turn(&c, &a, &p) < 0.0;
        !is_outside
    });
    *budget = budget.saturating_sub(blocking.unwrap_or(left.len()) as u64);
    blocking.is_none()
}

#[cfg(test)]
mod tests {
    use super::*;
    use hicp_core::Isometry3;
    use proptest::prelude::*;

    fn area(vertices: &[Point3<f64>], triangles: &[[usize; 3]], up: &Vector3<f64>) -> (f64, f64) {
        let (mut signed, mut absolute) = (0.0, 0.0);
        for t in triangles {
            let [a, b, c] = t.map(|i| vertices[i]);
            let area = 0.5 * (b - a).cross(&(c - a)).dot(up);
            signed += area;
            absolute += area.abs();
        }
        (signed, absolute)
    }

    fn cut(vertices: &[Point3<f64>]) -> Vec<[usize; 3]> {
        let corners: Vec<u32> = (0..).take(vertices.len()).collect();
        let mut triangles = Vec::new();
        let mut budget = CLIPPING_BUDGET;
        assert!(triangulate(vertices, &corners, &mut triangles, &mut budget));
        triangles
    }

    fn flat(points: &[[f64; 2]]) -> Vec<Point3<f64>> {
        points
            .iter()
            .map(|p| Point3::new(p[0], p[1], 0.0))
            .collect()
    }

    #[test]
    fn a_dart_is_cut_at_its_notch() {
        // A fan from the first corner would leave the polygon.
        let vertices = flat(&[[2.0, 1.0], [0.0, 2.0], [1.0, 1.0], [0.0, 0.0]]);
        let triangles = cut(&vertices);
        assert_eq!(triangles.len(), 2);
        let (signed, absolute) = area(&vertices, &triangles, &Vector3::z());
        assert!((signed - 1.0).abs() < 1e-12 && (absolute - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_bridged_hole_stays_open() {
        // A 4 x 4 square with a 2 x 2 hole, joined by a bridge that is walked twice.
        let vertices = flat(&[
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 4.0],
            [0.0, 4.0],
            [0.0, 0.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [3.0, 3.0],
            [3.0, 1.0],
            [1.0, 1.0],
        ]);
        let triangles = cut(&vertices);
        assert_eq!(triangles.len(), 8);
        let (signed, absolute) = area(&vertices, &triangles, &Vector3::z());
        assert!((signed - 12.0).abs() < 1e-12 && (absolute - 12.0).abs() < 1e-12);
    }

    #[test]
    fn degenerate_polygons_give_all_their_triangles() {
        let line = flat(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [1.5, 0.0]]);
        assert_eq!(cut(&line).len(), 3);
        let bow_tie = flat(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]);
        assert_eq!(cut(&bow_tie).len(), 2);
        let nan = flat(&[[0.0, 0.0], [f64::NAN, 1.0], [1.0, 0.0], [0.0, 1.0]]);
        assert_eq!(cut(&nan).len(), 2);
        let many = vec![Point3::origin(); 100_000];
        assert_eq!(cut(&many).len(), 99_998);
        assert!(cut(&line[..2]).is_empty() && cut(&[]).is_empty());
    }

    #[test]
    fn an_exhausted_budget_only_stops_concave_polygons() {
        let dart = flat(&[[2.0, 1.0], [0.0, 2.0], [1.0, 1.0], [0.0, 0.0]]);
        let corners: Vec<u32> = (0..4).collect();
        let mut triangles = Vec::new();
        let mut budget = 0;
        assert!(!triangulate(&dart, &corners, &mut triangles, &mut budget));
        // A convex polygon costs nothing, regardless of its number of corners.
        let parabola: Vec<[f64; 2]> = (0..5000).map(f64::from).map(|x| [x, x * x]).collect();
        let corners: Vec<u32> = (0..5000).collect();
        triangles.clear();
        assert!(triangulate(
            &flat(&parabola),
            &corners,
            &mut triangles,
            &mut budget
        ));
        assert_eq!(triangles.len(), 4998);
        triangles.clear();
        // A comb: most of its corners become ears only late.
        let comb: Vec<[f64; 2]> = (0..1000)
            .map(|i| [f64::from(i), f64::from(i % 2) * 100.0])
            .chain([[1000.0, -1.0], [-1.0, -1.0]])
            .collect();
        let corners: Vec<u32> = (0..1002).rev().collect();
        let mut budget = CLIPPING_BUDGET;
        assert!(triangulate(
            &flat(&comb),
            &corners,
            &mut triangles,
            &mut budget
        ));
        assert_eq!(triangles.len(), 1000);
        let steps = CLIPPING_BUDGET - budget;
        assert!(steps > 0);
        let mut enough = steps + 1;
        assert!(triangulate(
            &flat(&comb),
            &corners,
            &mut triangles,
            &mut enough
        ));
        let mut too_few = steps / 2;
        assert!(!triangulate(
            &flat(&comb),
            &corners,
            &mut triangles,
            &mut too_few
        ));
    }

    #[test]
    fn a_concave_polygon_of_many_corners_is_covered_once() {
        let n = 2050;
        let star: Vec<[f64; 2]> = (0..n)
            .map(|i| {
                let angle = std::f64::consts::TAU * f64::from(i) / f64::from(n);
                let radius = if i % 2 == 0 { 1.0 } else { 0.5 };
                [radius * angle.cos(), radius * angle.sin()]
            })
            .collect();
        let vertices = flat(&star);
        let triangles = cut(&vertices);
        assert_eq!(triangles.len(), 2048);
        let (signed, absolute) = area(&vertices, &triangles, &Vector3::z());
        let expected = 0.25 * f64::from(n) * (std::f64::consts::TAU / f64::from(n)).sin();
        assert!((signed - expected).abs() < 1e-9 && (absolute - expected).abs() < 1e-9);
    }

    proptest! {
        /// Any orientation and any first corner must work.
        #[test]
        fn star_shaped_polygons_are_covered_once(
            radii in prop::collection::vec(0.2_f64..2.0, 4..40),
            turn in prop::array::uniform3(-3.0_f64..3.0),
        ) {
            let n = radii.len() as f64;
            let motion = Isometry3::new(Vector3::new(5.0, -3.0, 8.0), Vector3::from(turn));
            let vertices: Vec<Point3<f64>> = radii.iter().enumerate().map(|(i, r)| {
                let angle = std::f64::consts::TAU * i as f64 / n;
                motion * Point3::new(r * angle.cos(), r * angle.sin(), 0.0)
            }).collect();
            let expected: f64 = (0..radii.len()).map(|i| {
                0.5 * radii[i] * radii[(i + 1) % radii.len()] * (std::f64::consts::TAU / n).sin()
            }).sum();
            let triangles = cut(&vertices);
            prop_assert_eq!(triangles.len(), radii.len() - 2);
            let (signed, absolute) = area(&vertices, &triangles, &(motion * Vector3::z()));
            prop_assert!((signed - expected).abs() < 1e-9, "{} {}", signed, expected);
            prop_assert!((absolute - expected).abs() < 1e-9);
        }
    }
}

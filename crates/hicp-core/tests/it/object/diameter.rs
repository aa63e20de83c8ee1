//! Tests of the largest distance between two points, against all pairs.

use crate::support::Numbers;
use hicp_core::{Point3, diameter};
use proptest::prelude::*;

fn brute_force(points: &[Point3<f32>]) -> f64 {
    let mut best = 0.0_f64;
    for a in points {
        for b in points {
            best = best.max((a.cast::<f64>() - b.cast::<f64>()).norm());
        }
    }
    best
}

fn cloud() -> impl Strategy<Value = Vec<Point3<f32>>> {
    // Balls, boxes stretched a thousandfold, planes, lines, and duplicates, with coordinates on a
    // coarse grid.
    (
        0_usize..400,
        1_i32..60,
        [0.0_f32..10.0, 0.0..10.0, 0.0..10.0],
        0_u64..u64::MAX,
    )
        .prop_map(|(count, grid, scales, seed)| {
            let mut numbers = Numbers(seed);
            let scale = scales.map(|s| if s < 2.0 { 0.0 } else { 0.001 * s * s * s });
            (0..count)
                .map(|_| {
                    #[allow(clippy::cast_possible_truncation)]
                    Point3::from(
                        scale.map(|s| s * (numbers.normal() * f64::from(grid)).round() as f32),
                    )
                })
                .collect()
        })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(96) })]

    #[test]
    fn the_diameter_equals_that_of_brute_force(points in cloud()) {
        let (found, expected) = (diameter(&points), brute_force(&points));
        // The promised accuracy: a relative 1e-7, and never more than the true diameter.
        prop_assert!(found <= expected * (1.0 + 4.0 * f64::EPSILON));
        prop_assert!(found >= expected * (1.0 - 1.1e-7), "{} of {}", found, expected);
    }
}

#[test]
fn the_diameter_of_no_points_and_of_one_point_is_zero() {
    assert_eq!(diameter(&[]), 0.0);
    assert_eq!(diameter(&[Point3::new(1.0, 2.0, 3.0)]), 0.0);
    assert_eq!(diameter(&[Point3::new(1.0, 2.0, 3.0); 100]), 0.0);
    let unknown = [f32::NAN, f32::INFINITY].map(|x| Point3::new(0.0, x, 0.0));
    assert_eq!(diameter(&unknown), 0.0);
    let mut points = vec![Point3::origin(), Point3::new(0.0, 0.0, 2.0)];
    points.extend(unknown);
    assert_eq!(diameter(&points), 2.0);
}

/// On a sphere, nearly every point has a partner nearly at the diameter. Repeated steps to the
/// farthest point then end at a pair that is not the farthest of all.
#[test]
fn the_farthest_pair_is_found_among_many_nearly_as_far() {
    let mut numbers = Numbers(61);
    let mut misled = 0;
    for case in 0..200 {
        let radius = [0.02, 0.3, 40.0][case % 3];
        let mut points: Vec<Point3<f32>> = (0..20 + numbers.below(200))
            .map(|_| Point3::from((numbers.direction() * radius).map(|x| x as f32)))
            .collect();
        let expected = brute_force(&points);
        misled += usize::from(sweeps(&points) < expected * (1.0 - 1e-6));
        assert!((diameter(&points) - expected).abs() < 1.1e-7 * expected);
        // Duplicates of one of the two points do not change the result.
        let end = *points
            .iter()
            .max_by(|a, b| reach(&points, a).total_cmp(&reach(&points, b)))
            .unwrap();
        points.extend([end; 150]);
        assert!((diameter(&points) - expected).abs() < 1.1e-7 * expected);
    }
    assert!(misled > 50, "{misled}");
}

/// The distance from a point to the farthest one.
fn reach(points: &[Point3<f32>], from: &Point3<f32>) -> f64 {
    points
        .iter()
        .map(|p| (p.cast::<f64>() - from.cast::<f64>()).norm())
        .fold(0.0, f64::max)
}

/// The distance at which repeated steps to the farthest point end, from the first point on.
fn sweeps(points: &[Point3<f32>]) -> f64 {
    let (mut from, mut best) = (points[0], 0.0);
    loop {
        let far = |p: &Point3<f32>| (p.cast::<f64>() - from.cast::<f64>()).norm();
        let farthest = *points
            .iter()
            .max_by(|a, b| far(a).total_cmp(&far(b)))
            .unwrap();
        if far(&farthest) <= best {
            return best;
        }
        best = far(&farthest);
        from = farthest;
    }
}

/// As many points as in a scanned mesh; comparing all pairs would take 5e11 steps.
#[test]
fn a_million_points_on_a_surface_are_fast() {
    let axes = [0.05_f64, 0.04, 0.03];
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let count = 1_000_000;
    let points: Vec<Point3<f32>> = (0..count)
        .map(|i| {
            // They include both ends of the first axis.
            let along = 1.0 - 2.0 * f64::from(i) / f64::from(count - 1);
            let across = (1.0 - along * along).sqrt();
            let (sin, cos) = (f64::from(i) * golden).sin_cos();
            let [a, b, c] = axes;
            Point3::new(a * along, b * across * cos, c * across * sin).map(|x| x as f32)
        })
        .collect();
    let expected = 2.0 * f64::from(0.05_f32);
    let found = diameter(&points);
    assert!((found - expected).abs() < 1.1e-7 * expected, "{found}");
}

//! Tests of the closed form of point-to-point: exact, always a rotation, and the best one.

use crate::pairs::{determinant, images, loss, pair, rms, rounding};
use crate::scenes::AtStart;
use crate::support::Numbers;
use hicp_core::{Correspondences, Isometry3, Pair, Point3, Vector3, Vector6, se3};
use hicp_metric::{ErrorMetric, NormalEquations, PointToPoint};

/// The provided Gauss–Newton step with the rows of point-to-point.
#[derive(Debug)]
struct Iterative;

impl ErrorMetric for Iterative {
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        PointToPoint.linearize(pair, system);
    }
}

fn cloud(numbers: &mut Numbers, count: usize, size: [f64; 3]) -> Vec<Point3<f64>> {
    (0..count)
        .map(|_| Point3::from(numbers.vector().component_mul(&Vector3::from(size))))
        .collect()
}

fn noisy(numbers: &mut Numbers, pairs: &mut Correspondences, sigma: f64) {
    for pair in pairs.as_mut_slice() {
        pair.target.point += (numbers.vector() * sigma).cast::<f32>();
    }
}

fn moved(pairs: &Correspondences, motion: &Isometry3<f64>) -> Correspondences {
    let mut moved = pairs.clone();
    for pair in moved.as_mut_slice() {
        pair.source.point = (motion * pair.source.point.cast::<f64>()).cast();
    }
    moved
}

#[test]
fn exact_pairs_are_aligned_in_one_step_up_to_rounding() {
    let mut numbers = Numbers(101);
    for shape in [
        [0.05, 0.05, 0.05],
        [0.05, 0.03, 0.0],
        [0.05, 0.001, 0.0],
        [0.05, 0.0, 0.0],
    ] {
        for count in [3, 4, 10, 300] {
            for _ in 0..10 {
                let motion = numbers.pose(0.3);
                let turn = Isometry3::from_parts(Vector3::zeros().into(), numbers.rotation());
                let points: Vec<_> = cloud(&mut numbers, count, shape)
                    .iter()
                    .map(|p| turn * p)
                    .collect();
                let pairs = images(&points, &motion);
                let step = PointToPoint.step(&pairs).unwrap();
                // The true motion leaves the roundings of both points. The best motion cannot leave
                // more.
                let bound = 2.0 * rounding(&pairs);
                assert!(rms(&pairs, &step.increment) <= bound, "{shape:?} {count}");
                assert!((determinant(&step.increment) - 1.0).abs() < 1e-14);
                let before = loss(&pairs, &Isometry3::identity());
                assert!((step.mean_loss - before).abs() <= 1e-12 * before);
            }
        }
    }
}

/// The sums over points equal the sums over rows, for all kinds of weights.
#[test]
fn the_system_equals_that_of_its_rows() {
    let mut numbers = Numbers(117);
    for count in [1, 2, 31, 32, 33, 500] {
        let motion = numbers.pose(0.02);
        let mut pairs = images(&cloud(&mut numbers, count, [0.05, 0.03, 0.04]), &motion);
        noisy(&mut numbers, &mut pairs, 0.002);
        for (index, pair) in pairs.as_mut_slice().iter_mut().enumerate() {
            pair.source.point.z += 0.7;
            pair.target.point.z += 0.7;
            pair.weight = [1.0, 0.25, 3.0, 0.0][index % 4];
        }
        let (found, expected) = (
            PointToPoint.normal_equations(&pairs),
            Iterative.normal_equations(&pairs),
        );
        let (found, expected) = (found.unwrap(), expected.unwrap());
        assert_eq!(found.rows(), expected.rows());
        assert!((found.pivot() - expected.pivot()).norm() < 1e-13);
        assert!((found.length() - expected.length()).abs() < 1e-13);
        assert!((found.loss() - expected.loss()).abs() <= 1e-12 * expected.loss());
        let (ours, theirs) = (found.information(), expected.information());
        assert!((ours - theirs).amax() <= 1e-12 * theirs.amax());
        let (ours, theirs) = (found.solve(), expected.solve());
        assert_eq!(ours.is_some(), theirs.is_some());
        if let (Some(ours), Some(theirs)) = (ours, theirs) {
            let difference = ours.to_homogeneous() - theirs.to_homogeneous();
            assert!(difference.amax() < 1e-10, "{count}: {difference}");
        }
    }
}

#[test]
fn random_motions_are_recovered() {
    let mut numbers = Numbers(102);
    for _ in 0..200 {
        let motion = numbers.pose(0.3);
        let points = cloud(&mut numbers, 200, [0.05, 0.05, 0.05]);
        let pairs = images(&points, &motion);
        let found = PointToPoint.step(&pairs).unwrap().increment;
        let (angle, _) = se3::pose_distance(&found, &motion);
        // Points are 5 cm from the centroid and off by one rounding each: at most rounding / 5 cm
        // in the worst case.
        assert!(angle <= 2.0 * rounding(&pairs) / 0.05, "{angle}");
        let center = Point3::from(points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / 200.0);
        assert!((found * center - motion * center).norm() <= 2.0 * rounding(&pairs));
    }
}

/// Collinear points are aligned without a rotation around their line, also in opposite directions.
#[test]
fn pitfall_12_collinear_points_are_mapped_onto_their_targets_by_the_smallest_rotation() {
    let mut numbers = Numbers(103);
    for angle in [
        0.0,
        1e-7,
        1e-3,
        1.0,
        3.0,
        std::f64::consts::PI - 1e-7,
        std::f64::consts::PI,
    ] {
        for _ in 0..20 {
            let line = numbers.direction();
            // A rotation around an axis orthogonal to the line is the smallest one with this
            // result.
            let axis = line.cross(&numbers.direction()).normalize();
            let motion = Isometry3::new(numbers.vector(), axis * angle);
            let points: Vec<_> = (-3..=3)
                .map(|i| Point3::from(line * (0.02 * f64::from(i))))
                .collect();
            let pairs = images(&points, &motion);
            let found = PointToPoint.step(&pairs).unwrap().increment;
            assert!(rms(&pairs, &found) <= 2.0 * rounding(&pairs), "{angle}");
            assert!((determinant(&found) - 1.0).abs() < 1e-14);
            let (turned, _) = se3::pose_distance(&found, &Isometry3::identity());
            // RMS radius 4 cm; rounding of coordinates of a few meters.
            assert!(
                (turned - angle).abs() <= 2.0 * rounding(&pairs) / 0.04,
                "{turned} {angle}"
            );
        }
    }
}

#[test]
fn pitfall_18_planar_points_and_noise_never_give_a_reflection() {
    let mut numbers = Numbers(104);
    for sigma in [0.0, 1e-4, 0.01, 0.1] {
        for _ in 0..200 {
            let points = cloud(&mut numbers, 6, [0.05, 0.05, 0.0]);
            let mut pairs = images(&points, &numbers.pose(0.3));
            noisy(&mut numbers, &mut pairs, sigma);
            let found = PointToPoint.step(&pairs).unwrap().increment;
            assert!((determinant(&found) - 1.0).abs() < 1e-14);
        }
    }
}

#[test]
fn a_mirror_image_gives_the_best_rotation() {
    let mut numbers = Numbers(105);
    for _ in 0..50 {
        let points = cloud(&mut numbers, 40, [0.05, 0.03, 0.01]);
        let turn = numbers.rotation();
        let pairs: Correspondences = points
            .iter()
            .map(|p| pair(*p, turn * Point3::new(p.x, p.y, -p.z), Vector3::z(), 1.0))
            .collect();
        let found = PointToPoint.step(&pairs).unwrap().increment;
        assert!((determinant(&found) - 1.0).abs() < 1e-14);
        assert_no_better_neighbor(&mut numbers, &pairs, &found, 0.02);
    }
}

/// Checks that small rotations and translations in every direction raise the loss.
fn assert_no_better_neighbor(
    numbers: &mut Numbers,
    pairs: &Correspondences,
    found: &Isometry3<f64>,
    size: f64,
) {
    let best = loss(pairs, found);
    let sources = pairs
        .as_slice()
        .iter()
        .map(|p| p.source.point.coords.cast::<f64>());
    let center = found * Point3::from(sources.sum::<Vector3<f64>>() / pairs.len() as f64);
    for _ in 0..30 {
        for scale in [1e-4, 1e-2, 1.0] {
            let (shift, turn) = (
                numbers.direction() * size * scale,
                numbers.direction() * scale,
            );
            let twist = Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z);
            let about_center =
                Isometry3::from_parts(center.coords.into(), hicp_core::UnitQuaternion::identity());
            let nudged = about_center * se3::exp(&twist) * about_center.inverse() * found;
            // Loss sums are exact to a few ε of their value.
            assert!(
                loss(pairs, &nudged) >= best * (1.0 - 1e-12),
                "scale {scale}"
            );
        }
    }
}

#[test]
fn no_perturbation_lowers_the_loss() {
    let mut numbers = Numbers(106);
    for shape in [
        [0.05, 0.05, 0.05],
        [0.05, 0.02, 0.0],
        [0.05, 1e-3, 1e-3],
        [0.05, 1e-5, 1e-6],
    ] {
        for sigma in [1e-6, 1e-3, 0.05] {
            for _ in 0..10 {
                let points = cloud(&mut numbers, 30, shape);
                let mut pairs = images(&points, &numbers.pose(0.3));
                noisy(&mut numbers, &mut pairs, sigma);
                for pair in pairs.as_mut_slice() {
                    pair.weight = numbers.between(0.1, 2.0) as f32;
                }
                let found = PointToPoint.step(&pairs).unwrap().increment;
                assert_no_better_neighbor(&mut numbers, &pairs, &found, 0.05);
            }
        }
    }
}

/// A rod a million times as long as thick is still not a line.
///
/// In f64, its rotation around itself is determined.
#[test]
fn thin_rods_determine_their_rotation() {
    let mut numbers = Numbers(107);
    for ratio in [1e-2_f64, 1e-3, 1e-4, 5e-5] {
        for _ in 0..20 {
            // Coordinates that f32 holds exactly, rotated around their line by a quarter turn,
            // which is exact, too.
            let exact = |x: f64| f64::from(x as f32);
            let points: Vec<_> = (0..40)
                .map(|_| {
                    let p = numbers.vector();
                    Point3::new(exact(p.x), exact(ratio * p.y), exact(0.3 * ratio * p.z))
                })
                .collect();
            let pairs: Correspondences = points
                .iter()
                .map(|p| pair(*p, Point3::new(p.x, -p.z, p.y), Vector3::z(), 1.0))
                .collect();
            let found = PointToPoint.step(&pairs).unwrap().increment;
            let (angle, _) = se3::pose_distance(
                &found,
                &Isometry3::rotation(Vector3::x() * std::f64::consts::FRAC_PI_2),
            );
            // The covariance is exact to ε of its largest entry. Across the rod it is ratio² of
            // that.
            let bound = 100.0 * f64::EPSILON / (0.3 * ratio * ratio);
            assert!(angle < bound, "ratio {ratio}: {angle}, bound {bound}");
        }
    }
}

#[test]
fn the_closed_form_is_the_fixed_point_of_gauss_newton() {
    let mut numbers = Numbers(108);
    for _ in 0..50 {
        let points = cloud(&mut numbers, 50, [0.05, 0.04, 0.02]);
        let turn = numbers.direction() * 0.4;
        let mut pairs = images(&points, &Isometry3::new(numbers.vector() * 0.1, turn));
        noisy(&mut numbers, &mut pairs, 0.003);
        let closed = PointToPoint.step(&pairs).unwrap().increment;
        let mut walked = Isometry3::identity();
        for _ in 0..30 {
            walked = Iterative.step(&moved(&pairs, &walked)).unwrap().increment * walked;
        }
        let (angle, _) = se3::pose_distance(&closed, &walked);
        // Every step rounds the moved points to f32.
        assert!(angle <= 2.0 * rounding(&pairs) / 0.02, "{angle}");
        assert!((rms(&pairs, &walked) - rms(&pairs, &closed)).abs() <= rounding(&pairs));
    }
}

//! Tests of every metric against its definition: squared errors, Jacobians, invariance.

use std::f64::consts::PI;

use crate::scenes::{
    AtStart, Numbers, carried, center, check_rows, difference, messy, same_information,
};
use hicp_core::Iteration;
use hicp_core::{Correspondences, Isometry3, Matrix3, Pair, Point3, Vector3, se3};
use hicp_metric::Minimize;
use hicp_metric::{
    ErrorMetric, Generalized, Kernel, PlaneToPoint, PointToPlane, PointToPoint, Robust, Scale,
    Symmetric, WeightedSum,
};

fn points(pair: &Pair) -> (Point3<f64>, Point3<f64>) {
    (pair.source.point.cast(), pair.target.point.cast())
}

fn normals(pair: &Pair) -> (Vector3<f64>, Vector3<f64>) {
    (
        pair.source.normal.cast().into_inner(),
        pair.target.normal.cast().into_inner(),
    )
}

fn point_to_plane(pair: &Pair, t: &Isometry3<f64>) -> f64 {
    let ((p, c), (_, n)) = (points(pair), normals(pair));
    n.dot(&(t * p - c)).powi(2)
}

fn plane_to_point(pair: &Pair, t: &Isometry3<f64>) -> f64 {
    let ((p, c), (m, _)) = (points(pair), normals(pair));
    (t.rotation * m).dot(&(t * p - c)).powi(2)
}

fn symmetric(pair: &Pair, t: &Isometry3<f64>) -> f64 {
    let ((p, c), (m, n)) = (points(pair), normals(pair));
    let half = se3::exp(&(se3::log(t) * 0.5));
    ((m + n) * 0.5)
        .dot(&(half * p - half.inverse() * c))
        .powi(2)
}

fn generalized(epsilon: f64, pair: &Pair, t: &Isometry3<f64>) -> f64 {
    let ((p, c), (m, n)) = (points(pair), normals(pair));
    let disc = |n: Vector3<f64>| {
        let n = n.normalize();
        Matrix3::identity() - n * n.transpose() * (1.0 - epsilon)
    };
    let d = t * p - c;
    d.dot(&((disc(n) + disc(m)).try_inverse().unwrap() * d))
}

#[test]
fn squared_errors_and_jacobians_equal_the_definitions() {
    let mut numbers = Numbers(11);
    let gicp = Generalized { epsilon: 0.01 };
    for pair in messy(&mut numbers, 40).as_slice() {
        check_rows(&PointToPlane, pair, |t| point_to_plane(pair, t), 1e-6);
        check_rows(&PlaneToPoint, pair, |t| plane_to_point(pair, t), 1e-6);
        check_rows(&Symmetric, pair, |t| symmetric(pair, t), 1e-6);
        check_rows(&gicp, pair, |t| generalized(0.01, pair, t), 1e-6);
        let (p, c) = points(pair);
        check_rows(&PointToPoint, pair, |t| (t * p - c).norm_squared(), 1e-6);
    }
}

#[test]
fn generalized_accepts_parallel_opposite_and_other_normals() {
    let mut numbers = Numbers(12);
    let base = messy(&mut numbers, 1).as_slice()[0];
    for angle in [
        0.0,
        1e-9,
        1e-6,
        9e-5,
        1.1e-4,
        1e-3,
        1.0,
        3.0,
        PI - 1e-3,
        PI - 1e-7,
        PI,
    ] {
        let mut pair = base;
        let normal = numbers.direction();
        let across = normal.cross(&numbers.direction()).normalize();
        let turn = Isometry3::new(Vector3::zeros(), across * angle);
        pair.target = crate::scenes::surfel(pair.target.point.cast(), normal);
        let turned = turn.rotation * pair.target.normal.cast::<f64>().into_inner();
        pair.source = crate::scenes::surfel(pair.source.point.cast(), turned);
        for epsilon in [1e-4, 1e-3, 0.1, 1.0] {
            let expected = generalized(epsilon, &pair, &Isometry3::identity());
            let found = Generalized { epsilon }.squared_error(&pair);
            assert!(
                (found - expected).abs() <= 1e-5 * expected,
                "{angle} {epsilon}"
            );
        }
    }
    // Opposite to the bit.
    let mut pair = base;
    pair.source.normal = -pair.target.normal;
    let expected = generalized(1e-3, &pair, &Isometry3::identity());
    let found = Generalized::default().squared_error(&pair);
    assert!((found - expected).abs() <= 1e-5 * expected);
}

fn metrics() -> Vec<Box<dyn Minimize>> {
    vec![
        Box::new(PointToPoint),
        Box::new(PointToPlane),
        Box::new(PlaneToPoint),
        Box::new(Symmetric),
        Box::new(Generalized::default()),
        Box::new(WeightedSum {
            terms: ((1.0, PointToPlane), (0.1, PointToPoint), (0.5, Symmetric)),
        }),
        Box::new(WeightedSum {
            terms: vec![(1.0, PointToPlane), (0.5, PointToPlane)],
        }),
    ]
}

/// Moving both clouds transforms the step to S T S⁻¹ and keeps the loss.
#[test]
fn a_common_rigid_motion_only_transforms_the_step() {
    let mut numbers = Numbers(13);
    for _ in 0..10 {
        let pairs = messy(&mut numbers, 60);
        let motion = numbers.motion(&center(), 70.0, 0.2);
        let moved = carried(&pairs, &motion);
        for mut metric in metrics() {
            let here = metric.step(&pairs).unwrap();
            let there = metric.step(&moved).unwrap();
            let expected = motion * here.increment * motion.inverse();
            let (angle, _) = se3::pose_distance(&there.increment, &expected);
            // Points at about 0.8 m are rounded to f32: 5e-8 m at 5 cm. The weights of GICP amplify
            // that by up to 1/√ε.
            assert!(angle < 1e-4, "{}: {angle}", metric.label());
            let (a, b) = (here.mean_loss, there.mean_loss);
            assert!((a - b).abs() < 1e-3 * a, "{}: {a} {b}", metric.label());
        }
    }
}

#[test]
fn mean_loss_minimize_and_system_agree() {
    let mut numbers = Numbers(15);
    let pairs = messy(&mut numbers, 60);
    let weight: f64 = pairs.as_slice().iter().map(|p| f64::from(p.weight)).sum();
    for mut metric in metrics() {
        let step = metric.step(&pairs).unwrap();
        let mean = metric.loss(&pairs).unwrap();
        let system = metric.normal_equations(&pairs).unwrap();
        let mut errors = vec![0.0; pairs.len()];
        metric.add_squared_errors(&Iteration::default(), &pairs, 1.0, &mut errors);
        let by_pair: f64 = pairs
            .as_slice()
            .iter()
            .zip(errors)
            .map(|(p, error)| f64::from(p.weight) * error)
            .sum();
        for found in [step.mean_loss, system.loss() / weight, by_pair / weight] {
            assert!((found - mean).abs() <= 1e-12 * mean, "{}", metric.label());
        }
    }
}

/// A sum would fall if pairs are lost, and rise if pairs are found.
#[test]
fn the_loss_is_a_mean_and_does_not_depend_on_the_number_of_pairs() {
    let mut numbers = Numbers(19);
    let pairs = messy(&mut numbers, 40);
    let mut thrice = pairs.clone();
    thrice.extend(pairs.as_slice().iter().copied());
    thrice.extend(pairs.as_slice().iter().copied());
    for mut metric in metrics() {
        let (once, more) = (
            metric.step(&pairs).unwrap().mean_loss,
            metric.step(&thrice).unwrap().mean_loss,
        );
        assert!((once - more).abs() < 1e-12 * once, "{}", metric.label());
        let more = metric.loss(&thrice).unwrap();
        assert!((once - more).abs() < 1e-12 * once, "{}", metric.label());
    }
}

/// No pair, one pair, pairs at one place, and pairs without weight give a finite step or none.
#[test]
fn few_and_coincident_pairs_give_finite_steps_or_none() {
    let mut numbers = Numbers(16);
    let many = messy(&mut numbers, 20);
    let first = many.as_slice()[0];
    let mut weightless = many.clone();
    for pair in weightless.as_mut_slice() {
        pair.weight = 0.0;
    }
    let sets = [
        std::iter::empty().collect(),
        [first].into_iter().collect(),
        [first; 2].into_iter().collect(),
        [first; 30].into_iter().collect(),
        many.as_slice()[..5].iter().copied().collect(),
        weightless,
    ];
    for mut metric in metrics() {
        for (i, pairs) in sets.iter().enumerate() {
            let step = metric.step(pairs);
            if let Some(step) = step {
                assert!(se3::is_finite(&step.increment) && step.mean_loss.is_finite());
                assert!(difference(&step.increment, &Isometry3::identity()).1 < 0.1);
            }
            assert!(i != 0 && i != 5 || step.is_none(), "{}", metric.label());
        }
    }
}

/// Without weight, with invalid weights, and with points that are not finite, there is neither a
/// mean nor a system.
#[test]
fn inputs_that_are_not_finite_have_no_loss() {
    let mut numbers = Numbers(20);
    let pairs = messy(&mut numbers, 20);
    let mut wrong: Vec<Correspondences> = Vec::new();
    for weight in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let mut pairs = pairs.clone();
        pairs
            .as_mut_slice()
            .iter_mut()
            .for_each(|p| p.weight = weight);
        wrong.push(pairs);
    }
    // The weights cancel.
    let mut cancelling = pairs.clone();
    for (i, pair) in cancelling.as_mut_slice().iter_mut().enumerate() {
        pair.weight = [1.0, -1.0][i % 2];
    }
    wrong.push(cancelling);
    for bad in [f32::NAN, f32::INFINITY] {
        for axis in 0..3 {
            for index in [0, 13] {
                let (mut source, mut target) = (pairs.clone(), pairs.clone());
                source.as_mut_slice()[index].source.point[axis] = bad;
                target.as_mut_slice()[index].target.point[axis] = bad;
                wrong.extend([source, target]);
            }
        }
    }
    let mut all = metrics();
    all.push(Box::new(Robust::new(
        PointToPoint,
        Kernel::FAIR,
        Scale::Meters(0.01),
    )));
    for metric in &mut all {
        for (i, pairs) in wrong.iter().enumerate() {
            let name = metric.label();
            assert_eq!(metric.loss(pairs), None, "{name} {i}");
            assert_eq!(metric.step(pairs), None, "{name} {i}");
            assert!(metric.normal_equations(pairs).is_none(), "{name} {i}");
        }
    }
}

#[test]
fn a_sum_is_the_sum_of_its_systems() {
    let mut numbers = Numbers(18);
    let pairs = messy(&mut numbers, 60);
    let mut sum = WeightedSum {
        terms: (
            (0.7, PointToPlane),
            (0.3, Symmetric),
            (0.0, PointToPoint),
            (0.0, PointToPoint),
        ),
    };
    let whole = sum.normal_equations(&pairs).unwrap();
    let plane = PointToPlane.normal_equations(&pairs).unwrap();
    let symmetric = Symmetric.normal_equations(&pairs).unwrap();
    let expected = plane.information() * 0.7 + symmetric.information() * 0.3;
    assert!((whole.information() - expected).amax() < 1e-12 * expected.amax());
    assert_eq!(whole.rows(), plane.rows() + symmetric.rows());
    // One term with factor 1 equals that term.
    let mut alone = WeightedSum {
        terms: ((1.0, PointToPlane),),
    };
    assert_eq!(
        alone.step(&pairs).unwrap().increment,
        PointToPlane.step(&pairs).unwrap().increment
    );
    // Systems with other pivots and lengths merge into the same information.
    let mut elsewhere = hicp_metric::NormalEquations::new(Point3::new(1.0, 2.0, -1.0), 0.7);
    elsewhere.merge(&plane, 1.0);
    assert!(same_information(&elsewhere, &plane, 1e-12));
    assert!((elsewhere.gradient() - plane.gradient()).amax() < 1e-12 * plane.gradient().amax());
}

#[test]
fn a_little_point_to_point_keeps_a_plane_from_sliding() {
    let mut numbers = Numbers(19);
    let source: Vec<_> = (0..200)
        .map(|_| {
            let offset = Vector3::new(numbers.sign() * 0.1, numbers.sign() * 0.1, 0.0);
            crate::scenes::surfel(center() + offset, -Vector3::z())
        })
        .collect();
    let motion = Isometry3::translation(0.01, -0.02, 0.005);
    let pairs = crate::scenes::exact(&source, &motion);
    let mut sum = WeightedSum {
        terms: ((1.0, PointToPlane), (0.1, PointToPoint)),
    };
    let step = sum.step(&pairs).unwrap();
    let (angle, distance) = difference(&step.increment, &motion);
    assert!(angle < 1e-6 && distance < 1e-6, "{angle} {distance}");
}

//! Tests of the symmetric metric: exact in one step, with skipped pairs.

use crate::scenes::{
    AtStart, Numbers, advanced, center, difference, ellipsoid, exact, messy, surfel,
};
use hicp_core::{Correspondences, Isometry3, Matrix6, Pair, Vector3, Vector6, so3};
use hicp_metric::{ErrorMetric, NO_ROWS, PointToPlane, Symmetric};

#[test]
fn exact_pairs_are_aligned_in_one_step() {
    let mut numbers = Numbers(21);
    for degrees in [0.0, 0.1, 5.0, 15.0, 30.0, 60.0] {
        for _ in 0..10 {
            let source = ellipsoid(&mut numbers, 300);
            let motion = numbers.motion(&center(), degrees, 0.05);
            let pairs = exact(&source, &motion);
            let step = Symmetric.step(&pairs).unwrap();
            let (angle, distance) = difference(&step.increment, &motion);
            // Points are rounded to f32 at 0.6 m: 3e-8 m against 5 cm.
            assert!(
                angle < 2e-6 && distance < 2e-7,
                "{degrees}: {angle} {distance}"
            );
        }
    }
    // Point-to-plane is not exact, which is the difference to this metric.
    let source = ellipsoid(&mut numbers, 300);
    let motion = numbers.motion(&center(), 30.0, 0.0);
    let linear = PointToPlane.step(&exact(&source, &motion)).unwrap();
    assert!(difference(&linear.increment, &motion).0 > 0.01);
}

#[test]
fn weights_count_and_the_minimum_is_that_of_its_rows() {
    let mut numbers = Numbers(22);
    let mut pairs = messy(&mut numbers, 200);
    // Repeated steps converge to a zero gradient of the linearized rows, up to terms of the
    // residuals.
    for _ in 0..30 {
        let step = Symmetric.step(&pairs).unwrap();
        pairs = advanced(&pairs, &step.increment);
    }
    let system = Symmetric.normal_equations(&pairs).unwrap();
    let rest = system.solve().unwrap();
    let (angle, distance) = difference(&rest, &Isometry3::identity());
    assert!(angle < 5e-3 && distance < 3e-4, "{angle} {distance}");
    // A pair of weight zero does not count.
    let mut with = messy(&mut numbers, 50);
    let without: Correspondences = with.as_slice()[..40].iter().copied().collect();
    for pair in &mut with.as_mut_slice()[40..] {
        pair.weight = 0.0;
    }
    let (a, b) = (
        Symmetric.step(&with).unwrap(),
        Symmetric.step(&without).unwrap(),
    );
    assert!((a.mean_loss - b.mean_loss).abs() < 1e-15);
    assert!(difference(&a.increment, &b.increment).0 < 1e-12);
}

#[test]
fn pairs_of_different_sides_are_skipped() {
    let mut numbers = Numbers(23);
    let pairs = messy(&mut numbers, 60);
    let mut more = pairs.clone();
    for _ in 0..20 {
        let mut wrong = pairs.as_slice()[0];
        wrong.target = surfel(
            center() + numbers.signs(),
            -wrong.source.normal.cast::<f64>().into_inner(),
        );
        assert_eq!(Symmetric.squared_error(&wrong).to_bits(), NO_ROWS.to_bits());
        more.push(wrong);
    }
    assert_eq!(Symmetric.step(&more), Symmetric.step(&pairs));
    assert_eq!(Symmetric.loss(&more), Symmetric.loss(&pairs));
    // Perpendicular ones are skipped, too. If nothing else is left, there is no step.
    let source = surfel(center(), Vector3::x());
    let across = Pair::new(0, source, 0, surfel(center(), Vector3::y()));
    let only: Correspondences = [across; 20].into_iter().collect();
    assert_eq!(Symmetric.step(&only), None);
    assert_eq!(Symmetric.loss(&only), None);
}

#[test]
fn a_plane_approaches_without_sliding() {
    let mut numbers = Numbers(24);
    let source: Vec<_> = (0..200)
        .map(|_| {
            let offset = Vector3::new(numbers.sign() * 0.1, numbers.sign() * 0.1, 0.0);
            surfel(center() + offset, -Vector3::z())
        })
        .collect();
    // The counterparts are elsewhere on the plane: point pairs would slide by 4 cm.
    let pairs = exact(&source, &Isometry3::translation(0.04, 0.0, 0.005));
    let step = Symmetric.step(&pairs).unwrap();
    let expected = Isometry3::translation(0.0, 0.0, 0.005);
    let (angle, distance) = difference(&step.increment, &expected);
    assert!(angle < 1e-6 && distance < 1e-7, "{angle} {distance}");
}

/// Solves the documented linear problem by brute force and returns the documented motion.
fn by_formula(pairs: &Correspondences) -> Isometry3<f64> {
    let ends = |pair: &Pair| {
        let (p, q) = (
            pair.source.point.cast::<f64>(),
            pair.target.point.cast::<f64>(),
        );
        (p.coords, q.coords)
    };
    let weight = |pair: &Pair| f64::from(pair.weight);
    let total: f64 = pairs.as_slice().iter().map(weight).sum();
    let (mut source, mut target) = (Vector3::zeros(), Vector3::zeros());
    for pair in pairs.as_slice() {
        let (p, q) = ends(pair);
        source += p * (weight(pair) / total);
        target += q * (weight(pair) / total);
    }
    let (mut hessian, mut gradient) = (Matrix6::zeros(), Vector6::zeros());
    for pair in pairs.as_slice() {
        let (p, q) = ends(pair);
        let (p, q) = (p - source, q - target);
        let normals = [pair.source.normal, pair.target.normal];
        let n = normals
            .map(|n| n.cast::<f64>().into_inner() * 0.5)
            .iter()
            .sum::<Vector3<f64>>();
        let lever = (p + q).cross(&n);
        let row = Vector6::new(lever.x, lever.y, lever.z, n.x, n.y, n.z);
        hessian += row * row.transpose() * weight(pair);
        gradient += row * (weight(pair) * (p - q).dot(&n));
    }
    let solution = -hessian.try_inverse().unwrap() * gradient;
    let (a, shift) = (
        solution.fixed_rows::<3>(0).into_owned(),
        solution.fixed_rows::<3>(3).into_owned(),
    );
    let angle = a.norm().atan();
    let half = Isometry3::from_parts(Vector3::zeros().into(), so3::exp(&(a.normalize() * angle)));
    let translation = |v: Vector3<f64>| Isometry3::translation(v.x, v.y, v.z);
    translation(target) * half * translation(shift * angle.cos()) * half * translation(-source)
}

#[test]
fn the_step_is_the_documented_one_also_for_wrong_pairs() {
    let mut numbers = Numbers(25);
    for degrees in [1.0, 30.0, 60.0] {
        let pairs = messy(&mut numbers, 60);
        let motion = numbers.motion(&center(), degrees, 0.03);
        let pairs = advanced(&pairs, &motion);
        let counting: Correspondences = pairs
            .as_slice()
            .iter()
            .filter(|pair| pair.source.normal.dot(&pair.target.normal) > 0.0)
            .copied()
            .collect();
        let found = Symmetric.step(&pairs).unwrap().increment;
        let (angle, distance) = difference(&found, &by_formula(&counting));
        assert!(
            angle < 1e-9 && distance < 1e-10,
            "{degrees}: {angle} {distance}"
        );
    }
}

/// A direction with a ten-thousandth of the information of the others is exact, too: only
/// undetermined ones are damped.
#[test]
fn a_weak_direction_is_not_an_undetermined_one() {
    let mut numbers = Numbers(26);
    let sides = [Vector3::x(), Vector3::y(), -Vector3::x(), -Vector3::y()];
    let (mut source, mut weights) = (Vec::new(), Vec::new());
    for i in 0..240 {
        let offset = Vector3::new(numbers.sign(), numbers.sign(), 0.0) * 0.1;
        let side = i % 6 == 0;
        let normal = if side {
            sides[i / 6 % 4]
        } else {
            -Vector3::z()
        };
        source.push(surfel(center() + offset, normal));
        weights.push(if side { 3e-4 } else { 1.0 });
    }
    for degrees in [0.0, 10.0, 40.0] {
        let motion = numbers.motion(&center(), degrees, 0.05);
        let mut pairs = exact(&source, &motion);
        for (pair, weight) in pairs.as_mut_slice().iter_mut().zip(&weights) {
            pair.weight = *weight;
        }
        let step = Symmetric.step(&pairs).unwrap();
        let (angle, distance) = difference(&step.increment, &motion);
        assert!(
            angle < 1e-5 && distance < 1e-6,
            "{degrees}: {angle} {distance}"
        );
    }
}

#[test]
fn fitting_pairs_do_not_move_and_fewer_than_six_give_no_step() {
    let mut numbers = Numbers(27);
    let fitting = exact(&ellipsoid(&mut numbers, 50), &Isometry3::identity());
    let step = Symmetric.step(&fitting).unwrap();
    assert_eq!(step.mean_loss, 0.0);
    assert_eq!(difference(&step.increment, &Isometry3::identity()).0, 0.0);
    let pairs = messy(&mut numbers, 7);
    let first = |n: usize| -> Correspondences { pairs.as_slice()[..n].iter().copied().collect() };
    for n in 0..6 {
        assert_eq!(Symmetric.step(&first(n)), None, "{n}");
    }
    assert!(Symmetric.step(&first(6)).is_some());
    // A pair without weight, or seen from the other side, does not count.
    let mut five = pairs.clone();
    five.as_mut_slice()[1].weight = 0.0;
    five.as_mut_slice()[4].target.normal = -five.as_slice()[4].source.normal;
    assert_eq!(Symmetric.step(&five), None);
}

//! Tests of Generalized ICP and its special cases.

use crate::scenes::{
    AtStart, Numbers, center, difference, ellipsoid, exact, messy, same_information,
};
use hicp_metric::{ErrorMetric, GaussNewton, Generalized, PointToPlane, PointToPoint};

#[test]
fn epsilon_one_is_half_of_point_to_point() {
    let mut numbers = Numbers(31);
    let pairs = messy(&mut numbers, 80);
    let mut spheres = Generalized { epsilon: 1.0 };
    for pair in pairs.as_slice() {
        let (half, whole) = (
            spheres.squared_error(pair),
            PointToPoint.squared_error(pair),
        );
        assert!((2.0 * half - whole).abs() < 1e-12 * whole);
    }
    let (a, b) = (
        spheres.normal_equations(&pairs).unwrap(),
        PointToPoint.normal_equations(&pairs).unwrap(),
    );
    assert!((a.information() * 2.0 - b.information()).amax() < 1e-12 * b.information().amax());
    let (angle, distance) = difference(&a.solve().unwrap(), &b.solve().unwrap());
    assert!(angle < 1e-12 && distance < 1e-12);
}

#[test]
fn epsilon_near_zero_is_point_to_plane_if_normals_agree() {
    let mut numbers = Numbers(32);
    let mut pairs = messy(&mut numbers, 80);
    for pair in pairs.as_mut_slice() {
        pair.source.normal = pair.target.normal;
    }
    let plane = PointToPlane.step(&pairs).unwrap().increment;
    let mut last = f64::INFINITY;
    for epsilon in [1e-1, 1e-2, 1e-3, 1e-4, 1e-5] {
        let found = Generalized { epsilon }.step(&pairs).unwrap().increment;
        let (angle, _) = difference(&found, &plane);
        assert!(angle < 0.3 * last, "{epsilon}: {angle}");
        last = angle;
        // ½ |tangential|² + normal²/(2ε)
        for pair in pairs.as_slice() {
            let (point, normal) = (
                PointToPoint.squared_error(pair),
                PointToPlane.squared_error(pair),
            );
            let expected = 0.5 * (point - normal) + normal / (2.0 * epsilon);
            let error = Generalized { epsilon }.squared_error(pair);
            assert!((error - expected).abs() < 1e-6 * expected);
        }
    }
    assert!(last < 1e-4);
}

#[test]
fn the_orientation_of_normals_does_not_matter() {
    let mut numbers = Numbers(33);
    let pairs = messy(&mut numbers, 80);
    let mut flipped = pairs.clone();
    for pair in flipped.as_mut_slice() {
        if numbers.unit() < 0.5 {
            pair.source.normal = -pair.source.normal;
        }
        if numbers.unit() < 0.5 {
            pair.target.normal = -pair.target.normal;
        }
    }
    let mut metric = Generalized::default();
    let (a, b) = (
        metric.normal_equations(&pairs).unwrap(),
        metric.normal_equations(&flipped).unwrap(),
    );
    assert!(same_information(&a, &b, 1e-9));
}

#[test]
fn exact_pairs_are_aligned_by_iterating() {
    let mut numbers = Numbers(34);
    for degrees in [1.0, 10.0, 30.0] {
        let source = ellipsoid(&mut numbers, 200);
        let motion = numbers.motion(&center(), degrees, 0.03);
        let pairs = exact(&source, &motion);
        let step = GaussNewton::new(Generalized::default())
            .step(&pairs)
            .unwrap();
        let (angle, distance) = difference(&step.increment, &motion);
        assert!(
            angle < 1e-5 && distance < 1e-6,
            "{degrees}: {angle} {distance}"
        );
    }
}

#[test]
fn any_epsilon_is_valid() {
    let mut numbers = Numbers(35);
    let pairs = messy(&mut numbers, 40);
    let step = |epsilon| Generalized { epsilon }.step(&pairs);
    assert_eq!(step(0.0), step(1e-6));
    assert_eq!(step(-1.0), step(1e-6));
    assert_eq!(step(7.0), step(1.0));
    assert_eq!(step(f64::NAN), None);
}

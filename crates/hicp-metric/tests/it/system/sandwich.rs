//! Tests of the sandwich covariance: against its formula, and against Monte Carlo for weights that
//! are not inverse variances.

use crate::scenes::{AtStart, Numbers, advanced, carried, center, ellipsoid, exact, messy};
use hicp_core::{Correspondences, Isometry3, Matrix6, Vector3, Vector6, se3};
use hicp_metric::{ErrorMetric, Generalized, PointToPlane, PointToPoint, sandwich_covariance};

/// Returns the rows (J, r) of a pair around the camera origin, by the definitions of the two
/// metrics.
fn rows(pair: &hicp_core::Pair, plane: bool) -> Vec<(Vector6<f64>, f64)> {
    let point = pair.source.point.cast::<f64>();
    let difference = point - pair.target.point.cast::<f64>();
    let normal = pair.target.normal.cast::<f64>().into_inner();
    let directions = if plane {
        vec![normal]
    } else {
        vec![Vector3::x(), Vector3::y(), Vector3::z()]
    };
    let row = |d: Vector3<f64>| {
        let lever = point.coords.cross(&d);
        let row = Vector6::new(d.x, d.y, d.z, lever.x, lever.y, lever.z);
        (row, d.dot(&difference))
    };
    directions.into_iter().map(row).collect()
}

/// Returns H⁻¹ (Σ gᵢ gᵢᵀ) H⁻¹ N/(N − 6), summed in meters and radians around the camera origin.
fn by_formula(pairs: &Correspondences, plane: bool) -> Matrix6<f64> {
    let (mut hessian, mut middle) = (Matrix6::zeros(), Matrix6::zeros());
    for pair in pairs.as_slice() {
        let weight = f64::from(pair.weight);
        let mut own = Vector6::zeros();
        for (row, residual) in rows(pair, plane) {
            hessian += row * row.transpose() * weight;
            own += row * (weight * residual);
        }
        middle += own * own.transpose();
    }
    let inverse = hessian.try_inverse().unwrap();
    let n = pairs.len() as f64;
    inverse * middle * inverse * (n / (n - 6.0))
}

#[test]
fn the_sandwich_equals_its_formula_with_one_gradient_per_pair() {
    let mut numbers = Numbers(201);
    for count in [7, 20, 100] {
        let pairs = messy(&mut numbers, count);
        let check = |found: Matrix6<f64>, plane| {
            let expected = by_formula(&pairs, plane);
            assert!(
                (found - expected).amax() < 1e-6 * expected.amax(),
                "{count} {plane}: {found} {expected}"
            );
            assert_eq!(found, found.transpose());
        };
        check(sandwich_covariance(&PointToPlane, &pairs).unwrap(), true);
        check(sandwich_covariance(&PointToPoint, &pairs).unwrap(), false);
    }
}

/// Returns Σ^{-½} S Σ^{-½}, which is the identity if Σ predicts S.
fn whitened(predicted: &Matrix6<f64>, sample: &Matrix6<f64>) -> Matrix6<f64> {
    let inverse = predicted.cholesky().unwrap().l().try_inverse().unwrap();
    inverse * sample * inverse.transpose()
}

/// The noise is five times as strong at the ends of an ellipsoid, where the levers are.
///
/// The weights ignore that.
#[test]
fn monte_carlo_confirms_it_where_the_plain_covariance_is_wrong() {
    const TRIALS: u32 = 3000;
    let mut numbers = Numbers(202);
    let source = ellipsoid(&mut numbers, 400);
    let sigma = |z: f64| {
        let at_an_end = (z - center().z).abs() > 0.06;
        if at_an_end { 5e-4 } else { 1e-4 }
    };
    let (mut robust, mut plain, mut sample) =
        (Matrix6::zeros(), Matrix6::zeros(), Matrix6::zeros());
    for _ in 0..TRIALS {
        let mut pairs = exact(&source, &Isometry3::identity());
        for pair in pairs.as_mut_slice() {
            let off = numbers.normal() * sigma(f64::from(pair.source.point.z));
            let normal = pair.target.normal.cast::<f64>().into_inner();
            pair.target.point += (normal * off).cast::<f32>();
        }
        let increment = PointToPlane.step(&pairs).unwrap().increment;
        let at_minimum = advanced(&pairs, &increment);
        let share = 1.0 / f64::from(TRIALS);
        robust += sandwich_covariance(&PointToPlane, &at_minimum).unwrap() * share;
        let system = PointToPlane.normal_equations(&at_minimum).unwrap();
        plain += system.covariance().unwrap() * share;
        let xi = se3::log(&increment);
        sample += xi * xi.transpose() * share;
    }
    // Diagonals of a Wishart matrix over N trials have a standard deviation of √(2/N). Five of them
    // are allowed, and 3 % for the bias of the formula, about 6/400 times the leverage of the ends.
    let bound = 5.0 * (2.0 / f64::from(TRIALS)).sqrt() + 0.03;
    let right = whitened(&robust, &sample);
    assert!((right - Matrix6::identity()).amax() < bound, "{right}");
    let wrong = whitened(&plain, &sample);
    assert!((wrong - Matrix6::identity()).amax() > 0.5, "{wrong}");
}

#[test]
fn a_common_motion_transforms_it_and_the_scale_of_weights_does_not_matter() {
    let mut numbers = Numbers(203);
    let pairs = messy(&mut numbers, 60);
    let motion = numbers.motion(&center(), 70.0, 0.3);
    let metrics: [Box<dyn ErrorMetric>; 3] = [
        Box::new(PointToPlane),
        Box::new(PointToPoint),
        Box::new(Generalized::default()),
    ];
    for metric in metrics {
        let here = sandwich_covariance(&metric, &pairs).unwrap();
        let there = sandwich_covariance(&metric, &carried(&pairs, &motion)).unwrap();
        let adjoint = se3::adjoint(&motion);
        let expected = adjoint * here * adjoint.transpose();
        assert!((there - expected).amax() < 1e-4 * expected.amax());
        let mut heavy = pairs.clone();
        for pair in heavy.as_mut_slice() {
            pair.weight *= 4.0;
        }
        let heavy = sandwich_covariance(&metric, &heavy).unwrap();
        assert!((heavy - here).amax() < 1e-12 * here.amax());
    }
}

#[test]
fn undetermined_poses_have_no_sandwich_covariance() {
    let mut numbers = Numbers(204);
    // With as many pairs as unknowns, no residual is left. Pairs without weight do not count.
    let mut pairs = messy(&mut numbers, 8);
    for pair in &mut pairs.as_mut_slice()[..2] {
        pair.weight = 0.0;
    }
    assert_eq!(sandwich_covariance(&PointToPlane, &pairs), None);
    pairs.as_mut_slice()[0].weight = 1.0;
    assert!(sandwich_covariance(&PointToPlane, &pairs).is_some());
    let alone = Correspondences::new();
    assert_eq!(sandwich_covariance(&PointToPlane, &alone), None);
    // A plane leaves three directions undetermined.
    let plane: Vec<_> = (0..100)
        .map(|_| {
            let offset = Vector3::new(numbers.sign(), numbers.sign(), 0.0) * 0.1;
            crate::scenes::surfel(center() + offset, -Vector3::z())
        })
        .collect();
    let pairs = exact(&plane, &Isometry3::translation(0.0, 0.0, 0.001));
    assert_eq!(sandwich_covariance(&PointToPlane, &pairs), None);
}

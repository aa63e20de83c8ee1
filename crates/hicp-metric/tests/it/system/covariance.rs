//! Tests of covariance and information: against Monte Carlo, and under changes of frame.

use crate::scenes::{AtStart, Numbers, carried, center, ellipsoid, exact, messy};
use hicp_core::{Correspondences, Isometry3, Matrix6, Point3, Surfel, Vector3, Vector6, se3};
use hicp_metric::Minimize;
use hicp_metric::{Degeneracy, NormalEquations, PointToPlane, PointToPoint};

const TRIALS: u32 = 4000;

/// Adds noise of σ/√w: along the normal for point-to-plane, in all directions for point-to-point.
fn noisy(
    numbers: &mut Numbers,
    source: &[Surfel],
    weights: &[f32],
    sigma: f64,
    plane: bool,
) -> Correspondences {
    let mut pairs = exact(source, &Isometry3::identity());
    for (pair, weight) in pairs.as_mut_slice().iter_mut().zip(weights) {
        pair.weight = *weight;
        let sigma = sigma / f64::from(*weight).sqrt();
        let off = if plane {
            pair.target.normal.cast::<f64>().into_inner() * (sigma * numbers.normal())
        } else {
            Vector3::new(numbers.normal(), numbers.normal(), numbers.normal()) * sigma
        };
        pair.target.point += off.cast::<f32>();
    }
    pairs
}

/// Returns the mean predicted and the sample covariance of the increment at the minimum of each
/// trial.
fn monte_carlo(metric: &mut dyn Minimize, sigma: f64, plane: bool) -> (Matrix6<f64>, Matrix6<f64>) {
    let mut numbers = Numbers(91);
    let source = ellipsoid(&mut numbers, 60);
    let weights: Vec<f32> = (0..60)
        .map(|i| if i % 3 == 0 { 0.25 } else { 1.0 })
        .collect();
    let (mut predicted, mut sample) = (Matrix6::zeros(), Matrix6::zeros());
    for _ in 0..TRIALS {
        let pairs = noisy(&mut numbers, &source, &weights, sigma, plane);
        let increment = metric.step(&pairs).unwrap().increment;
        let system = metric
            .normal_equations(&crate::scenes::advanced(&pairs, &increment))
            .unwrap();
        predicted += system.covariance().unwrap() / f64::from(TRIALS);
        let xi = se3::log(&increment);
        sample += xi * xi.transpose() / f64::from(TRIALS);
    }
    (predicted, sample)
}

/// Checks Σ^{-½} S Σ^{-½}, which is Wishart over N around the identity.
///
/// Its entries have a standard deviation of √(1/N), and its diagonals of √(2/N).
fn check(predicted: &Matrix6<f64>, sample: &Matrix6<f64>) {
    let factor = predicted.cholesky().unwrap().l();
    let inverse = factor.try_inverse().unwrap();
    let whitened = inverse * sample * inverse.transpose();
    // Five standard deviations for 21 entries, and 1 % for nonlinearity.
    let bound = 5.0 * (2.0 / f64::from(TRIALS)).sqrt() + 0.01;
    assert!(
        (whitened - Matrix6::identity()).amax() < bound,
        "{whitened}"
    );
}

#[test]
fn monte_carlo_confirms_the_covariance() {
    let (predicted, sample) = monte_carlo(&mut PointToPlane, 5e-4, true);
    check(&predicted, &sample);
    let (predicted, sample) = monte_carlo(&mut PointToPoint, 5e-4, false);
    check(&predicted, &sample);
}

#[test]
fn the_covariance_scales_with_the_variance_of_the_noise() {
    let mut numbers = Numbers(92);
    let source = ellipsoid(&mut numbers, 60);
    let weights = vec![1.0; 60];
    let at = |sigma| {
        let mut numbers = Numbers(93);
        let pairs = noisy(&mut numbers, &source, &weights, sigma, true);
        PointToPlane
            .normal_equations(&pairs)
            .unwrap()
            .covariance()
            .unwrap()
    };
    let (one, three) = (at(1e-3), at(3e-3));
    // Targets are rounded to f32: 3e-8 m of 1e-3 m.
    assert!((three - one * 9.0).amax() < 1e-4 * three.amax());
    // Doubling all weights changes nothing.
    let pairs = messy(&mut numbers, 60);
    let mut heavy = pairs.clone();
    for pair in heavy.as_mut_slice() {
        pair.weight *= 2.0;
    }
    let (a, b) = (
        PointToPlane
            .normal_equations(&pairs)
            .unwrap()
            .covariance()
            .unwrap(),
        PointToPlane
            .normal_equations(&heavy)
            .unwrap()
            .covariance()
            .unwrap(),
    );
    assert!((a - b).amax() < 1e-12 * a.amax());
}

/// Returns residuals at random points along random directions, around a pivot, all displaced by an
/// offset; in f64.
fn displaced(offset: &Vector3<f64>, pivot: &Point3<f64>) -> NormalEquations {
    let mut numbers = Numbers(94);
    let mut system = NormalEquations::new(pivot + offset, 0.05);
    for _ in 0..100 {
        let point = center() + numbers.signs() * 0.05 + offset;
        let (direction, weight) = (numbers.direction(), 0.5 + numbers.unit());
        system.add_row(&point, &direction, 1e-3 * numbers.normal(), weight);
    }
    system
}

#[test]
fn information_is_around_the_camera_origin_for_every_pivot() {
    let here = displaced(&Vector3::zeros(), &center());
    let expected = {
        let mut numbers = Numbers(94);
        let (mut information, mut gradient) = (Matrix6::zeros(), Vector6::zeros());
        for _ in 0..100 {
            let point = center() + numbers.signs() * 0.05;
            let (d, w) = (numbers.direction(), 0.5 + numbers.unit());
            let r = 1e-3 * numbers.normal();
            let lever = point.coords.cross(&d);
            let row = Vector6::new(d.x, d.y, d.z, lever.x, lever.y, lever.z);
            information += row * row.transpose() * w;
            gradient += row * (w * r);
        }
        (information, gradient)
    };
    for pivot in [center(), Point3::origin(), Point3::new(3.0, -2.0, 1.0)] {
        let system = displaced(&Vector3::zeros(), &pivot);
        assert!((system.information() - expected.0).amax() < 1e-11 * expected.0.amax());
        assert!((system.gradient() - expected.1).amax() < 1e-11 * expected.1.amax());
    }
    // Σ = s² Λ⁻¹.
    let s2 = here.loss() / 94.0;
    let product = here.covariance().unwrap() * expected.0 / s2;
    assert!((product - Matrix6::identity()).amax() < 1e-9, "{product}");
}

/// At a distance of a kilometer the covariance is Ad Σ Adᵀ, and the step is the same.
#[test]
fn a_far_pivot_keeps_the_digits() {
    let offset = Vector3::new(800.0, -500.0, 300.0);
    let near = displaced(&Vector3::zeros(), &center());
    let far = displaced(&offset, &center());
    let adjoint = se3::adjoint(&Isometry3::translation(offset.x, offset.y, offset.z));
    let expected = adjoint * near.covariance().unwrap() * adjoint.transpose();
    let found = far.covariance().unwrap();
    assert!((found - expected).amax() < 1e-9 * expected.amax());
    // Moved back to the object: the lever amplifies roundings by the square of 10⁴.
    let back = adjoint.try_inverse().unwrap();
    let near_again = back * found * back.transpose();
    let covariance = near.covariance().unwrap();
    assert!((near_again - covariance).amax() < 1e-5 * covariance.amax());
    let information = far.information();
    let moved = back.transpose() * near.information() * back;
    assert!((information - moved).amax() < 1e-9 * moved.amax());
    let (a, b) = (near.solve().unwrap(), far.solve().unwrap());
    let (here, there) = (
        a * center() - center(),
        b * (center() + offset) - (center() + offset),
    );
    assert!((here - there).norm() < 1e-9);
    assert!((a.rotation.inverse() * b.rotation).angle() < 1e-9);
}

#[test]
fn a_common_motion_transforms_the_covariance_by_the_adjoint() {
    let mut numbers = Numbers(95);
    let pairs = messy(&mut numbers, 60);
    let motion = numbers.motion(&center(), 70.0, 0.3);
    let moved = carried(&pairs, &motion);
    let metrics: [Box<dyn Minimize>; 2] = [Box::new(PointToPlane), Box::new(PointToPoint)];
    for mut metric in metrics {
        let here = metric
            .normal_equations(&pairs)
            .unwrap()
            .covariance()
            .unwrap();
        let there = metric
            .normal_equations(&moved)
            .unwrap()
            .covariance()
            .unwrap();
        let adjoint = se3::adjoint(&motion);
        let expected = adjoint * here * adjoint.transpose();
        assert!((there - expected).amax() < 1e-4 * expected.amax());
        assert_eq!(there, there.transpose());
    }
}

#[test]
fn undetermined_poses_have_no_covariance() {
    let mut numbers = Numbers(96);
    let plane: Vec<_> = (0..100)
        .map(|_| {
            let offset = Vector3::new(numbers.sign(), numbers.sign(), 0.0) * 0.1;
            crate::scenes::surfel(center() + offset, -Vector3::z())
        })
        .collect();
    let pairs = exact(&plane, &Isometry3::translation(0.0, 0.0, 0.001));
    assert_eq!(
        PointToPlane.normal_equations(&pairs).unwrap().covariance(),
        None
    );
    // Six rows determine the pose, but leave nothing to estimate the noise from.
    let six = messy(&mut numbers, 6);
    assert_eq!(
        PointToPlane.normal_equations(&six).unwrap().covariance(),
        None
    );
    // Pairs without weight are not rows.
    let mut eight = messy(&mut numbers, 8);
    for pair in &mut eight.as_mut_slice()[..3] {
        pair.weight = 0.0;
    }
    assert_eq!(
        PointToPlane.normal_equations(&eight).unwrap().covariance(),
        None
    );
    // A sphere leaves its rotations undetermined.
    let sphere: Vec<_> = (0..100)
        .map(|_| {
            let normal = numbers.direction();
            crate::scenes::surfel(center() + normal * 0.05, normal)
        })
        .collect();
    let mut pairs = exact(&sphere, &Isometry3::identity());
    for pair in pairs.as_mut_slice() {
        pair.target.point.z += 1e-3;
    }
    assert_eq!(
        PointToPlane.normal_equations(&pairs).unwrap().covariance(),
        None
    );
    assert!(
        PointToPoint
            .normal_equations(&pairs)
            .unwrap()
            .covariance()
            .is_some()
    );
}

/// A policy does not minimize along a direction that it freezes, so no variance is known there.
#[test]
fn a_direction_that_a_policy_freezes_has_no_covariance() {
    let mut numbers = Numbers(97);
    // A can whose normals waver: its rotation around z has about 10⁻⁴ of the information.
    let can: Vec<_> = (0..300)
        .map(|i| {
            let around = Vector3::new(numbers.normal(), numbers.normal(), 0.0).normalize();
            let side = Vector3::z() * numbers.sign() + around;
            let cap = Vector3::z() + around * numbers.unit();
            let waver = Vector3::z().cross(&around) * (0.01 * numbers.sign());
            let (offset, normal) = if i % 3 == 0 {
                (cap, Vector3::z())
            } else {
                (side, (around + waver).normalize())
            };
            crate::scenes::surfel(center() + offset * 0.05, normal)
        })
        .collect();
    let mut pairs = exact(&can, &Isometry3::identity());
    for pair in pairs.as_mut_slice() {
        let along = pair.target.normal.cast::<f64>().into_inner();
        pair.target.point += (along * (5e-4 * numbers.normal())).cast::<f32>();
    }
    let policies = [
        Degeneracy::Damp,
        Degeneracy::Ignore,
        Degeneracy::Freeze,
        Degeneracy::FreezeRotations,
        Degeneracy::Refuse,
    ];
    let free = PointToPlane.normal_equations(&pairs).unwrap();
    let mut held = free;
    let axes = Isometry3::identity().rotation;
    held.freeze(&axes, &center(), [false; 3], [false, false, true]);
    for (policy, freezes) in policies.into_iter().zip([false, false, true, true, true]) {
        for threshold in [Degeneracy::THRESHOLD, 1e-7] {
            let system = free.with_policy(policy, threshold);
            // By the definition: a step that does not go around z, or that there is not.
            let turn = system
                .solve()
                .map_or(0.0, |step| step.rotation.scaled_axis().z);
            let moves = turn.abs() > 1e-3;
            assert_eq!(
                moves,
                !freezes || threshold < 1e-6,
                "{policy:?} {threshold}: {turn}"
            );
            assert_eq!(
                system.covariance().is_some(),
                moves,
                "{policy:?} {threshold}"
            );
            if moves {
                assert_eq!(system.covariance(), free.covariance());
            }
        }
        // A component that the caller froze is not free.
        assert!(
            held.with_policy(policy, 1e-3).covariance().is_some(),
            "{policy:?}"
        );
    }
}

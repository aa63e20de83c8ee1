//! Tests of iterations over fixed pairs.

use crate::scenes::{AtStart, Numbers, advanced, center, difference, ellipsoid, exact, messy};
use hicp_core::{Correspondences, Isometry3};
use hicp_metric::Minimize;
use hicp_metric::{
    GaussNewton, Generalized, Kernel, LevenbergMarquardt, PlaneToPoint, PointToPlane, PointToPoint,
    Robust, Scale, Symmetric,
};

fn metrics() -> Vec<Box<dyn Minimize>> {
    vec![
        Box::new(PointToPoint),
        Box::new(PointToPlane),
        Box::new(PlaneToPoint),
        Box::new(Symmetric),
        Box::new(Generalized::default()),
        Box::new(Robust::new(PointToPlane, Kernel::TUKEY, Scale::default())),
        Box::new(Robust::new(
            PointToPoint,
            Kernel::CAUCHY,
            Scale::Meters(0.002),
        )),
    ]
}

/// Returns the loss with sources moved as the solvers move them: once, from the originals.
fn loss_after(
    metric: &mut dyn Minimize,
    pairs: &Correspondences,
    increment: &Isometry3<f64>,
) -> f64 {
    metric.loss(&advanced(pairs, increment)).unwrap()
}

#[test]
fn gauss_newton_ends_at_the_closed_form() {
    let mut numbers = Numbers(71);
    for degrees in [0.0, 5.0, 30.0, 60.0] {
        let motion = numbers.motion(&center(), degrees, 0.05);
        let pairs = advanced(&messy(&mut numbers, 80), &motion);
        let mut iterated = GaussNewton::new(PointToPoint);
        iterated.tolerance = 0.0;
        let (a, b) = (
            iterated.step(&pairs).unwrap(),
            PointToPoint.step(&pairs).unwrap(),
        );
        let (angle, distance) = difference(&a.increment, &b.increment);
        assert!(
            angle < 1e-6 && distance < 1e-7,
            "{degrees}: {angle} {distance}"
        );
        assert!((a.mean_loss - b.mean_loss).abs() < 1e-12 * b.mean_loss);
    }
}

#[test]
fn exact_pairs_are_aligned() {
    let mut numbers = Numbers(72);
    for degrees in [1.0, 15.0, 30.0] {
        let source = ellipsoid(&mut numbers, 200);
        let motion = numbers.motion(&center(), degrees, 0.02);
        let pairs = exact(&source, &motion);
        for (a, b) in metrics().into_iter().zip(metrics()) {
            let mut newton = GaussNewton::new(a);
            newton.max_iterations = 30;
            let mut marquardt = LevenbergMarquardt::new(b);
            marquardt.max_iterations = 60;
            let solvers: [&mut dyn Minimize; 2] = [&mut newton, &mut marquardt];
            for solver in solvers {
                let step = solver.step(&pairs).unwrap();
                let (angle, distance) = difference(&step.increment, &motion);
                assert!(
                    angle < 2e-5 && distance < 2e-6,
                    "{} {degrees}: {angle} {distance}",
                    solver.label()
                );
            }
        }
    }
}

#[test]
fn one_iteration_is_one_step() {
    let mut numbers = Numbers(73);
    let pairs = messy(&mut numbers, 80);
    let mut once = GaussNewton::new(PointToPlane);
    once.max_iterations = 1;
    let (a, b) = (
        once.step(&pairs).unwrap(),
        PointToPlane.step(&pairs).unwrap(),
    );
    let (angle, distance) = difference(&a.increment, &b.increment);
    assert!(angle < 1e-15 && distance < 1e-15);
    once.max_iterations = 0;
    assert_eq!(once.step(&pairs).unwrap().increment, Isometry3::identity());
    let mut never = LevenbergMarquardt::new(PointToPlane);
    never.max_iterations = 0;
    assert_eq!(never.step(&pairs).unwrap().increment, Isometry3::identity());
}

#[test]
fn levenberg_marquardt_never_raises_the_loss() {
    let mut numbers = Numbers(74);
    for _ in 0..20 {
        // Far away, with wrong normals and outliers: Gauss–Newton overshoots on some of these.
        let motion = numbers.motion(&center(), 100.0, 0.1);
        let mut pairs = advanced(&messy(&mut numbers, 30), &motion);
        for pair in &mut pairs.as_mut_slice()[..10] {
            pair.target.point += (numbers.signs() * 0.2).cast::<f32>();
        }
        for mut metric in metrics() {
            let before = metric.loss(&pairs).unwrap();
            for iterations in [1, 2, 5, 40] {
                let mut solver = LevenbergMarquardt::new(metric);
                solver.max_iterations = iterations;
                solver.initial_damping = 0.0;
                let step = solver.step(&pairs).unwrap();
                assert!((step.mean_loss - before).abs() <= 1e-15 * before);
                metric = solver.metric;
                let after = loss_after(&mut metric, &pairs, &step.increment);
                assert!(after <= before, "{}: {before} {after}", metric.label());
            }
        }
    }
}

/// Confirms that steps are rejected: on some problems the plain step raises the loss and this one
/// does not.
#[test]
fn plain_steps_that_raise_the_loss_are_rejected() {
    let mut numbers = Numbers(75);
    let mut raised = 0;
    for _ in 0..40 {
        let motion = numbers.motion(&center(), 120.0, 0.05);
        let pairs = advanced(&messy(&mut numbers, 12), &motion);
        let step = PointToPlane.step(&pairs).unwrap();
        if loss_after(&mut PointToPlane, &pairs, &step.increment) > step.mean_loss {
            raised += 1;
            let mut solver = LevenbergMarquardt::new(PointToPlane);
            solver.initial_damping = 0.0;
            let careful = solver.step(&pairs).unwrap();
            assert!(loss_after(&mut PointToPlane, &pairs, &careful.increment) < step.mean_loss);
        }
    }
    assert!(raised > 0);
}

#[test]
fn perfect_few_and_missing_pairs() {
    let mut numbers = Numbers(77);
    let fitting = exact(&ellipsoid(&mut numbers, 50), &Isometry3::identity());
    let few: Correspondences = messy(&mut numbers, 1);
    let solvers: [Box<dyn Minimize>; 2] = [
        Box::new(GaussNewton::new(PointToPlane)),
        Box::new(LevenbergMarquardt::new(PointToPlane)),
    ];
    for mut solver in solvers {
        let step = solver.step(&fitting).unwrap();
        assert!(difference(&step.increment, &Isometry3::identity()).1 < 1e-12);
        assert_eq!(step.mean_loss.to_bits(), 0.0_f64.to_bits());
        assert_eq!(solver.step(&few), None);
        assert_eq!(solver.step(&Correspondences::new()), None);
    }
}

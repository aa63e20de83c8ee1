//! Tests of the end of the iteration.
//!
//! They cover steps that raise the cost, a minimum hidden by rounding, and no evaluations left.

use crate::common::{Random, apart, estimate, fusion};
use hicp_core::{Isometry3, Matrix6, Point3, Vector6, se3};
use hicp_fusion::{Fused, FusionLimits, PoseEstimate, UnitCovariance};

fn limits(max_iterations: usize) -> FusionLimits {
    FusionLimits {
        max_iterations,
        ..FusionLimits::default()
    }
}

/// Returns poses with arbitrary rotations, up to half a turn from each other.
///
/// Full steps often raise V. The covariances are large, so that V is about 1, or as small.
fn scattered(seed: u64) -> Vec<PoseEstimate> {
    let mut random = Random(seed);
    (0..3)
        .map(|_| {
            let pose = random.motion(2.5);
            estimate(pose, random.covariance(3.0))
        })
        .collect()
}

fn solved(estimates: &[PoseEstimate], max_iterations: usize) -> Fused {
    let start = estimates[0].camera_from_object();
    fusion(estimates, limits(max_iterations))
        .solve(start)
        .unwrap()
}

#[test]
fn the_cost_is_half_the_sum_of_the_squared_distances() {
    let mut random = Random(41);
    let estimates = random.estimates(4, 0.5);
    let pose = random.motion(1.0);
    let expected: f64 = estimates
        .iter()
        .map(|each| {
            let xi = se3::log(&(pose * each.camera_from_object().inverse()));
            0.5 * xi.dot(&(each.covariance().try_inverse().unwrap() * xi))
        })
        .sum();
    let found = fusion(&estimates, limits(1)).cost(&pose);
    assert!((found / expected - 1.0).abs() < 1e-12);
}

/// For every number of evaluations, the pose is the best so far, and its cost is the reported one.
#[test]
fn no_evaluation_makes_the_pose_worse() {
    let mut halved = 0;
    for seed in 0..40 {
        let estimates = scattered(seed);
        let mut before = f64::INFINITY;
        for max_iterations in 1..=30 {
            let Fused {
                estimate, solution, ..
            } = solved(&estimates, max_iterations);
            assert!(solution.iterations <= max_iterations);
            // It ends before only if it has converged.
            assert!(solution.converged || solution.iterations == max_iterations);
            // Not by more than rounding.
            assert!(
                solution.cost <= before * (1.0 + 1e-11),
                "{seed} {max_iterations}"
            );
            if !solution.converged {
                let cost = fusion(&estimates, limits(1)).cost(estimate.camera_from_object());
                assert!((solution.cost / cost - 1.0).abs() < 1e-9);
                // Out of evaluations before a step was short enough.
                halved += usize::from(solution.cost >= before);
            }
            before = solution.cost;
        }
    }
    assert!(
        halved > 50,
        "the test is about steps that raise V: {halved}"
    );
}

/// If convergence is reported, V has no slope.
#[test]
fn the_slope_is_zero_at_convergence() {
    let mut converged = 0;
    for seed in 0..40 {
        let estimates = scattered(seed);
        let found = solved(&estimates, 200);
        if !found.solution.converged {
            continue;
        }
        converged += 1;
        let workspace = fusion(&estimates, limits(1));
        for axis in 0..6 {
            let at = |h: f64| {
                let mut step = Vector6::zeros();
                step[axis] = h;
                workspace.cost(&(se3::exp(&step) * found.estimate.camera_from_object()))
            };
            // V and its curvature are of the order of 1.
            let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
            assert!(slope.abs() < 1e-7, "{seed} {axis}: {slope}");
        }
    }
    assert!(converged > 30, "{converged}");
}

/// A tolerance of zero is never reached, so every evaluation is used.
#[test]
fn a_tolerance_of_zero_uses_every_evaluation() {
    let here = [estimate(Isometry3::identity(), Matrix6::identity())];
    let limits = FusionLimits {
        max_iterations: 7,
        tolerance: 0.0,
    };
    let fused = fusion(&here, limits).solve(&Isometry3::identity()).unwrap();
    assert_eq!(*fused.estimate.camera_from_object(), Isometry3::identity());
    assert_eq!(fused.solution.iterations, 7);
    assert!(!fused.solution.converged && fused.solution.cost == 0.0);
}

/// Rotations and translations nearly coincide at a kilometer from an object of 10 cm.
///
/// V is then a small difference of large numbers. No step may lower it, but the iteration must end,
/// at the pose where the same estimates end nearby and without rounding.
#[test]
fn the_iteration_ends_if_rounding_hides_the_minimum() {
    let unit = UnitCovariance::about_object(Point3::origin(), 0.1).unwrap();
    let away = Isometry3::translation(0.0, 1000.0, 1000.0);
    for seed in 0..40 {
        let mut random = Random(seed);
        let poses = [0; 5].map(|_| random.motion(0.1));
        let seen = |camera: &Isometry3<f64>| -> Vec<PoseEstimate> {
            let poses = poses.iter().map(|pose| camera * pose);
            poses
                .map(|pose| estimate(pose, unit.at(&pose) * 0.01))
                .collect()
        };
        let (far, near) = (
            solved(&seen(&away), 2000),
            solved(&seen(&Isometry3::identity()), 50),
        );
        assert!(far.solution.converged, "{:?}", far.solution);
        assert!(far.solution.iterations < 500, "{:?}", far.solution);
        let found = away.inverse() * far.estimate.camera_from_object();
        // V is flat at its minimum. It loses about 1e-10 of its value to rounding, which is the
        // square of the change of the pose.
        assert!(apart(&found, near.estimate.camera_from_object()) < 1e-5);
    }
}

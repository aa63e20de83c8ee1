//! Distances of estimates, what a cleared workspace forgets, and which methods look at covariances.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use common::{EXACT, Random, apart, estimate, fusion};
use hicp_core::{Isometry3, Matrix6, Vector6, se3};
use hicp_fusion::{Fuser, FuserConfig, FusionMethod, PoseEstimate};

#[test]
fn the_squared_mahalanobis_distance_is_that_of_the_difference() {
    // Two centimetres apart with standard deviations of 1 cm each: 4 / 2.
    let at = |x| {
        estimate(
            Isometry3::translation(x, 0.0, 0.5),
            Matrix6::identity() * 1e-4,
        )
    };
    assert!((at(0.0).mahalanobis_squared(&at(0.02)) - 2.0).abs() < 1e-9);
    let mut random = Random(3);
    for _ in 0..20 {
        let (sa, sb) = (random.covariance(0.01), random.covariance(0.02));
        let pose = random.pose(1.0);
        let xi = random.twist(0.01);
        let (a, b) = (estimate(se3::exp(&xi) * pose, sa), estimate(pose, sb));
        let expected = xi.dot(&((sa + sb).try_inverse().unwrap() * xi));
        let found = a.mahalanobis_squared(&b);
        assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
        assert!((b.mahalanobis_squared(&a) / found - 1.0).abs() < 1e-9);
    }
}

#[test]
fn a_cleared_workspace_fuses_as_a_new_one() {
    let mut random = Random(4);
    let (old, new) = (random.estimates(5, 0.1), random.estimates(3, 0.1));
    let mut used = fusion(&old, EXACT);
    used.clear();
    assert!(used.is_empty() && used.solve(old[0].camera_from_object()).is_none());
    for estimate in &new {
        used.push(estimate);
    }
    let start = new[0].camera_from_object();
    assert_eq!(used.solve(start), fusion(&new, EXACT).solve(start));
}

#[test]
fn the_methods_that_use_covariances_are_those_whose_pose_depends_on_them() {
    let mut random = Random(5);
    let center = random.pose(1.0);
    let poses: Vec<Isometry3<f64>> = (0..4)
        .map(|_| se3::exp(&random.twist(0.01)) * center)
        .collect();
    let fused = |method: FusionMethod, sizes: [f64; 4]| {
        let mut fuser = method.build(FuserConfig::default());
        for (pose, size) in poses.iter().zip(sizes) {
            let spread = Vector6::repeat(size * size);
            fuser.update(&PoseEstimate::new(*pose, Matrix6::from_diagonal(&spread)).unwrap());
        }
        *fuser.estimate().unwrap().camera_from_object()
    };
    for method in FusionMethod::ALL {
        let (up, down) = (
            fused(method, [0.01, 0.02, 0.03, 0.04]),
            fused(method, [0.04, 0.03, 0.02, 0.01]),
        );
        assert_eq!(
            method.uses_covariances(),
            apart(&up, &down) > 1e-6,
            "{method}"
        );
    }
}

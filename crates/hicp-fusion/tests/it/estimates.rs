//! Tests of valid estimates, their distances, singular covariances, and methods that use
//! covariances.

use crate::common::{EXACT, Random, apart, estimate, fusion};
use hicp_core::{Isometry3, Matrix6, Vector6, se3};
use hicp_fusion::{
    BatchFuser, Fuser, FuserConfig, FusionError, FusionMethod, MIN_STANDARD_DEVIATION,
    MostConfident, PoseEstimate,
};

#[test]
fn the_squared_mahalanobis_distance_is_that_of_the_difference() {
    // Two centimeters apart with standard deviations of 1 cm each: 4 / 2.
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
        let pose = random.motion(1.0);
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
    assert_eq!(used.len(), 5);
    assert!(!used.is_empty());
    used.clear();
    assert_eq!(used.len(), 0);
    assert!(used.is_empty() && used.solve(old[0].camera_from_object()).is_none());
    for estimate in &new {
        used.push(estimate);
    }
    let start = new[0].camera_from_object();
    assert_eq!(used.solve(start), fusion(&new, EXACT).solve(start));
}

#[test]
fn uses_covariances_is_true_if_the_pose_depends_on_them() {
    let mut random = Random(5);
    let center = random.motion(1.0);
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

#[test]
fn an_estimate_returns_its_parts() {
    let bare = estimate(Isometry3::identity(), Matrix6::identity());
    assert_eq!(bare.mve(), None);
    assert_eq!(bare.with_mve(0.25).unwrap().mve(), Some(0.25));
    let mut fuser = BatchFuser::average(FuserConfig::default());
    assert!(fuser.is_empty());
    fuser.update(&bare);
    assert!(!fuser.is_empty() && fuser.len() == 1);
    fuser.reset();
    assert!(fuser.is_empty());
}

/// The validity of a covariance does not depend on its units.
#[test]
fn a_valid_covariance_is_valid_at_any_scale() {
    let mut random = Random(6);
    let verdict = |covariance: Matrix6<f64>, scale: f64| {
        PoseEstimate::new(Isometry3::identity(), covariance * scale).map(|e| *e.covariance())
    };
    for scale in [1e-12, 1.0, 1e12] {
        let good = random.covariance(1.0);
        let size = good.amax();
        let mut rounded = good;
        rounded[(4, 1)] += 1e-11 * size;
        // The effect of rounding on symmetry is averaged.
        let found = verdict(rounded, scale).unwrap();
        assert_eq!(found, found.transpose());
        let middle = f64::midpoint(rounded[(4, 1)], good[(4, 1)]);
        assert!((found[(4, 1)] / (middle * scale) - 1.0).abs() < 1e-15);
        let mut lopsided = good;
        lopsided[(4, 1)] += 1e-7 * size;
        assert!(matches!(
            verdict(lopsided, scale),
            Err(FusionError::CovarianceAsymmetric {
                row: 4,
                column: 1,
                ..
            })
        ));
        // Flat in two directions. Negative eigenvalues within rounding are accepted, and clearly
        // negative ones are refused.
        let turn = se3::adjoint(&Isometry3::rotation(hicp_core::Vector3::new(
            0.3, -0.2, 0.5,
        )));
        let flat = |least: f64| {
            let values = Vector6::new(1.0, 0.0, 0.5, 0.2, least, 0.1);
            turn * Matrix6::from_diagonal(&values) * turn.transpose()
        };
        for least in [0.0, -1e-12] {
            assert!(verdict(flat(least), scale).is_ok(), "{least} {scale}");
        }
        let Err(FusionError::CovarianceNegative { eigenvalue }) = verdict(flat(-1e-6), scale)
        else {
            panic!("accepted at {scale}");
        };
        assert!((eigenvalue / scale + 1e-6).abs() < 1e-12, "{eigenvalue}");
    }
}

/// Returns an orthogonal matrix that mixes all six directions.
fn mixed() -> Matrix6<f64> {
    Random(7).covariance(1.0).symmetric_eigen().eigenvectors
}

/// ξᵀΣ⁻¹ξ by eigenvalues, where missing ones count as the smallest standard deviation, in any
/// direction.
#[test]
fn directions_without_variance_count_as_known_to_a_micrometer() {
    let least = MIN_STANDARD_DEVIATION * MIN_STANDARD_DEVIATION;
    let directions = mixed();
    let truth = Isometry3::identity();
    for smallest in [0.0, 1e-15] {
        // Two are singular to working precision.
        let values = Vector6::new(1.0, smallest, 0.25, 4.0, smallest, 0.5);
        let covariance = directions * Matrix6::from_diagonal(&values) * directions.transpose();
        let (a, b) = (covariance * 0.25, covariance * 0.75);
        for axis in 0..6 {
            let xi = directions.column(axis).into_owned() * 1e-6;
            let found = estimate(se3::exp(&xi), a).mahalanobis_squared(&estimate(truth, b));
            let expected = 1e-12 / values[axis].max(least);
            // Rounding adds 1e-16 to the eigenvalues, and a direction of length 1e-6 has a share of
            // the other variances.
            assert!((found / expected - 1.0).abs() < 1e-3, "{axis}: {found}");
        }
    }
}

/// Standard deviations above 1e-10 are used as they are, and those below count as missing.
#[test]
fn tiny_standard_deviations_count_as_missing() {
    let squared = |variance: f64| {
        let half = Matrix6::identity() * (0.5 * variance);
        let offset = Isometry3::translation(1e-9, 0.0, 0.0);
        estimate(offset, half).mahalanobis_squared(&estimate(Isometry3::identity(), half))
    };
    assert!((squared(1.01e-20) / (1e-18 / 1.01e-20) - 1.0).abs() < 1e-6);
    assert!((squared(0.99e-20) / 1e-6 - 1.0).abs() < 1e-6);
}

/// The size of a flat ellipsoid is that with a micrometer in its flat directions.
#[test]
fn flat_and_round_covariances_are_compared_by_their_determinants() {
    let flat = Vector6::new(1.0, 1.0, 1.0, 1.0, 1.0, 0.0);
    let directions = mixed();
    let flat = directions * Matrix6::from_diagonal(&flat) * directions.transpose();
    let surer = |a: Matrix6<f64>, b: Matrix6<f64>| {
        let mut fuser = MostConfident::default();
        fuser.update(&estimate(Isometry3::identity(), a));
        let other = Isometry3::translation(0.1, 0.0, 0.0);
        fuser.update(&estimate(other, b));
        fuser.estimate().unwrap().camera_from_object() == &Isometry3::identity()
    };
    // A determinant of 1e-12 compared with 0.99e-12 and 1.01e-12.
    for (determinant, round_is_surer) in [(0.99e-12_f64, true), (1.01e-12, false)] {
        let round = Matrix6::identity() * determinant.powf(1.0 / 6.0);
        assert_eq!(surer(round, flat), round_is_surer);
        assert_eq!(surer(flat, round), !round_is_surer);
    }
}

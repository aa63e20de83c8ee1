//! Tests of the six methods of §V-A, by the paper's descriptions.

use crate::common::{Random, apart, estimate, exact, fused, relative, run};
use hicp_core::{Isometry3, Matrix6, Point3, Vector6, se3};
use hicp_fusion::{
    BatchFuser, CameraMotion, CovarianceModel, Fuser, FuserConfig, FusionMethod,
    InflatedCovariance, LastEstimate, MostConfident, MveCovariance, PoseEstimate, RecursiveFuser,
    Transport, UnitCovariance,
};

#[test]
fn names_parse_to_their_methods() {
    for method in FusionMethod::ALL {
        assert_eq!(method.name().parse(), Ok(method));
        assert_eq!(
            format!("{method:>20}"),
            format!("{:>20}", method.name()),
            "padded as a word"
        );
        assert_eq!(method.build(FuserConfig::default()).name(), method.name());
    }
    let summaries: std::collections::BTreeSet<&str> =
        FusionMethod::ALL.iter().map(|m| m.summary()).collect();
    assert_eq!(summaries.len(), 6, "a line about each: {summaries:?}");
    assert!(summaries.iter().all(|line| line.contains("estimate")));
    let error = "kalman".parse::<FusionMethod>().unwrap_err();
    assert!(error.to_string().contains("weighted-average"), "{error}");
    let error = "averag".parse::<FusionMethod>().unwrap_err();
    let expected = "no fusion method is named \"averag\"; did you mean \"average\"?";
    assert!(error.to_string().starts_with(expected), "{error}");
}

#[test]
fn last_estimate_is_the_last() {
    let estimates = Random(12).estimates(4, 0.2);
    let last = run(&mut LastEstimate::new(Transport::Adjoint), &estimates);
    assert_eq!(last, estimates[3]);
}

#[test]
fn most_confident_is_the_most_certain_for_any_camera_motion() {
    let mut random = Random(13);
    let unit = exact().unit;
    let mut fuser = MostConfident::new(Transport::Adjoint);
    let mut carried = Isometry3::identity();
    let mves = [0.5, 0.2, 0.7, 0.3];
    let poses = [0; 4].map(|_| random.motion(0.4));
    for (pose, mve) in poses.iter().zip(mves) {
        let now = carried * pose;
        fuser.update(&estimate(now, unit.at(&now) * mve));
        let motion = random.motion(1.0);
        fuser.propagate(&CameraMotion::new(motion).unwrap());
        carried = motion * carried;
    }
    let found = fuser.estimate().unwrap();
    assert!(apart(found.camera_from_object(), &(carried * poses[1])) < 1e-12);
    // Among equals, the newest.
    let mut fuser = MostConfident::default();
    let pair = [poses[0], poses[1]].map(|pose| estimate(pose, Matrix6::identity() * 0.1));
    assert_eq!(run(&mut fuser, &pair), pair[1]);
}

#[test]
fn weighted_average_fuses_all_by_their_covariances() {
    let estimates = Random(14).estimates(8, 0.3);
    let expected = fused(&estimates);
    let found = run(&mut BatchFuser::weighted_average(exact()), &estimates);
    assert!(
        apart(
            found.camera_from_object(),
            expected.estimate.camera_from_object()
        ) < 1e-13
    );
    assert!(relative(found.covariance(), expected.estimate.covariance()) < 1e-12);
}

#[test]
fn average_weighs_equally_for_all_covariances() {
    let mut random = Random(15);
    let estimates = random.estimates(8, 0.3);
    let config = FuserConfig {
        unit: UnitCovariance::Identity,
        ..exact()
    };
    let alike: Vec<PoseEstimate> = estimates
        .iter()
        .map(|e| estimate(*e.camera_from_object(), Matrix6::identity()))
        .collect();
    let found = run(&mut BatchFuser::average(config), &estimates);
    let expected = fused(&alike);
    assert!(
        apart(
            found.camera_from_object(),
            expected.estimate.camera_from_object()
        ) < 1e-13
    );
    // Its covariance follows from those of the estimates: that of a mean of K is a K-th of their
    // mean.
    let pose = random.motion(0.5);
    let together: Vec<PoseEstimate> = estimates
        .iter()
        .map(|e| estimate(pose, *e.covariance()))
        .collect();
    let found = run(&mut BatchFuser::average(config), &together);
    let sum: Matrix6<f64> = together.iter().map(PoseEstimate::covariance).sum();
    assert!(relative(found.covariance(), &(sum / 64.0)) < 1e-12);
}

/// The errors of estimates propagate through the normal equations.
///
/// With equal weights I₆, the covariance is A⁻¹ (Σ Gₖᵀ Hₖ Cₖ Hₖᵀ Gₖ) A⁻¹ with A = Σ Gₖᵀ Gₖ, Gₖ =
/// 𝓙(ξₖ)⁻¹ and Hₖ = 𝓙(−ξₖ)⁻¹.
#[test]
fn the_covariance_of_scattered_estimates_goes_through_the_normal_equations() {
    let estimates = Random(161).estimates(5, 0.6);
    let config = FuserConfig {
        unit: UnitCovariance::Identity,
        ..exact()
    };
    let found = run(&mut BatchFuser::average(config), &estimates);
    let (mut normal, mut middle) = (Matrix6::zeros(), Matrix6::zeros());
    for each in &estimates {
        let xi = se3::log(&(found.camera_from_object() * each.camera_from_object().inverse()));
        let (left, right) = (
            se3::left_jacobian_inverse(&xi),
            se3::left_jacobian_inverse(&-xi),
        );
        normal += left.transpose() * left;
        let gain = left.transpose() * right;
        middle += gain * each.covariance() * gain.transpose();
    }
    let inverse = normal.try_inverse().unwrap();
    let expected = inverse * middle * inverse;
    assert!(relative(found.covariance(), &expected) < 1e-12);
}

#[test]
fn monte_carlo_confirms_the_covariance_of_the_average() {
    let mut random = Random(16);
    let truth = Isometry3::translation(0.05, -0.02, 0.6);
    let unit = exact().unit;
    let sizes = [0.02, 0.06, 0.1];
    let covariances = sizes.map(|s| unit.at(&truth) * (s * s));
    let roots = covariances.map(|c| c.cholesky().unwrap().l());
    for make in [BatchFuser::average as fn(_) -> _, |config| {
        BatchFuser::weighted_average(config)
    }] {
        let mut nees = 0.0;
        let runs = 3000;
        for _ in 0..runs {
            let estimates: Vec<PoseEstimate> = covariances
                .iter()
                .zip(&roots)
                .map(|(covariance, root)| {
                    let error = root * Vector6::from_fn(|_, _| random.normal());
                    estimate(se3::exp(&error) * truth, *covariance)
                })
                .collect();
            let found = run(
                &mut make(FuserConfig {
                    unit,
                    ..FuserConfig::default()
                }),
                &estimates,
            );
            let error = se3::log(&(found.camera_from_object() * truth.inverse()));
            nees += error.dot(&(found.covariance().try_inverse().unwrap() * error));
        }
        let mean = nees / f64::from(runs);
        // Standard error √(12/3000) = 0.063.
        assert!((mean - 6.0).abs() < 0.25, "{mean}");
    }
}

#[test]
fn filtering_equals_the_batch_to_second_order() {
    for (recursive, batch) in [
        (
            RecursiveFuser::filtering as fn(_) -> _,
            BatchFuser::weighted_average as fn(_) -> _,
        ),
        (RecursiveFuser::filtering_constant, BatchFuser::average),
    ] {
        let differences = [0.1, 0.01].map(|spread| {
            // The same scatter at two sizes.
            let estimates = Random(170).estimates(6, spread);
            let one = run(&mut recursive(exact()), &estimates);
            let all = run(&mut batch(exact()), &estimates);
            assert!(relative(one.covariance(), all.covariance()) < 2.0 * spread);
            apart(one.camera_from_object(), all.camera_from_object())
        });
        let [coarse, fine] = differences;
        assert!(coarse < 0.03, "{coarse}");
        // A tenth of the spread, a hundredth of the difference.
        assert!(fine < coarse / 50.0, "{coarse} {fine}");
    }
    // Exact if the poses commute.
    let mut random = Random(17);
    let estimates: Vec<PoseEstimate> = (0..6)
        .map(|_| {
            let pose = Isometry3::translation(random.uniform(), random.uniform(), random.uniform());
            estimate(pose, Matrix6::identity() * (0.1 + random.uniform().abs()))
        })
        .collect();
    let one = run(&mut RecursiveFuser::filtering(exact()), &estimates);
    let all = run(&mut BatchFuser::weighted_average(exact()), &estimates);
    assert!(apart(one.camera_from_object(), all.camera_from_object()) < 1e-13);
}

#[test]
fn a_window_drops_the_oldest() {
    let estimates = Random(21).estimates(7, 0.2);
    let config = FuserConfig {
        window: Some(3),
        ..exact()
    };
    let mut fuser = BatchFuser::weighted_average(config);
    let found = run(&mut fuser, &estimates);
    assert_eq!(fuser.len(), 3);
    let expected = fused(&estimates[4..]);
    assert!(
        apart(
            found.camera_from_object(),
            expected.estimate.camera_from_object()
        ) < 1e-12
    );
}

#[test]
fn the_unit_around_an_object_does_not_depend_on_the_camera() {
    let mut random = Random(22);
    let unit = exact().unit;
    for _ in 0..20 {
        let (pose, motion) = (random.motion(1.0), random.motion(1.0));
        let adjoint = se3::adjoint(&motion);
        let carried = adjoint * unit.at(&pose) * adjoint.transpose();
        assert!(relative(&unit.at(&(motion * pose)), &carried) < 1e-13);
    }
    // At the camera's origin and without a center, it is the documented diagonal.
    let plain = UnitCovariance::about_object(Point3::origin(), 0.1).unwrap();
    let expected = Matrix6::from_diagonal(&Vector6::new(0.01, 0.01, 0.01, 1.0, 1.0, 1.0));
    assert!((plain.at(&Isometry3::identity()) - expected).amax() < 1e-15);
    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(UnitCovariance::about_object(Point3::origin(), radius).is_err());
    }
    for x in [f64::NAN, f64::NEG_INFINITY, -2e6] {
        let error = UnitCovariance::about_object(Point3::new(0.0, x, 3.0), 0.1).unwrap_err();
        assert_eq!(
            error.to_string(),
            format!(
                "largest coordinate of the object's center is {}, expected 0 to 1e6 m",
                x.abs()
            )
        );
    }
}

#[test]
fn the_covariance_models_equal_their_formulas() {
    let unit = exact().unit;
    let pose = Isometry3::translation(0.1, 0.0, 0.7);
    let registration = Random(23).covariance(1e-3);
    let one = unit.at(&pose);
    let mve = MveCovariance { unit, floor: 0.01 };
    for (e, factor) in [
        (Some(0.3), 0.3),
        (Some(0.001), 0.01),
        (None, 1.0),
        (Some(f64::NAN), 1.0),
    ] {
        assert!(relative(&mve.covariance(&pose, e), &(one * factor)) < 1e-15);
    }
    let inflated = InflatedCovariance {
        unit,
        scale: 3.0,
        floor: 0.1,
        mve_gain: 3.0,
        mve_power: 1.0,
        undetermined: 0.5,
    };
    let found = inflated.covariance(&pose, Some(0.2), Some(&registration));
    assert!(relative(&found, &(registration * 9.0 + one * (0.01 + 0.36))) < 1e-14);
    let found = inflated.covariance(&pose, Some(0.2), None);
    assert!(relative(&found, &(one * (0.25 + 0.36))) < 1e-14);
    let model = CovarianceModel::Inflated(inflated);
    assert_eq!(model.covariance(&pose, Some(0.2), None), found);
    assert_eq!(
        CovarianceModel::Constant(unit).covariance(&pose, None, None),
        one
    );
    let paper = CovarianceModel::default().covariance(&pose, Some(0.5), Some(&registration));
    assert_eq!(paper, Matrix6::identity() * 0.5);
}

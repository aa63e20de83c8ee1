//! Tests of Barfoot & Furgale's fusion: the golden case, and properties that hold for any
//! estimates.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::common::{EXACT, Random, apart, estimate, fused, fusion, relative};
use hicp_core::{Isometry3, Matrix6, Vector3, Vector6, se3};
use hicp_fusion::{FusionError, FusionLimits, PoseEstimate, fuse};

/// The published setup with measurements that are not random: T_k = exp((chol(Σ_k) z_k)^) T_true.
fn golden() -> Vec<PoseEstimate> {
    let truth = se3::exp(&Vector6::new(1.0, 0.0, 0.0, 0.0, 0.0, PI / 6.0));
    let alpha = 5.0;
    [
        (
            Vector6::new(2.0, 1.0, 1.0, 0.1, 0.2, 0.1),
            Vector6::new(0.3, -0.5, 0.2, 0.1, -0.2, 0.4),
        ),
        (
            Vector6::new(1.0, 3.0, 1.0, 0.1, 0.1, 0.2),
            Vector6::new(-0.6, 0.1, 0.7, -0.3, 0.2, 0.1),
        ),
        (
            Vector6::new(1.0, 1.0, 5.0, 0.2, 0.1, 0.1),
            Vector6::new(0.2, 0.4, -0.1, 0.2, 0.5, -0.3),
        ),
    ]
    .map(|(variances, z)| {
        let variances = variances * alpha;
        let error = variances.map(f64::sqrt).component_mul(&z);
        estimate(se3::exp(&error) * truth, Matrix6::from_diagonal(&variances))
    })
    .to_vec()
}

#[test]
fn the_golden_case() {
    let fusion = fusion(&golden(), FusionLimits::default());
    let fused = fusion.solve(&Isometry3::identity()).unwrap();
    assert!(fused.solution.converged);
    let xi = se3::log(fused.estimate.camera_from_object());
    let expected = Vector6::new(
        0.681_843_539_433,
        0.094_852_340_287,
        0.770_953_360_230,
        0.015_108_993_334,
        0.161_961_486_905,
        0.566_440_226_077,
    );
    assert!((xi - expected).amax() < 1e-11, "{xi}");
    assert!((fused.solution.cost - 0.840_676_263_287).abs() < 1e-12);
    let matrix = fused.estimate.camera_from_object().to_homogeneous();
    let expected = nalgebra::Matrix4::new(
        0.831_422_014_464,
        -0.533_027_607_175,
        0.156_904_441_789,
        0.678_749_237_635,
        0.535_404_671_738,
        0.844_051_660_750,
        0.030_308_933_756,
        0.283_651_563_486,
        -0.148_590_953_107,
        0.058_807_856_391,
        0.987_148_603_140,
        0.717_052_790_100,
        0.0,
        0.0,
        0.0,
        1.0,
    );
    assert!((matrix - expected).amax() < 1e-11, "{matrix}");
    let diagonal = Vector6::new(
        1.997_833_854_143,
        2.187_809_362_205,
        2.287_572_748_676,
        0.192_983_593_668,
        0.189_854_178_401,
        0.193_414_758_079,
    );
    let covariance = fused.estimate.covariance();
    assert!((covariance.diagonal() - diagonal).amax() < 1e-9);
    for (found, expected) in [
        (covariance[(0, 1)], -0.054_374_795_264),
        (covariance[(1, 5)], 0.066_021_755_854),
        (covariance.trace(), 7.049_468_495_172),
        (covariance.norm(), 3.772_056_373_202),
    ] {
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }
}

#[test]
fn the_costs_of_the_golden_case_iteration_by_iteration() {
    // Invariant of the method: the plain Gauss–Newton step, so the costs are those of the published
    // iteration.
    let expected = [
        2.016_058_13,
        0.843_684_31,
        0.840_686_58,
        0.840_676_30,
        0.840_676_26,
    ];
    for (max_iterations, expected) in (1..).zip(expected) {
        let limits = FusionLimits {
            max_iterations,
            ..FusionLimits::default()
        };
        let fusion = fusion(&golden(), limits);
        let fused = fusion.solve(&Isometry3::identity()).unwrap();
        assert!((fused.solution.cost - expected).abs() < 1e-8, "{fused:?}");
        assert_eq!(fused.solution.iterations, max_iterations);
        // Running out of evaluations is reported.
        assert!(!fused.solution.converged);
    }
}

#[test]
fn the_gradient_is_zero_at_the_result() {
    let mut random = Random(1);
    for spread in [0.05, 0.4, 1.0] {
        let estimates = random.estimates(6, spread);
        let fusion = fusion(&estimates, EXACT);
        let fused = fused(&estimates);
        let hessian = fused.estimate.covariance().try_inverse().unwrap();
        for axis in 0..6 {
            let h = 1e-4 * spread;
            let mut step = Vector6::zeros();
            step[axis] = h;
            let at = |step: Vector6<f64>| {
                fusion.cost(&(se3::exp(&step) * fused.estimate.camera_from_object()))
            };
            let (ahead, behind) = (at(step), at(-step));
            let gradient = (ahead - behind) / (2.0 * h);
            // A step of the wrong sign would leave a gradient of the order of the spread.
            assert!(
                gradient.abs() < 1e-5 * hessian[(axis, axis)] * spread,
                "{spread} {axis}: {gradient}"
            );
            assert!(ahead.min(behind) > fused.solution.cost);
        }
    }
}

#[test]
fn identical_poses_have_a_kth_of_the_covariance() {
    let mut random = Random(2);
    let (pose, covariance) = (random.motion(1.0), random.covariance(0.3));
    for count in [1_u32, 2, 7] {
        let estimates = vec![estimate(pose, covariance); count as usize];
        let fused = fused(&estimates);
        assert!(apart(fused.estimate.camera_from_object(), &pose) < 1e-15);
        let expected = covariance / f64::from(count);
        assert!(relative(fused.estimate.covariance(), &expected) < 1e-13);
        assert!(fused.solution.cost < 1e-28);
    }
}

#[test]
fn neither_the_order_nor_the_start_matters() {
    let mut random = Random(3);
    let estimates = random.estimates(6, 0.4);
    let expected = fused(&estimates);
    for _ in 0..20 {
        let mut shuffled = estimates.clone();
        shuffled.sort_by_cached_key(|_| random.uniform().to_bits());
        let fusion = fusion(&shuffled, EXACT);
        let start = random.motion(0.7) * expected.estimate.camera_from_object();
        let found = fusion.solve(&start).unwrap();
        assert!(
            apart(
                found.estimate.camera_from_object(),
                expected.estimate.camera_from_object()
            ) < 1e-14
        );
        assert!(relative(found.estimate.covariance(), expected.estimate.covariance()) < 1e-13);
    }
}

#[test]
fn fusing_is_equivariant_under_the_adjoint() {
    let mut random = Random(4);
    for _ in 0..20 {
        let estimates = random.estimates(5, 0.3);
        let motion = random.motion(1.5);
        let adjoint = se3::adjoint(&motion);
        let carried = |covariance: &Matrix6<f64>| adjoint * covariance * adjoint.transpose();
        let moved: Vec<PoseEstimate> = estimates
            .iter()
            .map(|e| estimate(motion * e.camera_from_object(), carried(e.covariance())))
            .collect();
        let (here, there) = (fused(&estimates), fused(&moved));
        let expected = motion * here.estimate.camera_from_object();
        assert!(apart(there.estimate.camera_from_object(), &expected) < 1e-13);
        assert!(
            relative(
                there.estimate.covariance(),
                &carried(here.estimate.covariance())
            ) < 1e-12
        );

        // The covariances cause this: if they are kept, the result differs.
        let kept: Vec<PoseEstimate> = estimates
            .iter()
            .map(|e| estimate(motion * e.camera_from_object(), *e.covariance()))
            .collect();
        assert!(apart(fused(&kept).estimate.camera_from_object(), &expected) > 1e-4);
    }
}

#[test]
fn a_single_estimate_is_returned_unchanged() {
    let mut random = Random(5);
    let only = random.estimates(1, 0.3);
    let fusion = fusion(&only, EXACT);
    let fused = fusion.solve(&random.motion(0.7)).unwrap();
    assert!(
        apart(
            fused.estimate.camera_from_object(),
            only[0].camera_from_object()
        ) < 1e-14
    );
    assert!(relative(fused.estimate.covariance(), only[0].covariance()) < 1e-12);
    assert_eq!(fuse(&[], EXACT), Err(FusionError::Empty));
}

#[test]
fn the_covariance_of_a_mean_is_that_of_its_estimates() {
    let (pose, certain) = (
        Isometry3::translation(0.1, 0.0, 0.5),
        Matrix6::identity() * 1e-6,
    );
    let own = [certain, certain * 3.0];
    let fusion = fusion(&[estimate(pose, Matrix6::identity()); 2], EXACT);
    let fused = fusion.solve(&pose).unwrap().estimate;
    // The variance of a mean: (1 + 3)/4.
    let found = fusion.covariance_from(&fused, own.iter());
    assert!((found - certain).amax() < 1e-15);
}

#[test]
fn one_wild_outlier_is_averaged_in_by_its_covariance() {
    let mut random = Random(6);
    let pose = random.motion(1.0);
    let wild = random.motion(1.0) * pose;
    let mut estimates = vec![estimate(pose, Matrix6::identity() * 1e-4); 9];
    // As certain as the others: it moves the pose by about a tenth of the distance.
    estimates.push(estimate(wild, Matrix6::identity() * 1e-4));
    let dragged = fused(&estimates);
    let share = apart(dragged.estimate.camera_from_object(), &pose) / apart(&wild, &pose);
    assert!((0.05..0.2).contains(&share), "{share}");
    // With a hundred times the standard deviation, it hardly counts: its weight is a 90,000th.
    estimates[9] = estimate(wild, Matrix6::identity());
    let share = apart(fused(&estimates).estimate.camera_from_object(), &pose) / apart(&wild, &pose);
    assert!(share < 1e-4, "{share}");
}

#[test]
fn estimates_spread_over_half_a_turn() {
    // V has several minima here, and corners where a logarithm jumps from π to −π. For every
    // minimum, there must be no NaN and no rise of V, and a zero gradient if convergence is
    // reported.
    let about = |degrees: f64| Isometry3::rotation(Vector3::z() * degrees.to_radians());
    for (angles, start) in [
        (vec![0.0, 179.0], 0.0),
        (vec![0.0, 179.9, -179.9], 0.0),
        (vec![0.0, 180.0], 0.0),
        (vec![0.0, 90.0, 180.0, 270.0], 10.0),
        (vec![-170.0, 170.0], 0.0),
    ] {
        let estimates: Vec<PoseEstimate> = angles
            .iter()
            .map(|a| estimate(about(*a), Matrix6::identity() * 0.01))
            .collect();
        let fusion = fusion(&estimates, FusionLimits::default());
        let fused = fusion.solve(&about(start)).unwrap();
        assert!(se3::is_finite(fused.estimate.camera_from_object()));
        assert!(fused.estimate.covariance().iter().all(|x| x.is_finite()));
        assert!(
            fused.solution.cost <= fusion.cost(&about(start)),
            "{fused:?}"
        );
        if fused.solution.converged {
            let h = 1e-5;
            let at = |step: f64| {
                fusion.cost(
                    &(Isometry3::rotation(Vector3::z() * step)
                        * fused.estimate.camera_from_object()),
                )
            };
            let gradient = (at(h) - at(-h)) / (2.0 * h);
            assert!(gradient.abs() < 1e-3, "{angles:?}: {gradient} {fused:?}");
        }
    }
    let pair = [
        estimate(about(0.0), Matrix6::identity() * 0.01),
        estimate(about(179.0), Matrix6::identity() * 0.01),
    ];
    let fused = fused(&pair);
    let angle = fused.estimate.camera_from_object().rotation.angle();
    assert!((angle - 89.5_f64.to_radians()).abs() < 1e-12, "{angle}");
    // At half a turn, and on either side of the cut, the mean is between them and not at zero.
    let pair = [
        estimate(about(170.0), Matrix6::identity() * 0.01),
        estimate(about(-170.0), Matrix6::identity() * 0.01),
    ];
    let angle = crate::common::fused(&pair)
        .estimate
        .camera_from_object()
        .rotation
        .angle();
    assert!((angle - PI).abs() < 1e-12, "{angle}");
    assert!(angle > FRAC_PI_2);
}

#[test]
fn zero_and_huge_covariances() {
    let mut random = Random(7);
    let poses = [random.motion(0.3), random.motion(0.3), random.motion(0.3)];
    let unit = Matrix6::identity() * 1e-2;
    let with = |covariances: [Matrix6<f64>; 3]| {
        let estimates: Vec<PoseEstimate> = poses
            .iter()
            .zip(covariances)
            .map(|(pose, covariance)| estimate(*pose, covariance))
            .collect();
        fuse(&estimates, FusionLimits::default()).unwrap()
    };
    // An exact estimate decides.
    let exact = with([Matrix6::zeros(), unit, unit]);
    assert!(apart(exact.estimate.camera_from_object(), &poses[0]) < 1e-9);
    assert!(exact.solution.converged);
    // Two exact ones are averaged.
    let two = with([Matrix6::zeros(), Matrix6::zeros(), unit]);
    let mean = fused(&[estimate(poses[0], unit), estimate(poses[1], unit)]);
    assert!(
        apart(
            two.estimate.camera_from_object(),
            mean.estimate.camera_from_object()
        ) < 1e-9
    );
    // An estimate without information changes nothing.
    let huge = with([unit, unit, Matrix6::identity() * 1e30]);
    assert!(
        apart(
            huge.estimate.camera_from_object(),
            mean.estimate.camera_from_object()
        ) < 1e-12
    );
    // If none has information, the result is their average.
    for factor in [1e30, 1e60] {
        let all = with([Matrix6::identity() * factor; 3]);
        let alike = with([unit; 3]);
        assert!(
            apart(
                all.estimate.camera_from_object(),
                alike.estimate.camera_from_object()
            ) < 1e-9
        );
        let ratio = all.estimate.covariance()[(0, 0)] / factor;
        assert!((0.2..0.5).contains(&ratio), "{ratio}");
    }
    // Known only in some directions: the others come from elsewhere.
    let mut partly = Matrix6::zeros();
    partly[(2, 2)] = 1e30;
    let split = with([partly, unit, unit]);
    let difference = se3::log(&(split.estimate.camera_from_object() * poses[0].inverse()));
    assert!(difference.fixed_rows::<2>(0).norm() < 1e-6, "{difference}");
    assert!(difference.fixed_rows::<3>(3).norm() < 1e-6, "{difference}");
    assert!(difference[2].abs() > 1e-3, "{difference}");
}

#[test]
fn the_mean_cost_is_that_of_its_degrees_of_freedom() {
    // V is half a χ² of 6K − 6 degrees of freedom if the noise is small: 6 for three estimates.
    let mut random = Random(8);
    let truth = random.motion(1.0);
    let runs = 2000;
    let (mut total, mut covered) = (0.0, 0.0);
    for _ in 0..runs {
        let estimates: Vec<PoseEstimate> = (0..3)
            .map(|_| {
                let covariance = random.covariance(0.02);
                let root = covariance.cholesky().unwrap().l();
                let error = root * Vector6::from_fn(|_, _| random.normal());
                estimate(se3::exp(&error) * truth, covariance)
            })
            .collect();
        let fused = fuse(&estimates, FusionLimits::default()).unwrap();
        total += fused.solution.cost;
        let error = se3::log(&(fused.estimate.camera_from_object() * truth.inverse()));
        covered += error.dot(&(fused.estimate.covariance().try_inverse().unwrap() * error));
    }
    // Standard errors: √(6/2000) = 0.055 and √(12/2000) = 0.077.
    let (cost, nees) = (total / f64::from(runs), covered / f64::from(runs));
    assert!((cost - 6.0).abs() < 0.22, "{cost}");
    assert!((nees - 6.0).abs() < 0.31, "{nees}");
}

#[test]
fn invalid_estimates_are_refused() {
    let pose = Isometry3::translation(0.0, 0.0, 0.5);
    let unit = Matrix6::identity();
    let nan = Isometry3::translation(0.0, f64::NAN, 0.5);
    assert!(matches!(
        PoseEstimate::new(nan, unit),
        Err(FusionError::Translation { .. })
    ));
    let far = Isometry3::translation(0.0, 1e300, 0.5);
    assert!(PoseEstimate::new(far, unit).is_err());
    let mut turned = pose;
    turned.rotation = hicp_core::UnitQuaternion::new(Vector3::new(f64::NAN, 0.0, 0.0));
    assert!(matches!(
        PoseEstimate::new(turned, unit),
        Err(FusionError::Rotation { .. })
    ));
    for value in [f64::NAN, f64::INFINITY, 1e200] {
        let mut covariance = unit;
        covariance[(3, 4)] = value;
        assert!(matches!(
            PoseEstimate::new(pose, covariance),
            Err(FusionError::CovarianceEntry {
                row: 3,
                column: 4,
                ..
            })
        ));
    }
    let mut lopsided = unit;
    lopsided[(5, 0)] = 0.1;
    assert!(matches!(
        PoseEstimate::new(pose, lopsided),
        Err(FusionError::CovarianceAsymmetric {
            row: 5,
            column: 0,
            ..
        })
    ));
    let negative = Matrix6::from_diagonal(&Vector6::new(1.0, 1.0, 1.0, 1.0, 1.0, -0.5));
    let Err(error) = PoseEstimate::new(pose, negative) else {
        panic!("accepted")
    };
    assert_eq!(
        error.to_string(),
        "covariance has the eigenvalue -0.5, expected 0 or more"
    );
    for mve in [f64::NAN, -0.1, 1.5] {
        let estimate = estimate(pose, unit).with_mve(mve);
        assert!(matches!(estimate, Err(FusionError::Mve { .. })));
    }
}

/// Regular covariances are used as they are, however small. Only those that are singular to working
/// precision are raised.
#[test]
fn small_regular_covariances_keep_their_weight() {
    // Far below the floor of singular ones: standard deviations of 1e-8 and 2e-8.
    let covariance = |deviation: f64| Matrix6::identity() * (deviation * deviation);
    let offset = Vector6::new(1e-9, 0.0, 0.0, 0.0, 0.0, 0.0);
    let estimates = [
        estimate(Isometry3::identity(), covariance(1e-8)),
        estimate(se3::exp(&offset), covariance(2e-8)),
    ];
    let both = fusion(&estimates, EXACT)
        .solve(&Isometry3::identity())
        .unwrap();
    // A fifth of the distance, since the weights are as four to one.
    let x = both.estimate.camera_from_object().translation.x;
    assert!((x - 0.2e-9).abs() < 1e-14, "{x}");
    let expected = covariance(1e-8) * 0.8;
    assert!(relative(both.estimate.covariance(), &expected) < 1e-6);
}

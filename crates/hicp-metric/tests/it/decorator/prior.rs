//! Tests of the prior and its limits.

use crate::scenes::{AtStart, Numbers, at, center, difference, posed, surfel};
use hicp_core::Iteration;
use hicp_core::{
    Correspondences, Isometry3, Matrix6, Pair, Point3, Problem, Vector3, Vector6, se3,
};
use hicp_metric::Minimize;
use hicp_metric::{
    GaussNewton, NormalEquations, PointToPlane, PointToPoint, PosePrior, Prior, Robust, WeightedSum,
};

fn prior<M>(metric: M, mean: &Isometry3<f64>, information: Matrix6<f64>) -> PosePrior<M> {
    let prior = Prior::Gaussian {
        camera_from_object: *mean,
        information,
    };
    PosePrior::new(metric, prior, 1e-3)
}

/// Returns a full positive definite matrix, which is not diagonal.
fn random_information(numbers: &mut Numbers, size: f64) -> Matrix6<f64> {
    let m = Matrix6::from_fn(|_, _| numbers.sign());
    (m * m.transpose() + Matrix6::identity() * 0.1) * size
}

#[test]
fn without_information_it_equals_the_inner_metric() {
    let mut numbers = Numbers(61);
    let pairs = posed(&mut numbers, 80);
    let elsewhere = numbers.motion(&center(), 50.0, 0.3);
    let mut flat = prior(PointToPoint, &elsewhere, Matrix6::zeros());
    assert_eq!(flat.step(&pairs), PointToPoint.step(&pairs));
    assert_eq!(
        flat.normal_equations(&pairs),
        PointToPoint.normal_equations(&pairs)
    );
    let mut default = PosePrior::<PointToPlane>::default();
    assert_eq!(default.step(&pairs), PointToPlane.step(&pairs));
    // Very little information changes very little.
    let mut weak = prior(PointToPlane, &elsewhere, Matrix6::identity() * 1e-9);
    let (a, b) = (
        weak.step(&pairs).unwrap(),
        PointToPlane.step(&pairs).unwrap(),
    );
    assert!(difference(&a.increment, &b.increment).0 < 1e-9);
}

#[test]
fn a_strong_prior_fixes_the_pose() {
    let mut numbers = Numbers(62);
    for degrees in [0.0, 1.0, 30.0, 120.0] {
        let pairs = posed(&mut numbers, 80);
        let pose = *pairs.camera_from_object();
        let mean = numbers.motion(&center(), degrees, 0.05) * pose;
        let information = random_information(&mut numbers, 1e16);
        let mut pinned = prior(PointToPlane, &mean, information);
        let next = pinned.step(&pairs).unwrap().increment * pose;
        let (angle, distance) = se3::pose_distance(&next, &mean);
        assert!(
            angle < 1e-7 && distance < 1e-7,
            "{degrees}: {angle} {distance}"
        );
    }
}

/// Directions without prior information are refined as without a prior, for any stiffness of the
/// others.
#[test]
fn a_prior_of_one_direction_does_not_damp_the_others() {
    let mut numbers = Numbers(63);
    let pairs = posed(&mut numbers, 80);
    let step = |stiffness| {
        let mut information = Matrix6::zeros();
        information[(2, 2)] = stiffness;
        let mut metric = prior(PointToPlane, pairs.camera_from_object(), information);
        se3::log(&metric.step(&pairs).unwrap().increment)
    };
    // The information of the data is about 60 here, that of the prior 10⁶ and 10⁹.
    let (stiff, stiffer) = (step(1e12), step(1e15));
    assert!(stiffer[2].abs() < 1e-9);
    assert!(
        (stiff - stiffer).norm() < 1e-3 * stiff.norm(),
        "{stiff} {stiffer}"
    );
}

/// At the minimum, the slope of the documented sum vanishes: data loss over σ² plus the square of
/// the logarithm.
#[test]
fn the_minimum_is_that_of_the_documented_sum() {
    let mut numbers = Numbers(64);
    for _ in 0..5 {
        let pairs = posed(&mut numbers, 80);
        let pose = *pairs.camera_from_object();
        let mean = numbers.motion(&center(), 20.0, 0.02) * pose;
        let information = random_information(&mut numbers, 1e5);
        let mut metric = GaussNewton::new(prior(PointToPoint, &mean, information));
        metric.max_iterations = 30;
        metric.tolerance = 0.0;
        let increment = metric.step(&pairs).unwrap().increment;
        let sigma = metric.metric.sigma_meters;
        let sum = |t: &Isometry3<f64>| {
            let data: f64 = pairs
                .as_slice()
                .iter()
                .map(|pair| {
                    let d = t * pair.source.point.cast::<f64>() - pair.target.point.cast::<f64>();
                    f64::from(pair.weight) * d.norm_squared()
                })
                .sum();
            let xi = se3::log(&(t * pose * mean.inverse()));
            data + sigma * sigma * xi.dot(&(information * xi))
        };
        let slope = |t: &Isometry3<f64>, i: usize| {
            let mut twist = Vector6::zeros();
            twist[i] = 1e-5;
            (sum(&(se3::exp(&twist) * t)) - sum(&(se3::exp(&-twist) * t))) / 2e-5
        };
        for i in 0..6 {
            let (start, end) = (slope(&Isometry3::identity(), i), slope(&increment, i));
            assert!(
                end.abs() < 1e-4 * start.abs().max(0.01),
                "{i}: {start} {end}"
            );
        }
        let weight: f64 = pairs.as_slice().iter().map(|p| f64::from(p.weight)).sum();
        let mean_loss = metric.step(&pairs).unwrap().mean_loss;
        let expected = sum(&Isometry3::identity()) / weight;
        assert!((mean_loss - expected).abs() < 1e-9 * expected);
    }
}

#[test]
fn information_adds_up() {
    let mut numbers = Numbers(65);
    let pairs = posed(&mut numbers, 80);
    let information = random_information(&mut numbers, 1e5);
    // At the mean, the left Jacobian is the identity.
    let mut metric = prior(PointToPlane, pairs.camera_from_object(), information);
    let sum = metric.normal_equations(&pairs).unwrap().information();
    let expected =
        PointToPlane.normal_equations(&pairs).unwrap().information() + information * 1e-6;
    assert!((sum - expected).amax() < 1e-12 * expected.amax());
}

#[test]
fn a_prior_replaces_rows_but_not_pairs() {
    let mut numbers = Numbers(66);
    let pairs = posed(&mut numbers, 2);
    let mut metric = prior(
        PointToPlane,
        pairs.camera_from_object(),
        Matrix6::identity(),
    );
    assert_eq!(PointToPlane.step(&pairs), None);
    assert!(metric.step(&pairs).is_some());
    assert_eq!(metric.step(&Correspondences::new()), None);
}

#[test]
fn a_boxed_or_decorated_prior_stays_in_effect() {
    let mut numbers = Numbers(67);
    let pairs = posed(&mut numbers, 80);
    let pose = *pairs.camera_from_object();
    let mean = numbers.motion(&center(), 3.0, 0.01) * pose;
    let pin = prior(
        Robust::<PointToPlane>::default(),
        &mean,
        Matrix6::identity() * 1e16,
    );
    let mut boxed: Box<dyn Minimize> = Box::new(pin.clone());
    assert_eq!(boxed.step(&pairs), pin.clone().step(&pairs));
    assert_eq!(boxed.loss(&pairs), pin.clone().loss(&pairs));
    let metrics: [Box<dyn Minimize>; 3] = [
        Box::new(GaussNewton::new(pin.clone())),
        Box::new(hicp_metric::LevenbergMarquardt::new(pin.clone())),
        Box::new(hicp_metric::Conditioned {
            metric: pin,
            ..Default::default()
        }),
    ];
    for mut metric in metrics {
        let next = metric.step(&pairs).unwrap().increment * pose;
        let (angle, distance) = se3::pose_distance(&next, &mean);
        assert!(
            angle < 1e-5 && distance < 1e-5,
            "{}: {angle} {distance}",
            metric.label()
        );
    }
}

/// A prior around the initial pose is the documented Gaussian: of the object's origin, and of
/// rotations around it.
#[test]
fn a_prior_around_the_initial_pose() {
    let mut numbers = Numbers(68);
    let pairs = posed(&mut numbers, 80);
    let pose = *pairs.camera_from_object();
    let init = numbers.motion(&center(), 4.0, 0.01) * pose;
    let (translation_meters, rotation_degrees) = (0.004, 3.0);
    let prior = Prior::AboutInitial {
        translation_meters,
        rotation_degrees,
    };
    let mut metric = PosePrior::new(PointToPlane, prior, 1e-3);
    let at = |index, init| Iteration::new(index, init, Problem::default());
    let weight: f64 = pairs.as_slice().iter().map(|p| f64::from(p.weight)).sum();
    let loss =
        metric.mean_loss(&at(0, &init), &pairs).unwrap() - PointToPlane.loss(&pairs).unwrap();
    // To first order, the twist around the object's origin is its displacement and the rotation
    // vector. 4° and 1 cm are small.
    let turn = (pose.rotation * init.rotation.inverse()).scaled_axis();
    let moved = pose.translation.vector - init.translation.vector;
    let expected = moved.norm_squared() / translation_meters.powi(2)
        + turn.norm_squared() / rotation_degrees.to_radians().powi(2);
    let found = loss * weight * 1e6;
    assert!(
        (found - expected).abs() < 0.05 * expected,
        "{found} {expected}"
    );
    // It depends on the initial pose of the stage, and not on the iteration or on earlier calls.
    let mut fresh = PosePrior::new(PointToPlane, prior, 1e-3);
    assert_eq!(
        metric.minimize(&at(7, &pose), &pairs),
        fresh.minimize(&at(0, &pose), &pairs)
    );
}

/// Along directions that only the prior determines, the covariance is that of the prior, for every
/// size of the residuals.
#[test]
fn residuals_do_not_scale_the_covariance_of_a_prior() {
    let pose = Isometry3::translation(0.0, 0.0, 0.5);
    let iteration = Iteration::new(0, &pose, Problem::default());
    let prior = Prior::AboutInitial {
        translation_meters: 0.005,
        rotation_degrees: 5.0,
    };
    for noise in [1e-4, 1e-3, 1e-2] {
        let mut numbers = Numbers(69);
        let plane: Correspondences = (0..200)
            .map(|i| {
                let (x, y) = (numbers.sign() * 0.05, numbers.sign() * 0.05);
                let at = |z| surfel(Point3::new(x, y, z), -Vector3::z());
                Pair::new(i, at(0.5), i, at(0.5 + noise * numbers.normal()))
            })
            .collect();
        let pairs = at(&pose, &plane);
        let mut metric = PosePrior::new(PointToPlane, prior, 1e-3);
        let system = metric.system(&iteration, &pairs).unwrap();
        // Around the object's origin instead of the camera's.
        let adjoint = se3::adjoint(&pose.inverse());
        let found = adjoint * system.covariance().unwrap() * adjoint.transpose();
        for (i, sigma) in [(0, 0.005), (1, 0.005), (5, 5_f64.to_radians())] {
            let found = found[(i, i)].sqrt();
            assert!(
                (found - sigma).abs() < 1e-5 * sigma,
                "{noise}: {found} instead of {sigma}"
            );
        }
    }
}

/// Σ⁻¹ = JᵀWJ/σ² + Λ, also if a sum of metrics scales or joins the systems.
#[test]
fn the_covariance_is_that_of_the_posterior() {
    let mut numbers = Numbers(70);
    let pairs = posed(&mut numbers, 80);
    let information = random_information(&mut numbers, 1e5);
    let mut metric = prior(PointToPlane, pairs.camera_from_object(), information);
    metric.sigma_meters = 2e-3;
    let system = |metric: &mut dyn Minimize| metric.normal_equations(&pairs).unwrap();
    let data = system(&mut PointToPlane).information();
    let both = data + system(&mut PointToPoint).information();
    let check = |system: NormalEquations, data: Matrix6<f64>| {
        let product = system.covariance().unwrap() * (data / 4e-6 + information);
        let difference = (product - Matrix6::identity()).amax();
        assert!(difference < 1e-8, "{difference}");
    };
    check(system(&mut metric), data);
    // Weights that count a quarter have a σ of one half, for equal standard deviations.
    let terms = ((0.25, metric),);
    check(system(&mut WeightedSum { terms }), data);
    let terms = ((0.25, metric), (0.25, PointToPoint));
    check(system(&mut WeightedSum { terms }), both);
    let terms = ((0.25, PointToPoint), (0.25, metric));
    check(system(&mut WeightedSum { terms }), both);
}

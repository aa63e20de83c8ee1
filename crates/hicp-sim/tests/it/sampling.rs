//! Distributions of random samples, and guarantees of cases.

use hicp_core::{Mask, Model, PinholeCamera, Point3, Vector3, se3};
use hicp_sim::{
    CaseConfig, CaseMaker, Corruption, DepthNoise, DepthSensor, Household, InitialPose,
    MaskDefects, RelativeGaussian, SimError, VsdBins, object_pose, perturb, rng, rotation,
    rotation_of, unit_vector,
};

const SAMPLES: u32 = 4000;

/// Returns the Kolmogorov-Smirnov statistic times √n: the largest distance between the empirical
/// distribution and a distribution function.
fn ks(mut samples: Vec<f64>, distribution: impl Fn(f64) -> f64) -> f64 {
    samples.sort_by(f64::total_cmp);
    let n = samples.len() as f64;
    let gap = samples.iter().zip(0_u32..).map(|(x, i)| {
        let (f, i) = (distribution(*x), f64::from(i));
        (f - i / n).max((i + 1.0) / n - f)
    });
    gap.fold(0.0, f64::max) * n.sqrt()
}

/// The value that √n D exceeds in one of 20 samples of the correct distribution. With the fixed
/// seeds, it is not exceeded.
const KS_LIMIT: f64 = 1.358;

fn assert_follows(what: &str, samples: Vec<f64>, distribution: impl Fn(f64) -> f64) {
    let value = ks(samples.clone(), &distribution);
    assert!(value < KS_LIMIT, "{what}: {value}");
    // The test has the power to detect a scale error of 8 %.
    let wrong = ks(samples.iter().map(|x| x * 1.08).collect(), &distribution);
    assert!(wrong > KS_LIMIT, "{what}: the test has no power, {wrong}");
}

#[test]
fn object_poses_have_the_distances_of_the_paper_and_any_orientation() {
    let mut rng = rng(21);
    let center = Point3::new(0.01, -0.02, 0.03);
    let poses: Vec<_> = (0..SAMPLES)
        .map(|_| object_pose(&mut rng, &center, 0.14..0.6, 0.02))
        .collect();
    let seen: Vec<_> = poses.iter().map(|pose| pose * center).collect();
    assert_follows("distance", seen.iter().map(|p| p.z).collect(), |z| {
        ((z - 0.14) / 0.46).clamp(0.0, 1.0)
    });
    let aside = seen.iter().map(|p| p.coords.xy().norm_squared());
    assert_follows("squared offset", aside.collect(), |r2| {
        (r2 / 0.0004).clamp(0.0, 1.0)
    });
    // The angle of a uniform rotation has the distribution function (θ − sin θ)/π.
    let angles = poses.iter().map(|pose| pose.rotation.angle());
    let uniform = |angle: f64| (angle - angle.sin()) / std::f64::consts::PI;
    assert_follows("angle", angles.collect(), uniform);
    for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
        let heights = poses.iter().map(|pose| (pose.rotation * axis).z);
        assert_follows("view direction", heights.collect(), |z| {
            f64::midpoint(z, 1.0).clamp(0.0, 1.0)
        });
    }
}

#[test]
fn perturbations_have_their_size_and_any_direction() {
    let mut rng = rng(22);
    let truth = object_pose(&mut rng, &Point3::origin(), 0.3..0.6, 0.02);
    let mut draw = || perturb(&mut rng, &truth, 0.0062, 0.3);
    let inits: Vec<_> = (0..SAMPLES).map(|_| draw()).collect();
    for init in &inits {
        let (angle, distance) = se3::pose_distance(init, &truth);
        assert!((angle - 0.3).abs() < 1e-9 && (distance - 0.0062).abs() < 1e-12);
    }
    let sphere = |z: f64| f64::midpoint(z, 1.0).clamp(0.0, 1.0);
    let shifts = inits
        .iter()
        .map(|i| (i.translation.vector - truth.translation.vector).z / 0.0062);
    assert_follows("direction of the shift", shifts.collect(), sphere);
    let axes = inits
        .iter()
        .map(|i| (truth.rotation.inverse() * i.rotation).axis().unwrap().x);
    assert_follows("axis of the turn", axes.collect(), sphere);
}

#[test]
fn directions_and_rotations_are_uniform() {
    let mut rng = rng(23);
    for k in 0..3 {
        let components = (0..SAMPLES).map(|_| unit_vector(&mut rng)[k]).collect();
        assert_follows("unit vector", components, |z| {
            f64::midpoint(z, 1.0).clamp(0.0, 1.0)
        });
    }
    let angles = (0..SAMPLES).map(|_| rotation(&mut rng).angle()).collect();
    assert_follows("rotation", angles, |a| (a - a.sin()) / std::f64::consts::PI);
}

#[test]
fn the_ratio_of_rotation_to_translation_is_that_of_the_paper() {
    assert!((rotation_of(0.001).to_degrees() - 1.92).abs() < 1e-12);
    assert!((rotation_of(0.15).to_degrees() - 288.0).abs() < 1e-9);
}

fn camera() -> PinholeCamera {
    PinholeCamera::new(143.1, 143.4, 81.3, 60.5, 160, 120).unwrap()
}

fn maker(init: InitialPose) -> CaseMaker {
    CaseMaker::new(CaseConfig::new(camera(), init)).unwrap()
}

fn binned() -> InitialPose {
    InitialPose::Binned(VsdBins::default())
}

#[test]
fn every_bin_of_every_object_is_filled() {
    let mut maker = maker(binned());
    for object in Household::ALL {
        let model = object.model().unwrap();
        for index in 0..10 {
            let case = maker.case(&model, object.name(), 3, index).unwrap();
            let bin = usize::try_from(index).unwrap();
            assert_eq!(case.bin, Some(bin), "{}", object.name());
            let low = 0.1 * index as f64;
            assert!(
                (low..=low + 0.1).contains(&case.vsd_initial),
                "{} is in no bin {bin}",
                case.vsd_initial
            );
            let (angle, distance) = se3::pose_distance(&case.init, &case.camera_from_object);
            assert!(distance <= 0.15);
            // Rotations by more than 180° are equivalent to smaller ones in the other direction.
            let drawn = rotation_of(distance);
            let turn = drawn.min(std::f64::consts::TAU - drawn);
            assert!((angle - turn).abs() < 1e-6, "{angle} {turn}");
        }
    }
}

#[test]
fn translation_errors_are_uniform_if_none_is_rejected() {
    let bins = VsdBins {
        count: 1,
        ..VsdBins::default()
    };
    let mut maker = maker(InitialPose::Binned(bins));
    let bracket = Household::Bracket.model().unwrap();
    let errors = (0..1500).map(|index| {
        let case = maker.case(&bracket, "bracket", 4, index).unwrap();
        assert_eq!((case.bin, case.tries), (Some(0), 1));
        let shift = case.init.translation.vector - case.camera_from_object.translation.vector;
        shift.norm()
    });
    assert_follows("translation error", errors.collect(), |t| {
        (t / 0.15).clamp(0.0, 1.0)
    });
}

#[test]
fn the_vsd_of_a_stored_case_is_reproducible() {
    let model = Household::Teapot.model().unwrap();
    let case = maker(binned()).case(&model, "teapot", 9, 4).unwrap();
    // Use another generator, another model of the same object, and only the poses of the case.
    let again = Household::Teapot.model().unwrap();
    let vsd = maker(InitialPose::mean_error()).vsd(&again, &case.camera_from_object, &case.init);
    assert_eq!(vsd.to_bits(), case.vsd_initial.to_bits());
    // Compare with the definition, computed from whole distance images and silhouettes.
    let image = |pose| hicp_raster::render_depth_image(model.mesh(), &camera(), pose);
    let (truth, init) = (image(&case.camera_from_object), image(&case.init));
    assert_eq!(truth, case.depth);
    assert_eq!(Mask::measured(&truth), case.mask);
    let distances = |depth: &hicp_core::DepthImage| depth.to_distance(&camera()).unwrap();
    let errors = hicp_score::vsd(
        &distances(&init),
        &Mask::measured(&init),
        &distances(&truth),
        &Mask::measured(&truth),
        model.diameter(),
    )
    .unwrap();
    let mean = errors.iter().sum::<f64>() / 10.0;
    assert!(
        (mean - case.vsd_initial).abs() < 1e-9,
        "{mean} {}",
        case.vsd_initial
    );
}

#[test]
fn cases_depend_only_on_seed_name_and_index() {
    let (mug, car) = (
        Household::Mug.model().unwrap(),
        Household::Car.model().unwrap(),
    );
    let in_order: Vec<_> = (0..4)
        .map(|i| maker(binned()).case(&mug, "mug", 1, i).unwrap())
        .collect();
    let mut other = maker(binned());
    for i in [3, 0, 2, 1] {
        other.case(&car, "car", 1, i).unwrap();
        let case = other.case(&mug, "mug", 1, i).unwrap();
        assert_eq!(case, in_order[usize::try_from(i).unwrap()]);
    }
    let on_threads: Vec<_> = std::thread::scope(|scope| {
        let mug = &mug;
        let handles: Vec<_> = (0..4)
            .map(|i| scope.spawn(move || maker(binned()).case(mug, "mug", 1, i).unwrap()))
            .collect();
        handles
            .into_iter()
            .map(|handle| handle.join().unwrap())
            .collect()
    });
    assert_eq!(on_threads, in_order);
    assert_ne!(
        other.case(&mug, "mug", 2, 0).unwrap().init,
        in_order[0].init
    );
    assert_ne!(
        other.case(&mug, "cup", 1, 0).unwrap().init,
        in_order[0].init
    );
    assert_ne!(
        in_order[0].camera_from_object,
        in_order[1].camera_from_object
    );
}

#[test]
fn errors_describe_impossible_cases() {
    let plate = Household::Plate.model().unwrap();
    let bins = VsdBins {
        max_translation_meters: 0.001,
        tries_per_pose: 3,
        max_poses: 4,
        ..VsdBins::default()
    };
    let error = maker(InitialPose::Binned(bins))
        .case(&plate, "plate", 1, 9)
        .unwrap_err();
    assert_eq!(
        error.to_string(),
        "bin 9 of 10 (VSD 0.9 to 1) of plate could not be filled for case 9: none of 12 initial poses fell into it, around 4 object poses"
    );
    let large = Model::new(
        Household::Plate
            .solid()
            .scaled(&Vector3::repeat(3.0))
            .to_mesh()
            .unwrap(),
    );
    assert!(matches!(
        maker(binned()).case(&large, "large", 1, 0),
        Err(SimError::TooLarge { .. })
    ));
    let config = CaseConfig {
        max_distance_meters: f64::NAN,
        ..CaseConfig::new(camera(), binned())
    };
    let error = CaseMaker::new(config).unwrap_err().to_string();
    assert_eq!(
        error,
        "largest distance in meters is NaN, expected a number from 0 to 100"
    );
}

#[test]
fn corruptions_are_seeded_and_paired_and_do_not_change_the_case() {
    let model = Household::Iron.model().unwrap();
    let case = maker(InitialPose::mean_error())
        .case(&model, "iron", 5, 2)
        .unwrap();
    let noisy = |percent| Corruption {
        sensor: DepthSensor {
            noise: DepthNoise::Relative(RelativeGaussian { percent }),
            ..DepthSensor::default()
        },
        ..Corruption::default()
    };
    assert_eq!(
        Corruption::default().apply(&case).unwrap(),
        (case.depth.clone(), case.mask.clone())
    );
    let (one, _) = noisy(1.0).apply(&case).unwrap();
    let (three, _) = noisy(3.0).apply(&case).unwrap();
    assert_eq!(one, noisy(1.0).apply(&case).unwrap().0);
    // The deviates are the same, three times as large.
    for ((clean, one), three) in case
        .depth
        .pixels()
        .iter()
        .zip(one.pixels())
        .zip(three.pixels())
    {
        assert!((3.0 * (one - clean) - (three - clean)).abs() < 1e-6);
    }
    // Another step does not change the noise.
    let defects = MaskDefects {
        missing_share: 0.2,
        erosion_pixels: 1,
        ..MaskDefects::default()
    };
    let both = Corruption {
        mask: defects,
        ..noisy(1.0)
    };
    assert_eq!(both.apply(&case).unwrap().0, one);
}

#[test]
fn an_occluder_hides_its_share_and_is_in_front_of_the_object() {
    let model = Household::Iron.model().unwrap();
    let case = maker(InitialPose::mean_error())
        .case(&model, "iron", 5, 3)
        .unwrap();
    let corruption = Corruption {
        occluded_share: 0.3,
        wall_behind_meters: Some(0.2),
        ..Corruption::default()
    };
    let (depth, mask) = corruption.apply(&case).unwrap();
    let count = |mask: &Mask| mask.n_set() as f64;
    let hidden = 1.0 - count(&mask) / count(&case.mask);
    assert!((hidden - 0.3).abs() < 0.02, "{hidden}");
    let nearest = case
        .depth
        .pixels()
        .iter()
        .copied()
        .filter(|z| *z > 0.0)
        .fold(f32::INFINITY, f32::min);
    let pixels = depth
        .pixels()
        .iter()
        .zip(case.depth.pixels())
        .zip(mask.pixels().iter().zip(case.mask.pixels()));
    for ((now, before), (kept, was)) in pixels {
        if *kept {
            assert_eq!(now, before);
        } else if *was {
            assert!(*now < nearest, "{now} is not in front of {nearest}");
        } else {
            // The pixel shows the board or the wall.
            assert!(*now > 0.0);
        }
    }
}

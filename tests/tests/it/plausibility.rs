//! Warnings about inputs, and the confidence in poses that wrong inputs make plausible.

use hicp_sim::{Household, rng, stream};
use hicp_tests::tabletop::{MaskKind, Tabletop};
use hicp_tests::{points_of, render};
use hybrid_icp::checks::{ACCEPTED, warnings, warnings_of_model};
use hybrid_icp::core::nalgebra::{Quaternion, UnitQuaternion};
use hybrid_icp::core::{
    DepthImage, Isometry3, Mask, Model, ModelConfig, Observation, PinholeCamera, TriMesh,
};
use hybrid_icp::icp::Verdict;
use hybrid_icp::{CenterFault, Preset, Refiner, Warning};

use crate::numbers::{camera, cuboid};

/// With a wrong diameter or unit, every tolerance is wrong, so nothing can be trusted.
#[test]
fn no_pose_is_trusted_if_the_diameter_is_impossible_or_far_above_the_distance() {
    let model = Household::Iron.model().unwrap();
    let truth = hicp_sim::object_pose(&mut rng(5), &model.center(), 0.55..0.6, 0.02);
    let (depth, mask) = render(&model, &camera(), &truth);
    let observation = Observation::new(depth, mask, camera()).unwrap();
    let refined = |model: &Model| Refiner::preset(Preset::Auto).refine(model, &observation, &truth);
    assert!(refined(&model).confidence > ACCEPTED);
    let stated = |factor: f64| {
        let diameter = Some(factor * model.diameter());
        let config = ModelConfig {
            diameter,
            ..ModelConfig::default()
        };
        Model::with_config(model.mesh().clone(), config)
    };
    assert!(refined(&stated(1.04)).confidence > ACCEPTED);
    assert_eq!(warnings_of_model(&stated(1.04)), []);
    for factor in [0.3, 3.0, 1000.0] {
        let model = stated(factor);
        assert_eq!(refined(&model).confidence, 0.0, "{factor}");
        let warnings = warnings_of_model(&model);
        let about_it = |w: &Warning| matches!(w, Warning::StatedDiameter { .. });
        assert!(warnings.iter().any(about_it), "{factor}: {warnings:?}");
    }
    // A mesh in millimeters that was read as meters.
    let vertices = model.mesh().vertices().iter().map(|p| p * 1000.0).collect();
    let mesh = TriMesh::new(vertices, model.mesh().triangles().to_vec()).unwrap();
    assert_eq!(refined(&Model::new(mesh)).confidence, 0.0);
}

/// A given pose is judged like a refined one.
#[test]
fn a_pose_is_judged_without_a_refinement() {
    let model = Household::Iron.model().unwrap();
    let truth = hicp_sim::object_pose(&mut rng(5), &model.center(), 0.55..0.6, 0.02);
    let (depth, mask) = render(&model, &camera(), &truth);
    let observation = Observation::new(depth, mask, camera()).unwrap();
    let mut refiner = Refiner::preset(Preset::Auto);
    let judged = refiner.judge(&model, &observation, &truth);
    assert_eq!(judged.outcome.camera_from_object, truth);
    assert!(matches!(judged.outcome.verdict, Verdict::KeptInitial(_)));
    assert_eq!((judged.mve, judged.mve_initial), (0.0, 0.0));
    assert!(judged.confidence > ACCEPTED, "{}", judged.confidence);
    let wrong = Isometry3::translation(0.05, 0.0, 0.0) * truth;
    let wrong = refiner.judge(&model, &observation, &wrong);
    assert!(wrong.mve > 0.3 && wrong.confidence < 0.1, "{wrong:?}");
}

#[test]
fn intrinsics_of_another_image_cause_a_warning() {
    let model = Model::new(cuboid([0.1, 0.06, 0.04]));
    let found = |[fx, fy, cx, cy]: [f64; 4]| {
        let camera = PinholeCamera::new(fx, fy, cx, cy, 160, 120).unwrap();
        let depth = DepthImage::from_meters(160, 120, vec![0.5; 160 * 120]).unwrap();
        let observation = Observation::new(depth, Mask::full(160, 120), camera).unwrap();
        let warnings = warnings(&model, &observation, &Isometry3::translation(0.0, 0.0, 0.5));
        warnings.iter().find_map(|warning| match warning {
            Warning::Center { fault, .. } => Some(*fault),
            _ => None,
        })
    };
    let resized = |factor| Some(CenterFault::Resized { factor });
    assert_eq!(
        found([300.0, 300.0, 58.0, 83.0]),
        Some(CenterFault::Swapped)
    );
    assert_eq!(
        found([81.0, 59.0, 300.0, 301.0]),
        Some(CenterFault::Exchanged)
    );
    assert_eq!(found([600.0, 600.0, 161.0, 118.0]), resized(2.0));
    assert_eq!(found([150.0, 150.0, 39.0, 30.5]), resized(0.5));
    let far = |intrinsics| matches!(found(intrinsics), Some(CenterFault::Far { .. }));
    assert!(far([300.0, 300.0, 3000.0, 60.0]));
    assert!(far([4.2, 4.2, 80.0, 60.0]));
    // A crop can have its principal point anywhere.
    for (cx, cy) in [
        (83.0, 58.0),
        (79.5, 59.5),
        (70.0, 70.0),
        (20.0, 30.0),
        (150.0, 50.0),
        (-100.0, 300.0),
    ] {
        assert_eq!(found([300.0, 300.0, cx, cy]), None, "{cx} {cy}");
    }
}

/// A crop to the left upper half has the intrinsics of an image of twice the size.
#[test]
fn a_mask_of_the_length_of_the_object_tells_a_crop_from_a_resized_image() {
    let model = Model::new(cuboid([0.1, 0.06, 0.04]));
    let found = |length: u32| {
        let camera = PinholeCamera::new(300.0, 300.0, 159.5, 119.5, 160, 120).unwrap();
        let depth = DepthImage::from_meters(160, 120, vec![0.5; 160 * 120]).unwrap();
        let inside =
            |i: u32| (40..40 + length).contains(&(i % 160)) && (40..70).contains(&(i / 160));
        let mask = Mask::new(160, 120, (0..160 * 120).map(inside).collect()).unwrap();
        let observation = Observation::new(depth, mask, camera).unwrap();
        warnings(&model, &observation, &Isometry3::translation(0.0, 0.0, 0.5))
    };
    // The object has a diameter of 74 pixels.
    assert_eq!(found(60), []);
    assert!(matches!(
        found(30)[..],
        [Warning::Center {
            fault: CenterFault::Resized { factor: 2.0 },
            ..
        }]
    ));
}

#[test]
fn a_pose_that_is_not_rigid_causes_a_warning() {
    let model = Model::new(cuboid([0.1, 0.06, 0.04]));
    let depth = DepthImage::from_meters(160, 120, vec![0.5; 160 * 120]).unwrap();
    let observation = Observation::new(depth, Mask::full(160, 120), camera()).unwrap();
    let mut init = Isometry3::translation(0.0, 0.0, 0.5);
    let behind = |init: &_| {
        let warnings = warnings(&model, &observation, init);
        warnings
            .iter()
            .any(|w| matches!(w, Warning::BehindCamera { .. }))
    };
    assert!(!behind(&init));
    for length in [0.0, 2.0, f64::NAN] {
        init.rotation = UnitQuaternion::new_unchecked(Quaternion::new(length, 0.0, 0.0, 0.0));
        assert!(behind(&init), "{length}");
    }
}

/// An object of some hundred pixels is less evidence, but its right poses are accepted.
#[test]
fn right_poses_in_small_images_are_accepted() {
    let scenes = Tabletop::new(&Household::TEST).unwrap().resized();
    let points = points_of(&scenes);
    let mut refiner = Refiner::preset(Preset::Auto);
    let (mut right, mut accepted, mut wrong) = (0, 0, 0);
    for seed in 0..120 {
        for (seen, place) in scenes.scene(seed).unwrap().into_iter().zip(0..) {
            if seen.camera.width() > 200 || seen.noise_percent() > 1.5 {
                continue;
            }
            let observation = seen.observe(MaskKind::Soft).unwrap();
            let init = seen.near(&mut stream(seed, &["small"], place), 1.0);
            let model = &scenes.objects[seen.model].1;
            let refined = refiner.refine(model, &observation, &init);
            let error = points[seen.model].mssd(&refined.outcome.camera_from_object, &seen.truth);
            let sure = u32::from(refined.confidence > ACCEPTED);
            if error < 0.1 * model.diameter() {
                (right, accepted) = (right + 1, accepted + sure);
            } else {
                wrong += sure;
            }
        }
    }
    let counts = format!("{accepted} of {right} right poses, {wrong} wrong ones");
    assert!(
        10 * accepted >= 7 * right && 50 * wrong <= accepted,
        "{counts}"
    );
}

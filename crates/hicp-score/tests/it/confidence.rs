//! Tests of the misfit and the confidence against scenes with known differences.

use crate::evidence::{HEIGHT, WALL, WIDTH, at, camera, cube};
use crate::support::{RayCaster, cuboid, render_depth};
use hicp_core::{Context, DepthImage, Isometry3, Mask, Model, Observation, Problem, RenderCache};
use hicp_score::{Confidence, Evidence, MeanVsd, Misfit, N_FEATURES, Score};

/// Returns the cube at [`at`] in front of a wall, with depths changed by pixel.
fn scene(change: impl Fn(usize, f32) -> f32) -> Observation {
    let alone = render_depth(&cube(), &camera(), &at());
    let depth = alone.pixels().iter().enumerate();
    let depth = depth.map(|(i, z)| if *z > 0.0 { change(i, *z) } else { WALL });
    let depth = DepthImage::from_meters(WIDTH, HEIGHT, depth.collect()).unwrap();
    Observation::new(depth, Mask::measured(&alone), camera()).unwrap()
}

fn judge(observation: &Observation, pose: &Isometry3<f64>) -> (Misfit, Confidence) {
    let model = cube();
    let mut renders = RenderCache::new(RayCaster);
    let mut context = Context::new(Problem::new(&model, observation), &mut renders);
    let mve = MeanVsd::default().score(&mut context, pose);
    let (evidence, confidence) = Confidence::at(&mut context, pose, mve, 0.0);
    assert_eq!(evidence, Evidence::at(&mut context, pose).unwrap());
    (Misfit::at(&mut context, pose).unwrap(), confidence)
}

#[test]
fn at_the_true_pose_nothing_misfits_and_the_confidence_is_high() {
    let (misfit, confidence) = judge(&scene(|_, z| z), &at());
    for share in [
        misfit.systematic,
        misfit.bias,
        misfit.ahead,
        misfit.rim_ahead,
        misfit.rim_open,
        misfit.weak,
        misfit.unexplained,
    ] {
        assert!(share.abs() < 1e-6, "{misfit:?}");
    }
    assert!(confidence.probability > 0.95, "{confidence:?}");
    assert!(confidence.error_meters < 0.01, "{confidence:?}");
}

/// A chessboard of errors is noise, an equal error of all pixels is not.
#[test]
fn noise_is_told_from_a_shift() {
    let size = 0.004;
    let diameter = cube().diameter();
    let sign = |i: usize| {
        if (i % 64 + i / 64).is_multiple_of(2) {
            1.0
        } else {
            -1.0
        }
    };
    let (noisy, _) = judge(&scene(|i, z| z + size * sign(i)), &at());
    let (shifted, _) = judge(&scene(|_, z| z + size), &at());
    let share = f64::from(size) / diameter;
    assert!(
        noisy.sigma > share && noisy.bias.abs() < 0.1 * share,
        "{noisy:?}"
    );
    assert!(shifted.sigma < 0.3 * share, "{shifted:?}");
    assert!(
        (shifted.systematic - share).abs() < 0.1 * share,
        "{shifted:?}"
    );
    assert!((shifted.bias - share).abs() < 0.1 * share, "{shifted:?}");
}

#[test]
fn wrong_poses_have_a_lower_confidence() {
    let observation = scene(|_, z| z);
    let mut last = judge(&observation, &at()).1.probability;
    for meters in [0.02, 0.05] {
        let aside = Isometry3::translation(meters, 0.0, 0.0) * at();
        let (misfit, confidence) = judge(&observation, &aside);
        assert!(misfit.ahead > 0.0 && misfit.rim_ahead > 0.0, "{misfit:?}");
        assert!(confidence.probability < last, "{confidence:?}");
        last = confidence.probability;
    }
    assert!(last < 0.1, "{last}");
}

#[test]
fn without_agreement_the_probability_is_zero() {
    let beside = Isometry3::translation(5.0, 0.0, 0.0) * at();
    let (misfit, confidence) = judge(&scene(|_, z| z), &beside);
    assert_eq!(confidence, Confidence::none(cube().diameter()));
    assert_eq!(misfit.ahead, 0.0);
}

#[test]
fn a_render_without_a_silhouette_in_the_image_has_the_probability_zero() {
    // A cube of 2 m, such as one in another unit, whose front lies on the wall.
    let (model, observation) = (Model::new(cuboid(2.0, 2.0, 2.0)), scene(|_, z| z));
    // Then its edge is five pixels inside the image.
    for (aside, seen) in [(0.0, false), (0.8, true)] {
        let pose = Isometry3::translation(aside, 0.0, f64::from(WALL) + 1.0);
        let mut renders = RenderCache::new(RayCaster);
        let mut context = Context::new(Problem::new(&model, &observation), &mut renders);
        let (evidence, confidence) = Confidence::at(&mut context, &pose, 0.0, 0.0);
        assert!(evidence.agrees > 0.7, "{evidence:?}");
        assert_eq!(confidence != Confidence::none(model.diameter()), seen);
    }
}

#[test]
fn features_out_of_range_give_finite_numbers() {
    for x in [f64::NEG_INFINITY, -1.0, 1e9, f64::INFINITY, f64::NAN] {
        let confidence = Confidence::of(&[x; N_FEATURES], 0.1);
        assert!((0.0..=1.0).contains(&confidence.probability), "{x}");
        assert!(confidence.error_meters.is_finite() && confidence.error_degrees <= 180.0);
    }
}

#[test]
fn poses_that_look_alike_lower_the_probability() {
    let at = at();
    let scene = scene(|_, z| z);
    let model = cube();
    let mut renders = RenderCache::new(RayCaster);
    let mut context = Context::new(Problem::new(&model, &scene), &mut renders);
    let mve = MeanVsd::default().score(&mut context, &at);
    let mut last = 1.0;
    for look_alikes in [0.0, 0.3, 1.0, 4.0] {
        let (_, confidence) = Confidence::at(&mut context, &at, mve, look_alikes);
        assert!(confidence.probability < last, "{look_alikes}: {last}");
        last = confidence.probability;
    }
    assert!(last < 0.7, "{last}");
}

#[test]
fn poses_that_look_alike_lower_the_probability_near_the_initial_pose_too() {
    let (_, alone) = judge(&scene(|_, z| z), &at());
    let mut last = alone.near_initial(0.0);
    assert!(last.probability > 0.95, "{last:?}");
    for look_alikes in [0.3, 1.0, 4.0] {
        let confidence = alone.near_initial(look_alikes);
        assert!(confidence.probability < last.probability, "{look_alikes}");
        assert!(confidence.error_meters > last.error_meters);
        assert!(confidence.error_degrees > last.error_degrees);
        last = confidence;
    }
    let none = Confidence::none(cube().diameter());
    assert_eq!(none.near_initial(1.0), none);
}

//! The poses at which a model looks the same.

use hicp_sim::{Household, RelativeGaussian, perturb, rng};
use hicp_tests::{Scene, camera, render, scene};
use hybrid_icp::checks::ACCEPTED;
use hybrid_icp::core::{DepthImage, Isometry3, Model, ModelConfig, Observation, TriMesh, Vector3};
use hybrid_icp::{Preset, Refinement, Refiner};

use crate::numbers::cuboid;

/// A carton has three half turns, and the image shows none of them.
#[test]
fn every_twin_of_a_carton_counts_however_its_surface_is_sampled() {
    for seed in 1..4 {
        let scene = scene(Household::Carton, 0.0, &mut rng(seed));
        for samples in [500, 1000, 2000] {
            let config = ModelConfig {
                samples,
                ..ModelConfig::default()
            };
            let undeclared = Model::with_config(scene.model.mesh().clone(), config);
            let mut refiner = Refiner::preset(Preset::Auto);
            let judged = refiner.judge(&undeclared, &scene.observation, &scene.truth);
            let twins = judged.look_alikes;
            assert!((twins - 3.0).abs() < 0.1, "{seed}, {samples}: {twins}");
        }
    }
}

/// Returns a box of 14 × 8 × 9 cm with a knob that faces the camera, its pose, and its image in
/// front of a wall.
fn box_with_a_knob(seed: u64, (width, height): (f32, f32)) -> Scene {
    let (body, knob) = (cuboid([0.14, 0.08, 0.09]), cuboid([width, width, height]));
    let place = Vector3::new(0.03, 0.0, -0.045 - 0.5 * height);
    let knob_points = knob.vertices().iter().map(|p| p + place);
    let vertices = body.vertices().iter().copied().chain(knob_points).collect();
    let n = body.vertices().len() as u32;
    let knob_triangles = knob.triangles().iter().map(|t| t.map(|index| index + n));
    let triangles = body
        .triangles()
        .iter()
        .copied()
        .chain(knob_triangles)
        .collect();
    let model = Model::new(TriMesh::new(vertices, triangles).unwrap());
    let mut rng = rng(seed);
    let tilted = Isometry3::new([0.0, 0.0, 0.7].into(), [0.3, -0.2, 0.4].into());
    let truth = perturb(&mut rng, &tilted, 0.05, 0.2);
    let (seen, mask) = render(&model, &camera(), &truth);
    let in_front = |z: &f32| if *z > 0.0 { *z } else { 1.1 };
    let depth = seen.pixels().iter().map(in_front).collect();
    let depth = DepthImage::from_meters(seen.width(), seen.height(), depth).unwrap();
    let depth = RelativeGaussian { percent: 0.2 }.apply(&mut rng, &depth);
    Scene {
        observation: Observation::new(depth, mask, camera()).unwrap(),
        model,
        truth,
    }
}

/// Refines from the true pose, turned by half a turn around an axis of the box, and disturbed.
fn refined_from_a_half_turn(scene: &Scene, axis: Vector3<f64>, seed: u64) -> (f64, Refinement) {
    let half_turn = Isometry3::rotation(axis * std::f64::consts::PI);
    let init = perturb(&mut rng(seed), &(scene.truth * half_turn), 0.008, 0.1);
    let mut refiner = Refiner::preset(Preset::Auto);
    let refined = refiner.refine(&scene.model, &scene.observation, &init);
    let pose = &refined.outcome.camera_from_object;
    (pose.rotation.angle_to(&scene.truth.rotation), refined)
}

/// The turned pose is within the gain for which `auto` leaves it, but its look-alike is certain.
#[test]
fn a_look_alike_that_is_certain_replaces_the_pose_near_the_initial_one() {
    for seed in 1..4 {
        let scene = box_with_a_knob(seed, (0.04, 0.02));
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let (error, refined) = refined_from_a_half_turn(&scene, axis, seed);
            let confidence = refined.confidence;
            assert!(
                error < 0.05 && confidence > ACCEPTED,
                "{seed}: {error}, {confidence}"
            );
        }
    }
}

/// Two look-alikes explain the image better than the turned pose.
#[test]
fn a_look_alike_that_explains_the_image_better_counts_more_than_one() {
    for seed in 2..5 {
        let scene = box_with_a_knob(seed, (0.03, 0.012));
        let (error, refined) = refined_from_a_half_turn(&scene, Vector3::z(), seed);
        assert!(error > 3.0, "{seed}: no longer a case for this test");
        assert!(refined.look_alikes > 3.0, "{}", refined.look_alikes);
        assert!(refined.confidence < ACCEPTED, "{}", refined.confidence);
    }
}

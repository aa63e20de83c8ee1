//! Checks that coarser observations agree with fine ones.

use hicp_sim::{Household, rng};
use hicp_tests::{perturbed_scene, scene, symmetric_pose_distance};
use hybrid_icp::core::Observation;
use hybrid_icp::icp::{AtResolution, Cascade};
use hybrid_icp::{Refiner, presets};

#[test]
fn a_coarse_pixel_has_the_surfel_of_its_fine_pixel() {
    let scene = scene(Household::Iron, 0.5, &mut rng(3));
    for factor in [1, 2, 3, 4, 7] {
        let fine: &Observation = &scene.observation;
        let coarse = fine.decimated(factor);
        let mut found = 0;
        for (u, v) in coarse.camera().region().pixels() {
            let (a, b) = (
                coarse.surfel_at(u, v),
                fine.surfel_at(u * factor, v * factor),
            );
            assert_eq!(a, b, "factor {factor}, pixel ({u}, {v})");
            let Some(surfel) = a else { continue };
            found += 1;
            // The coarse camera projects the point onto the center of its pixel.
            let pixel = coarse.camera().project(&surfel.point.cast()).unwrap();
            assert!((pixel.x - f64::from(u)).abs() < 1e-3, "factor {factor}");
            assert!((pixel.y - f64::from(v)).abs() < 1e-3, "factor {factor}");
        }
        assert_eq!(found, coarse.n_surfels());
        assert!(found > 100);
        let measured = coarse.depth().pixels().iter().zip(coarse.mask().pixels());
        let measured = measured.filter(|(z, m)| **m && **z > 0.0).count();
        assert_eq!(measured, coarse.n_measured());
    }
}

#[test]
fn coarse_to_fine_ends_at_the_same_pose_as_fine() {
    let (scene, init) = perturbed_scene(Household::Iron, 0.0, &mut rng(8), (0.003, 0.05));
    let fine = presets::projective_cascade_point_plane();
    let pyramid = Cascade((
        AtResolution {
            factor: 4,
            stage: fine,
        },
        AtResolution {
            factor: 2,
            stage: fine,
        },
        fine,
    ));
    let refined = Refiner::new(pyramid).refine(&scene.model, &scene.observation, &init);
    let pose = refined.outcome.camera_from_object;
    let (angle, distance) = symmetric_pose_distance(&pose, &scene.truth, scene.model.symmetries());
    assert!(
        angle.to_degrees() < 0.1 && distance < 2e-4,
        "{} degrees, {distance} m",
        angle.to_degrees()
    );
}

//! Checks `Refiner::estimate`, which has no initial pose.

use hicp_sim::{Household, perturb, rng};
use hicp_tests::tabletop::{MaskKind, Tabletop};
use hicp_tests::{median, scene};
use hybrid_icp::core::{DepthImage, Isometry3, Mask, Observation, PixelRegion};
use hybrid_icp::icp::{Termination, Verdict};
use hybrid_icp::score::ModelPoints;
use hybrid_icp::{Preset, Refiner, Trace, Warning, mask_in_box};

#[test]
fn objects_are_found_without_an_initial_pose() {
    let mut refiners = [Preset::Local, Preset::Auto].map(Refiner::preset);
    let objects = [
        Household::Iron,
        Household::Car,
        Household::Bracket,
        Household::Bottle,
    ];
    for (seed, object) in (0..).zip(objects) {
        let scene = scene(object, 0.3, &mut rng(seed));
        let points = ModelPoints::new(&scene.model);
        for refiner in &mut refiners {
            let mut trace = Trace::new();
            let found = refiner.estimate_observed(&scene.model, &scene.observation, &mut trace);
            let pose = found.outcome.camera_from_object;
            let error = points.mssd(&pose, &scene.truth);
            assert!(error < 0.02 * points.diameter(), "{object:?}: {error}");
            assert_eq!(found.outcome.verdict, Verdict::Refined);
            assert_eq!(found.mve_initial.to_bits(), found.mve.to_bits());
            assert_eq!(found.warnings(), [], "{object:?}");
            assert!(!trace.stages.is_empty());
            // The result does not depend on other refinements.
            let near = perturb(&mut rng(1), &scene.truth, 0.01, 0.3);
            refiner.refine(&scene.model, &scene.observation, &near);
            assert_eq!(refiner.estimate(&scene.model, &scene.observation), found);
        }
    }
}

#[test]
fn without_depth_in_the_mask_the_outcome_keeps_the_identity() {
    let scene = scene(Household::Mug, 0.0, &mut rng(1));
    let camera = *scene.observation.camera();
    let (width, height) = (camera.width(), camera.height());
    let count = width as usize * height as usize;
    let nothing = DepthImage::from_meters(width, height, vec![0.0; count]).expect("valid");
    let empty = Mask::new(width, height, vec![false; count]).expect("valid");
    let mut refiner = Refiner::preset(Preset::Auto);
    for (depth, mask) in [
        (scene.observation.depth().clone(), empty),
        (nothing, scene.observation.mask().clone()),
    ] {
        let observation = Observation::new(depth, mask, camera).expect("equal sizes");
        let found = refiner.estimate(&scene.model, &observation);
        assert_eq!(found.outcome.camera_from_object, Isometry3::identity());
        let kept = Verdict::KeptInitial(Termination::NoPairs);
        assert_eq!((found.outcome.verdict, found.mve), (kept, 1.0));
        assert!(matches!(
            found.warnings()[..],
            [Warning::Unexplained { .. }]
        ));
    }
}

fn bbox(region: PixelRegion) -> [f64; 4] {
    let [left, top] = [region.u_min, region.v_min].map(f64::from);
    [left, top, region.width() as f64, region.height() as f64]
}

/// Returns the share of a mask's pixels in the union with another mask.
fn overlap(a: &Mask, b: &Mask) -> f64 {
    let pairs = || a.pixels().iter().zip(b.pixels());
    let both = pairs().filter(|(a, b)| **a && **b).count();
    both as f64 / pairs().filter(|(a, b)| **a || **b).count() as f64
}

#[test]
fn a_box_on_a_table_shows_the_object_without_the_table() {
    let scenes = Tabletop::new(&Household::TUNING).expect("valid models");
    let (mut of_boxes, mut of_masks) = (Vec::new(), Vec::new());
    for seed in 0..12 {
        for seen in scenes.scene(seed).expect("models") {
            let region = seen.visible.bounding_region();
            let camera = *seen.observe(MaskKind::Exact).expect("valid").camera();
            let mask = mask_in_box(&seen.depth, &camera, bbox(region));
            let inside = mask.bounding_region();
            assert_eq!(inside.intersection(&region), inside);
            let everything = Mask::in_region(camera.width(), camera.height(), &region, |_, _| true);
            of_boxes.push(overlap(&everything, &seen.visible));
            of_masks.push(overlap(&mask, &seen.visible));
        }
    }
    let (boxes, masks) = (median(&mut of_boxes), median(&mut of_masks));
    assert!(masks > 0.7 && masks > boxes + 0.1, "{boxes} {masks}");
}

#[test]
fn without_a_plane_around_the_box_all_measured_pixels_remain() {
    // The flat side of a carton is not the plane around it.
    for object in [Household::Mug, Household::Carton] {
        let scene = scene(object, 0.5, &mut rng(3));
        let (depth, camera) = (scene.observation.depth(), *scene.observation.camera());
        let mask = mask_in_box(
            depth,
            &camera,
            bbox(scene.observation.mask().bounding_region()),
        );
        assert_eq!(&mask, scene.observation.mask());
    }
    // Boxes outside of the image and without a number are empty.
    let scene = scene(Household::Mug, 0.0, &mut rng(1));
    let (depth, camera) = (scene.observation.depth(), *scene.observation.camera());
    for bbox in [
        [9e9, 0.0, 9.0, 9.0],
        [-50.0, -50.0, 20.0, 20.0],
        [f64::NAN; 4],
        [0.0; 4],
    ] {
        let mask = mask_in_box(depth, &camera, bbox);
        assert!(mask.bounding_region().is_empty(), "{bbox:?}");
    }
    let whole = mask_in_box(
        depth,
        &camera,
        [-1e300, -1e300, f64::INFINITY, f64::INFINITY],
    );
    assert_eq!(&whole, scene.observation.mask());
}

//! Checks `Refiner::estimate`, which has no initial pose.

use hicp_sim::{Household, perturb, rng};
use hicp_tests::scene;
use hicp_tests::tabletop::{MaskKind, Tabletop};
use hybrid_icp::core::{DepthImage, Isometry3, Mask, Observation};
use hybrid_icp::icp::{Termination, Verdict};
use hybrid_icp::score::ModelPoints;
use hybrid_icp::{Preset, Refiner, Trace, Warning};

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

#[test]
fn objects_in_boxes_are_found_on_a_table() {
    let scenes = Tabletop::new(&Household::TUNING).expect("valid models");
    let mut refiner = Refiner::preset(Preset::Local);
    let [mut cases, mut right, mut sure] = [0; 3];
    for seen in (0..8).flat_map(|seed| scenes.scene(seed).expect("models")) {
        let model = &scenes.objects[seen.model].1;
        let observation = seen.observe(MaskKind::Box).expect("valid");
        let found = refiner.estimate(model, &observation);
        let points = ModelPoints::new(model);
        let error = points.mssd(&found.outcome.camera_from_object, &seen.truth);
        cases += 1;
        right += usize::from(error < 0.1 * points.diameter());
        sure += usize::from(found.confidence >= 0.95);
    }
    // The pixels of the table have no weight.
    assert!(cases > 20 && 10 * right > 8 * cases, "{right} of {cases}");
    assert!(2 * sure > cases, "{sure} of {cases}");
}

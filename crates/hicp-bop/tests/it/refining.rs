//! The refinement of an image's rows, from files to results.

use std::sync::Arc;

use hicp_bop::{
    BoxMask, DatasetRefiner, Fault, FaultKind, MaskSource, ModelFolder, Rescore, RowResult,
    RowStatus, detections_by_frame,
};
use hicp_io::bop::{Detection, ResultRow, Rle, Scene};
use hicp_io::{IoError, ReadLimits, write_mask_png};
use hybrid_icp::core::{Isometry3, Mask};
use hybrid_icp::{Preset, Refiner};

use crate::common::{BLOCK, KEY, World, estimate, mask, truth};

fn detection(mask: Option<&Mask>) -> Detection {
    Detection {
        scene_id: KEY.0,
        image_id: KEY.1,
        category_id: BLOCK,
        score: 0.9,
        bbox: None,
        segmentation: mask.map(Rle::of_mask),
        time_s: None,
    }
}

#[test]
fn rows_are_refined() {
    let world = World::new();
    let shared = DatasetRefiner {
        scenes: world.scenes(),
        models: world.models,
        masks: MaskSource::Visible,
    };
    let mut rows = vec![
        ResultRow::new(KEY.0, KEY.1, 9, truth()),
        ResultRow::new(KEY.0, KEY.1, BLOCK, estimate()),
    ];
    let mut refiner = Refiner::preset(Preset::Hybrid);
    let result = shared.frame(&mut refiner, KEY, &rows, &[0, 1]);
    assert_eq!(
        result.rows[0],
        RowResult::unrefined(0, RowStatus::MissingModel)
    );
    assert_eq!(result.rows[1].status, RowStatus::Refined);
    assert_eq!(result.faults, []);
    let (before, after) = result.rows[1].mve.unwrap();
    assert!(after < before);
    result.enter(&mut rows, Rescore::Mve, false);
    assert_eq!(
        rows[0].camera_from_object(),
        ResultRow::new(1, 4, 9, truth()).camera_from_object()
    );
    assert_eq!((rows[0].score, rows[1].score), (0.0, 1.0 - after));
    let off = |pose: Isometry3<f64>| (pose.translation.vector - truth().translation.vector).norm();
    assert!(off(rows[1].camera_from_object()) < 0.2 * off(estimate()));
}

#[test]
fn masks_come_from_their_source() {
    let world = World::new();
    let model = world.model();
    let mut refiner = Refiner::preset(Preset::Hybrid);
    let aside = Isometry3::translation(1.0, 0.0, 0.0) * truth();
    let detections = vec![detection(None), detection(Some(&mask()))];
    let detections = MaskSource::detections(detections);
    for mut frame in [
        MaskSource::Visible.frame(KEY, world.image()),
        detections.frame(KEY, world.image()),
    ] {
        let chosen = frame.choose(&mut refiner, model, BLOCK, &[aside, estimate()]);
        assert_eq!(chosen[0], Err(RowStatus::NoOverlap));
        let observation = frame.observation(chosen[1].unwrap()).unwrap();
        assert_eq!(observation.mask(), &mask());
        assert_eq!(frame.into_faults(), []);
    }
    let boxes = MaskSource::Box(BoxMask::default());
    let mut frame = boxes.frame(KEY, world.image());
    let none = frame.choose(&mut refiner, model, BLOCK, &[estimate()]);
    assert_eq!(none, [Err(RowStatus::NoMask)]);
    // Only the block was measured, so the box around the estimate contains the whole mask.
    let all = BoxMask { margin: 0.1 };
    let seen = frame
        .observe_box(&mut refiner, model, &estimate(), &all)
        .unwrap();
    assert_eq!(seen.mask(), &mask());
    let none = frame.observe_box(&mut refiner, model, &aside, &all);
    assert_eq!(none.map(|_| ()), Err(RowStatus::NothingMeasured));
}

/// A short run-length code may describe a whole image, so the number of masks in memory is limited.
#[test]
fn released_masks_are_read_again_with_the_same_results() {
    let world = World::new();
    let model = world.model();
    let mut refiner = Refiner::preset(Preset::Hybrid);
    let left: Vec<bool> = (0..160 * 120).map(|i| i % 160 < 80).collect();
    let left = Mask::new(160, 120, left).unwrap();
    let masks = [&mask(), &left, &Mask::full(160, 120), &mask()];
    let mut detections: Vec<_> = masks.into_iter().map(|m| detection(Some(m))).collect();
    // An unusable mask gives exactly one fault, even if the other masks are read again.
    detections.push(detection(Some(&Mask::full(16, 12))));
    let detections = MaskSource::detections(detections);
    let poses = [truth(), estimate(), truth()];
    let mut run = |memory: Option<usize>| {
        let mut frame = detections.frame(KEY, world.image());
        if let Some(memory) = memory {
            frame = frame.with_memory(memory);
        }
        let chosen = frame.choose(&mut refiner, model, BLOCK, &poses);
        let mut seen = Vec::new();
        for place in &chosen {
            let observation = frame.observation(*place.as_ref().unwrap()).unwrap();
            seen.push(observation.mask().clone());
        }
        // Count the masks and observations in memory.
        let text = format!("{frame:?}");
        let held = text.matches("Read(").count() + text.matches("Observed(").count();
        (chosen, seen, frame.into_faults(), held)
    };
    let (chosen, seen, faults, all) = run(None);
    assert_eq!((faults.len(), all), (1, 4));
    for (memory, expected) in [(0, 1), (2 * 160 * 120, 2)] {
        let (again, also_seen, same, held) = run(Some(memory));
        assert_eq!((&again, &also_seen, &same), (&chosen, &seen, &faults));
        assert!(held <= expected, "{held} are held in {memory} bytes");
    }
}

#[test]
fn an_unusable_mask_is_reported_as_a_fault() {
    let world = World::new();
    let path = world.path("test/000001/mask_visib/000004_000000.png");
    write_mask_png(path, &Mask::full(16, 12)).unwrap();
    let mut refiner = Refiner::preset(Preset::Hybrid);
    let mut frame = MaskSource::Visible.frame(KEY, world.image());
    let chosen = frame.choose(&mut refiner, world.model(), BLOCK, &[truth()]);
    assert_eq!(chosen, [Err(RowStatus::Damaged)]);
    let faults = frame.into_faults();
    assert!(
        faults[0].text.contains("16x12") && faults[0].text.contains("160x120"),
        "{faults:?}"
    );
}

#[test]
fn a_missing_mask_is_reported_as_a_fault_that_names_it() {
    let world = World::new();
    let mut refiner = Refiner::preset(Preset::Hybrid);
    let scene = world.path("test/000001");
    let mut missing = |name: &str| {
        std::fs::remove_file(scene.join(name)).unwrap();
        let mut frame = MaskSource::Visible.frame(KEY, world.image());
        let chosen = frame.choose(&mut refiner, world.model(), BLOCK, &[truth()]);
        assert_eq!(chosen, [Err(RowStatus::NoMask)]);
        let faults = frame.into_faults();
        assert!(
            matches!(&faults[..], [fault] if fault.kind == FaultKind::MissingMask && fault.text.contains(name)),
            "{faults:?}"
        );
    };
    missing("mask_visib/000004_000000.png");
    missing("scene_gt.json");
}

#[test]
fn detections_are_grouped_by_image() {
    let elsewhere = Detection {
        image_id: 7,
        ..detection(None)
    };
    let by_frame = detections_by_frame(vec![elsewhere.clone(), detection(None)]);
    assert_eq!(by_frame[&KEY], [detection(None)]);
    assert_eq!(by_frame[&(1, 7)].len(), 1);
    let source = MaskSource::detections(vec![elsewhere]);
    assert!(matches!(source, MaskSource::Detections(frames) if frames.contains_key(&(1, 7))));
}

#[test]
fn limits_and_errors_are_reported_as_faults() {
    let world = World::new();
    let limits = ReadLimits {
        max_triangles: 3,
        max_pixels: 5,
        ..ReadLimits::DEFAULT
    };
    let dataset = world.dataset.with_limits(limits);
    let models = dataset.models_dir().unwrap();
    let folder = ModelFolder::open(&models).unwrap();
    assert!(folder.read(BLOCK).unwrap().is_some());
    let folder = ModelFolder::with_info(limits, &models, folder.info_path()).unwrap();
    let error = folder.read(BLOCK).unwrap_err();
    let fault = Fault::of(&error);
    assert!(
        fault.kind == FaultKind::Damaged && fault.text.contains("obj_000005.ply"),
        "{fault:?}"
    );
    // A dataset passes its limits to its scenes; a scene can have different limits.
    let scene = dataset.scene("test", 1).unwrap();
    let error = scene.read_depth(4).unwrap_err();
    assert!(Fault::of(&error).text.contains("000004.png"), "{error}");
    assert!(Scene::open(scene.dir()).unwrap().read_depth(4).is_ok());
    let missing: IoError = dataset.scene("test", 2).unwrap_err();
    assert!(Fault::of(&missing).kind == FaultKind::Missing);
    assert_eq!(fault, Fault::damaged(fault.text.clone()));
}

#[test]
fn the_observations_of_an_image_share_its_depth() {
    let world = World::new();
    let model = world.model();
    let image = world.image();
    let depth = Arc::clone(&image.depth);
    let mut refiner = Refiner::preset(Preset::Hybrid);

    let mut frame = MaskSource::Visible.frame(KEY, image);
    let chosen = frame.choose(&mut refiner, model, BLOCK, &[estimate()]);
    let observation = frame.observation(*chosen[0].as_ref().unwrap()).unwrap();
    assert!(Arc::ptr_eq(observation.shared_depth(), &depth));
    let boxed = frame.observe_box(&mut refiner, model, &estimate(), &BoxMask::default());
    assert!(Arc::ptr_eq(boxed.unwrap().shared_depth(), &depth));
}

//! The refinement of an image's rows, from files to results.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use hicp_bop::{
    BoxMask, DatasetRefiner, Fault, FaultKind, Image, MaskSource, ModelFolder, Models, Rescore,
    RowResult, RowStatus, Scenes, detections_by_frame,
};
use hicp_io::bop::{
    Dataset, Detection, GroundTruth, ResultRow, Rle, SceneCamera, write_scene_camera,
    write_scene_gt,
};
use hicp_io::{IoError, LengthUnit, ReadLimits, write_depth_png, write_mask_png, write_ply};
use hybrid_icp::core::{
    DepthImage, Isometry3, Mask, Matrix3, PinholeCamera, Point3, TriMesh, Vector3,
};
use hybrid_icp::raster::render_depth_image;
use hybrid_icp::{Preset, Refiner};

pub(crate) const KEY: (u32, u32) = (1, 4);
pub(crate) const BLOCK: u32 = 5;

/// Returns a block of 6 × 8 × 10 cm.
fn block() -> TriMesh {
    let corner = |i: u8| {
        let side = |bit: u8, half: f32| if i & bit == 0 { -half } else { half };
        Point3::new(side(1, 0.03), side(2, 0.04), side(4, 0.05))
    };
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles = quads
        .iter()
        .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    TriMesh::new((0..8).map(corner).collect(), triangles.collect()).unwrap()
}

fn camera() -> PinholeCamera {
    PinholeCamera::new(200.0, 200.0, 79.5, 59.5, 160, 120).unwrap()
}

pub(crate) fn truth() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(0.02, -0.01, 0.5), Vector3::new(0.5, 0.9, 0.3))
}

pub(crate) fn estimate() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(0.004, -0.003, 0.004), Vector3::zeros()) * truth()
}

/// Returns the depth of the block alone.
fn depth() -> DepthImage {
    render_depth_image(&block(), &camera(), &truth())
}

fn mask() -> Mask {
    Mask::measured(&depth())
}

/// Creates a dataset with one image of the block.
pub(crate) fn dataset(dir: &Path) -> Dataset {
    let scene = dir.join("test/000001");
    for folder in ["depth", "mask_visib"] {
        std::fs::create_dir_all(scene.join(folder)).unwrap();
    }
    std::fs::create_dir(dir.join("models")).unwrap();
    write_ply(
        dir.join("models/obj_000005.ply"),
        &block(),
        LengthUnit::Millimeters,
    )
    .unwrap();
    write_depth_png(scene.join("depth/000004.png"), &depth(), 0.1).unwrap();
    write_mask_png(scene.join("mask_visib/000004_000000.png"), &mask()).unwrap();
    let seen_by = SceneCamera {
        matrix: Matrix3::new(200.0, 0.0, 79.5, 0.0, 200.0, 59.5, 0.0, 0.0, 1.0),
        image_size: None,
        depth_scale: Some(0.1),
        camera_from_world: None,
    };
    let there = GroundTruth {
        obj_id: BLOCK,
        camera_from_object: truth(),
    };
    write_scene_camera(
        scene.join("scene_camera.json"),
        &BTreeMap::from([(4, seen_by)]),
    )
    .unwrap();
    write_scene_gt(
        scene.join("scene_gt.json"),
        &BTreeMap::from([(4, vec![there])]),
    )
    .unwrap();
    Dataset::open(dir).unwrap()
}

fn image(dataset: &Dataset) -> Image {
    Scenes::new(dataset, "test", 1).read(KEY).unwrap()
}

pub(crate) fn models(dataset: &Dataset, objects: &[u32]) -> Models {
    let folder = ModelFolder::open(dataset.models_dir().unwrap()).unwrap();
    Models::read(&folder, &objects.iter().copied().collect::<BTreeSet<u32>>())
}

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
    let dir = tempfile::tempdir().unwrap();
    let dataset = dataset(dir.path());
    let objects = models(&dataset, &[BLOCK, 9]);
    let shared = DatasetRefiner {
        models: objects,
        scenes: Scenes::new(&dataset, "test", 1),
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
    let dir = tempfile::tempdir().unwrap();
    let dataset = dataset(dir.path());
    let models = models(&dataset, &[BLOCK]);
    let model = &models.by_id[&BLOCK];
    let mut refiner = Refiner::preset(Preset::Hybrid);
    let aside = Isometry3::translation(1.0, 0.0, 0.0) * truth();
    let detections = vec![detection(None), detection(Some(&mask()))];
    let detections = MaskSource::detections(detections);
    for mut frame in [
        MaskSource::Visible.frame(KEY, image(&dataset)),
        detections.frame(KEY, image(&dataset)),
    ] {
        let chosen = frame.choose(&mut refiner, model, BLOCK, &[aside, estimate()]);
        assert_eq!(chosen[0], Err(RowStatus::NoOverlap));
        let observation = frame.observation(chosen[1].unwrap()).unwrap();
        assert_eq!(observation.mask(), &mask());
        assert_eq!(frame.into_faults(), []);
    }
    let boxes = MaskSource::Box(BoxMask::default());
    let mut frame = boxes.frame(KEY, image(&dataset));
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
    let dir = tempfile::tempdir().unwrap();
    let dataset = dataset(dir.path());
    let models = models(&dataset, &[BLOCK]);
    let model = &models.by_id[&BLOCK];
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
        let mut frame = detections.frame(KEY, image(&dataset));
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
    let dir = tempfile::tempdir().unwrap();
    let dataset = dataset(dir.path());
    let small = Mask::new(16, 12, vec![true; 16 * 12]).unwrap();
    write_mask_png(
        dir.path().join("test/000001/mask_visib/000004_000000.png"),
        &small,
    )
    .unwrap();
    let models = models(&dataset, &[BLOCK]);
    let mut refiner = Refiner::preset(Preset::Hybrid);
    let mut frame = MaskSource::Visible.frame(KEY, image(&dataset));
    let chosen = frame.choose(&mut refiner, &models.by_id[&BLOCK], BLOCK, &[truth()]);
    assert_eq!(chosen, [Err(RowStatus::Damaged)]);
    let faults = frame.into_faults();
    assert!(
        faults[0].text.contains("16x12") && faults[0].text.contains("160x120"),
        "{faults:?}"
    );
}

#[test]
fn a_missing_mask_is_reported_as_a_fault_that_names_it() {
    let dir = tempfile::tempdir().unwrap();
    let dataset = dataset(dir.path());
    let models = models(&dataset, &[BLOCK]);
    let mut refiner = Refiner::preset(Preset::Hybrid);
    let scene = dir.path().join("test/000001");
    let mut missing = |name: &str| {
        std::fs::remove_file(scene.join(name)).unwrap();
        let mut frame = MaskSource::Visible.frame(KEY, image(&dataset));
        let chosen = frame.choose(&mut refiner, &models.by_id[&BLOCK], BLOCK, &[truth()]);
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
    let dir = tempfile::tempdir().unwrap();
    let limits = ReadLimits {
        max_triangles: 3,
        max_pixels: 5,
        ..ReadLimits::DEFAULT
    };
    let dataset = dataset(dir.path()).with_limits(limits);
    let folder = ModelFolder::open(dataset.models_dir().unwrap()).unwrap();
    assert!(folder.read(BLOCK).unwrap().is_some());
    let folder = ModelFolder::open_within(limits, dataset.models_dir().unwrap()).unwrap();
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
    assert!(scene.with_limits(ReadLimits::DEFAULT).read_depth(4).is_ok());
    let missing: IoError = dataset.scene("test", 2).unwrap_err();
    assert!(Fault::of(&missing).kind == FaultKind::Missing);
    assert_eq!(fault, Fault::damaged(fault.text.clone()));
}

#[test]
fn the_observations_of_an_image_share_its_depth() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = dataset(folder.path());
    let image = image(&dataset);
    let depth = Arc::clone(&image.depth);
    let read = models(&dataset, &[BLOCK]);
    let model = &read.by_id[&BLOCK];
    let mut refiner = Refiner::preset(Preset::Hybrid);

    let mut frame = MaskSource::Visible.frame(KEY, image);
    let chosen = frame.choose(&mut refiner, model, BLOCK, &[estimate()]);
    let observation = frame.observation(*chosen[0].as_ref().unwrap()).unwrap();
    assert!(Arc::ptr_eq(observation.shared_depth(), &depth));
    let boxed = frame.observe_box(&mut refiner, model, &estimate(), &BoxMask::default());
    assert!(Arc::ptr_eq(boxed.unwrap().shared_depth(), &depth));
}

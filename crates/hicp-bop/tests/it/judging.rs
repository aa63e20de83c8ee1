//! The evaluation of an image's estimates against its ground truth.

use std::collections::BTreeMap;

use hicp_bop::{EvaluatedObject, Judge, Renders, RowStatus, visible_objects};
use hicp_io::bop::ResultRow;
use hybrid_icp::core::{Isometry3, Vector3};

use crate::common::{BLOCK, KEY, World, estimate, truth};

#[test]
fn errors_are_those_of_the_best_rows() {
    let world = World::new();
    let scenes = world.scenes();
    let row = |object, pose, score| {
        let mut row = ResultRow::new(KEY.0, KEY.1, object, pose);
        row.score = score;
        row
    };
    let rows = [
        row(BLOCK, estimate(), 0.2),
        row(9, truth(), 0.9),
        row(BLOCK, truth(), 0.8),
    ];
    let objects = EvaluatedObject::of_models(&world.models, Some(&[BLOCK]));
    assert!(objects[&BLOCK].symmetric);
    let judge = Judge::new(objects, &scenes, &rows, 0.015);
    assert_eq!(judge.rows_of(KEY, BLOCK), [0, 2]);

    let mut renders = Renders::default();
    let judged = judge.frame(&mut renders, KEY, &BTreeMap::from([(BLOCK, 1), (9, 2)]));
    assert_eq!((judged.left_out, judged.faults.len()), (2, 0));
    assert!(judged.misfits.is_empty(), "{:?}", judged.misfits);
    assert_eq!(judged.targets.len(), 1);
    let target = &judged.targets[0];
    assert_eq!((target.frame, target.obj_id), (KEY, BLOCK));
    assert_eq!((&target.rows[..], &target.truths[..]), (&[2][..], &[0][..]));
    let error = &target.errors.estimates[0][0];
    assert_eq!(error.vsd, [0.0; 10]);
    assert!(error.add_m < 1e-12 && error.adi_m < 1e-12);

    // Evaluate both estimates. The second one has a known translation error.
    let image = scenes.read(KEY).unwrap();
    assert_eq!(visible_objects(&image.scene, KEY.1), [BLOCK]);
    let target = judge.target(&mut renders, &image, KEY, BLOCK, vec![0], 2);
    let target = target.unwrap().unwrap();
    assert_eq!(target.rows, [2, 0]);
    let shift: f64 = Vector3::new(0.004, -0.003, 0.004).norm();
    let error = &target.errors.estimates[1][0];
    assert!((error.translation_m - shift).abs() < 1e-9 && (error.add_m - shift).abs() < 1e-6);
    let missing = judge.target(&mut renders, &image, KEY, 9, vec![0], 1);
    assert!(missing.unwrap().is_none());
}

/// Stored results must be read back exactly, because programs store them and resume from them.
#[test]
fn results_are_stored_bit_for_bit() {
    let row = |status, pose, mve| hicp_bop::RowResult {
        pose,
        mve,
        ..hicp_bop::RowResult::unrefined(4, status)
    };
    let pose = Isometry3::new(Vector3::new(0.1, -0.2, 0.7), Vector3::new(0.3, 2.0, -1.0));
    let result = hicp_bop::FrameResult {
        rows: vec![
            row(RowStatus::Refined, Some(pose), Some((0.1 + 0.2, 1.0 / 3.0))),
            row(RowStatus::NoMask, None, None),
        ],
        seconds: Some(0.7 / 3.0),
        uncolored: false,
        faults: vec![hicp_bop::Fault::damaged("a\n\"b\"".to_owned())],
        warnings: vec![(
            7,
            hybrid_icp::Warning::Depth {
                measured: 0.1 + 0.2,
                expected: 1.0 / 3.0,
            },
        )],
    };
    let text = serde_json::to_string(&result).unwrap();
    let read: hicp_bop::FrameResult = serde_json::from_str(&text).unwrap();
    assert_eq!(read, result);
    let other = text.replace("kept: no mask", "kept: no task");
    assert!(serde_json::from_str::<hicp_bop::FrameResult>(&other).is_err());
}

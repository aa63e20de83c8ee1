//! Result files: accepted forms, refused content, and exact numbers of unchanged rows.

use std::error::Error;
use std::path::Path;

use hicp_core::{Isometry3, RotationError, Vector6, se3};
use hicp_io::bop::{ResultRow, read_results, results_from_csv, write_results};
use hicp_io::{IoError, IoErrorKind, Place};
use proptest::prelude::*;

use crate::common::Folder;

const HEADER: &str = "scene_id,im_id,obj_id,score,R,t,time";
const EYE: &str = "1 0 0 0 1 0 0 0 1";

fn read(text: impl AsRef<[u8]>) -> Result<Vec<ResultRow>, IoError> {
    let folder = Folder::new();
    read_results(folder.write("a.csv", text))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn rows_are_read_back_exactly(
        twists in prop::collection::vec(prop::array::uniform6(-3.0_f64..3.0), 0..5),
        score in -1e30_f64..1e30,
        time in prop::option::of(0.0_f64..1e3),
    ) {
        let rows: Vec<ResultRow> = (0..).zip(&twists).map(|(id, twist)| {
            let mut row = ResultRow::new(id, id + 1, id + 2, se3::exp(&Vector6::from(*twist)));
            (row.score, row.time_s) = (score, time);
            row
        }).collect();
        let folder = Folder::new();
        let path = folder.path("a.csv");
        write_results(&path, &rows).unwrap();
        let back = read_results(&path).unwrap();
        prop_assert_eq!(back.len(), rows.len());
        for (a, b) in back.iter().zip(&rows) {
            prop_assert_eq!(a.rotation(), b.rotation());
            prop_assert_eq!(a.translation_mm(), b.translation_mm());
            prop_assert_eq!((a.scene_id, a.im_id, a.obj_id), (b.scene_id, b.im_id, b.obj_id));
            prop_assert_eq!((a.score, a.time_s), (b.score, b.time_s));
            let (angle, distance) = se3::pose_distance(&a.camera_from_object(), &b.camera_from_object());
            prop_assert!(angle < 1e-12 && distance < 1e-12);
        }
    }
}

#[test]
fn an_unchanged_row_keeps_its_numbers_and_a_new_pose_replaces_them() {
    // Orthogonal only to 5e-4.
    let rotation = "1.0002 0 0 0 0.9998 0 0 0 1";
    let mut rows = read(format!(
        "{HEADER}\n50,1,2,0.5,{rotation},0.1 0.2 1035.65777,-1\n"
    ))
    .unwrap();
    let folder = Folder::new();
    let path = folder.path("out.csv");
    write_results(&path, &rows).unwrap();
    assert_eq!(
        std::fs::read_to_string(&path).unwrap(),
        format!("{HEADER}\n50,1,2,0.5,{rotation},0.1 0.2 1035.65777,-1\n")
    );
    assert!((rows[0].camera_from_object().translation.z - 1.035_657_77).abs() < 1e-12);

    rows[0].set_camera_from_object(Isometry3::translation(0.0, 0.0, 0.5));
    write_results(&path, &rows).unwrap();
    assert_eq!(
        std::fs::read_to_string(&path).unwrap(),
        format!("{HEADER}\n50,1,2,0.5,{EYE},0 0 500,-1\n")
    );
}

#[test]
fn files_of_any_form_are_read() {
    let text = format!(
        "\u{feff}im_id, scene_id ,obj_id,t,R,score,time,note\r\n\r\n 1 , 50,2, 1  2 3 ,\"{EYE}\",1e0,0.25,x\r\n  \r\n2,50,2,1 2 3,{EYE},0,-1,"
    );
    let rows = read(&text).unwrap();
    assert_eq!(rows.len(), 2);
    assert_eq!((rows[0].scene_id, rows[0].im_id), (50, 1));
    assert_eq!(rows[0].translation_mm(), &[1.0, 2.0, 3.0]);
    assert_eq!((rows[0].time_s, rows[1].time_s), (Some(0.25), None));
    assert!(read(HEADER).unwrap().is_empty());
}

#[test]
fn errors_name_the_line_and_the_column_of_invalid_content() {
    let good = ["50", "1", "2", "0.5", EYE, "0 0 500", "-1"];
    for (index, bad, name) in [
        (0, "-1", "scene_id"),
        (1, "1.5", "im_id"),
        (2, "", "obj_id"),
        (3, "nan", "score"),
        (4, "1 0 0 0 1 0 0 0", "R"),
        (4, "1 0 0 0 1 0 0 0 inf", "R"),
        (5, "0 0 x", "t"),
        (5, "0 0 1 2", "t"),
        (6, "fast", "time"),
    ] {
        let mut cells = good;
        cells[index] = bad;
        let text = format!("{HEADER}\n{}\n\n{}\n", good.join(","), cells.join(","));
        match read(&text) {
            Err(IoError {
                place: Some(Place::Field(place)),
                found,
                ..
            }) => {
                assert_eq!(place, format!("line 4, column {name:?}"));
                assert_eq!(found, format!("{bad:?}"));
            }
            other => panic!("{bad}: {other:?}"),
        }
    }
    let reflection = format!("{HEADER}\n50,1,2,1,1 0 0 0 1 0 0 0 -1,0 0 1,-1");
    let error = read(&reflection).unwrap_err();
    let place = Place::Field("line 2, column \"R\"".to_owned());
    assert_eq!(error.place, Some(place));
    let source = error.source().unwrap().downcast_ref::<RotationError>();
    assert!(matches!(source, Some(RotationError::Determinant { .. })));
}

#[test]
fn tables_that_are_not_results_are_refused() {
    for (header, column, times) in [
        ("a,b", "scene_id", 0),
        ("scene_id,im_id,obj_id,score,R,t", "time", 0),
        ("scene_id,im_id,obj_id,score,R,t,time,t", "t", 2),
    ] {
        let error = read(header).unwrap_err();
        let found = format!("column {column:?} appears {times} times");
        assert!(error.found.contains(&found), "{error}");
        assert!(error.expected.contains(HEADER), "{error}");
        assert_eq!(error.place, Some(Place::Line(1)));
    }
    assert_eq!(read("").unwrap_err().found, "no header");
    let error = read(format!("{HEADER}\n50,1,2,1,{EYE},0 0 1\n")).unwrap_err();
    assert_eq!(error.place, Some(Place::Line(2)));
    assert_eq!(
        (&*error.found, &*error.expected),
        ("6 fields", "7 as in the header")
    );
    let latin = [HEADER.as_bytes(), b"\n50,1,2,1,M\xfcller,0 0 1,-1\n"].concat();
    assert!(matches!(
        read(latin),
        Err(IoError {
            place: Some(Place::Line(2)),
            ..
        })
    ));
    let utf16 = b"\xff\xfes\0";
    assert!(matches!(
        read(utf16),
        Err(IoError { kind: IoErrorKind::Encoding, found, .. }) if found.contains("UTF-16 LE")
    ));
}

#[test]
fn content_in_memory_is_read_like_a_file() {
    let row = ResultRow::new(1, 2, 3, Isometry3::identity());
    let text = format!("{}\n{row}\n", ResultRow::header());
    assert_eq!(ResultRow::header(), HEADER);
    let path = Path::new("rows of a message");
    let rows = results_from_csv(text.as_bytes(), path).unwrap();
    assert_eq!(rows, read(&text).unwrap());
    assert_eq!(rows, [row]);
    let error = results_from_csv(text.replace(",2,", ",two,").as_bytes(), path).unwrap_err();
    for part in ["rows of a message", "2", "im_id", "two"] {
        assert!(error.to_string().contains(part), "{error}");
    }
}

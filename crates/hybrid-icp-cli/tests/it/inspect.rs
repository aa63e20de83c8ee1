//! `hybrid-icp inspect`.

use crate::common::*;
use hicp_io::LengthUnit;
use serde_json::Value;

const CUBE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
    f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

/// Returns the JSON report about a file.
fn inspected(name: &str, content: impl AsRef<[u8]>, options: &str) -> Value {
    let folder = Folder::new();
    folder.write(name, content);
    let run = folder
        .command(format!("inspect {name} --json {options}"))
        .exits(0);
    assert_eq!(run.err, "");
    run.json()
}

#[track_caller]
fn warned(value: &Value, parts: &[&str]) {
    let warnings = value["warnings"].as_array().unwrap();
    let texts: Vec<&str> = warnings.iter().map(|text| text.as_str().unwrap()).collect();
    for part in parts {
        assert!(
            texts.iter().any(|text| text.contains(part)),
            "no {part:?} in {texts:?}"
        );
    }
    assert_eq!(texts.len(), parts.len(), "{texts:?}");
}

#[test]
fn a_clean_mesh() {
    let cube = inspected("cube.obj", CUBE, "");
    assert_eq!(cube["triangles"], 12);
    assert_eq!(cube["vertices"], 8);
    assert!((cube["diameter_m"].as_f64().unwrap() - 3.0_f64.sqrt()).abs() < 1e-9);
    assert_eq!(cube["closed"], true);
    assert_eq!(cube["facing"], "outward");
    let corners = serde_json::json!([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]);
    assert_eq!(cube["bounding_box_m"], corners);
    assert_eq!(cube["area_m2"], 6.0);
    assert_eq!(
        (&cube["components"], &cube["color"]),
        (&1.into(), &"none".into())
    );
    warned(&cube, &[]);
    let textured = "mtllib gone.mtl\nusemtl red\n".to_owned() + CUBE;
    warned(
        &inspected("cube.obj", textured, ""),
        &["colors cannot be used: "],
    );
    let folder = Folder::new();
    hicp_io::write_ply(folder.path("car.ply"), &car(), LengthUnit::Millimeters).unwrap();
    let told = folder.command("inspect car.ply --unit mm").exits(0);
    told.prints(&["car.ply", "diameter 0."]);
}

#[test]
fn flaws_are_warned_of() {
    let small = inspected("cube.obj", CUBE, "--unit mm");
    warned(
        &small,
        &["the diameter with --unit mm is 1.7321e-3 m, expected 0.005 to 5 m; in m"],
    );
    assert_eq!(small["suspected_unit"], "m");
    let large = inspected("cube.obj", CUBE, "--unit cm --max-rows 1");
    assert_eq!(large["suspected_unit"], Value::Null);
    assert_eq!(large["unit"], "cm");
    let open = CUBE.replace("f 4 3 2 1\n", "");
    let open = inspected("cube.obj", open, "");
    assert_eq!(open["closed"], false);
    warned(
        &open,
        &["the surface is open: edges with only one triangle: 4"],
    );
    let turned = inspected("cube.obj", CUBE.replace("f 4 3 2 1", "f 1 2 3 4"), "");
    assert_eq!(turned["closed"], true);
    assert_eq!(turned["facing"], "unknown");
    warned(&turned, &["edges whose triangles have opposite winding: 4"]);
    let twice = inspected("cube.obj", format!("{CUBE}f 5 6 7\n"), "");
    warned(
        &twice,
        &[
            "edges with more than two triangles: 3",
            "duplicate triangles: 1",
        ],
    );
    let flat = inspected("cube.obj", format!("{CUBE}f 1 1 2\n"), "");
    warned(&flat, &["triangles without area: 1"]);
    let off = "OFF\n4 1 0\n0 0 0\n1 0 0\n0 1 0\n7 7 7\n3 0 1 2\n";
    warned(
        &inspected("a.off", off, ""),
        &["only one triangle: 3", "vertices without a triangle: 1"],
    );
    let far = "v 500000 4582345.26 0\nv 500001 4582345 0\nv 500000 4582346 0\nf 1 2 3\n";
    warned(
        &inspected("a.obj", far, ""),
        &["steps of 5.0e-1 m", "only one triangle: 3"],
    );
}

#[test]
fn files_that_cannot_be_read_are_errors_and_limits_can_be_raised() {
    let folder = Folder::new();
    folder.write("cube.obj", CUBE);
    let inspect = |options: &str| folder.command(format!("inspect cube.obj {options}"));
    inspect("--max-triangles 11").fails(&[
        "cube.obj, line 14",
        "found 12 triangles, expected at most 11",
        "--max-triangles",
    ]);
    inspect("--max-triangles 12 --max-vertices 8").exits(0);
    inspect("--max-file-bytes 9").fails(&["expected at most 9", "--max-file-bytes"]);
    folder
        .command("inspect no.stl")
        .fails(&["cannot read no.stl"]);
    folder.command("inspect .").fails(&["found a folder"]);
    folder.command("inspect cube.obj --unit inch").exits(2);
    let scene = Scene::new().with("--max-small-json-bytes", "9");
    scene
        .run()
        .fails(&["camera.json", "at most 9", "--max-small-json-bytes"]);
    // A limit applies wherever the option is on the command line.
    let scene = Scene::new().with("--max-pixels", "1000");
    scene
        .run()
        .fails(&["depth.png", "320x240", "at most 1000", "--max-pixels"]);
}

#[test]
fn awkward_files_have_the_verdicts_of_a_reference_reader() {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let root = std::env::var_os("HICP_DATA").unwrap_or_else(|| beside.into());
    let folder = std::path::PathBuf::from(root).join("awkward");
    let Ok(manifest) = std::fs::read(folder.join("manifest.json")) else {
        println!(
            "skipped: {} does not exist (set HICP_DATA)",
            folder.display()
        );
        return;
    };
    let manifest: Vec<Value> = serde_json::from_slice(&manifest).unwrap();
    let mut read = 0;
    for entry in &manifest {
        let file = entry["file"].as_str().unwrap();
        let expected = entry["expected"].as_str().unwrap();
        let told = run(&folder, ["inspect", file, "--json"]);
        match told.code {
            0 => {
                assert!(
                    !expected.starts_with("clean-error ") && expected != "clean-error",
                    "{file}"
                );
                let value = told.json();
                assert_eq!(value["triangles"], entry["trimesh_triangles"], "{file}");
                read += 1;
                if value["closed"] != entry["watertight"] {
                    println!(
                        "{file}: closed {}, reference {}",
                        value["closed"], entry["watertight"]
                    );
                }
            }
            code => {
                assert_eq!(code, 1);
                assert!(
                    !expected.eq("load") && !expected.starts_with("load ("),
                    "{file}: {}",
                    told.err
                );
                assert_contains(&told.err, &[file]);
                let has_place = [", line ", ", byte "].iter().any(|p| told.err.contains(p));
                assert!(has_place, "{}", told.err);
            }
        }
    }
    println!("{read} of {} read", manifest.len());
    assert!(read > 40);
}

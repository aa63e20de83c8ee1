//! Realistic mesh files: each one loads as with a reference reader, or is refused with a clear
//! error.

use std::path::Path;

use hicp_io::{LengthUnit, read_mesh};
use serde_json::Value;

/// Files with another expectation here than with the reference reader, and the reason.
const REFUSED: [(&str, &str); 5] = [
    ("box_UTF16BE.obj", "text must be UTF-8"),
    (
        "derived_degenerate_and_out_of_range.obj",
        "a face names a vertex that is not there",
    ),
    ("issue623.ply", "vertices hold the list, there are no faces"),
    ("malformed.obj", "a face names a vertex that is not there"),
    ("number_formats.obj", "`3.1+e2` is not a number"),
];

fn expected_triangles(entry: &Value) -> Option<u64> {
    let file = entry["file"].as_str().unwrap();
    let may_load = entry["expected"].as_str().unwrap().starts_with("load");
    let refused = REFUSED.iter().any(|(name, _)| *name == file);
    let count = entry["trimesh_triangles"].as_u64();
    count.filter(|count| may_load && !refused && *count > 0)
}

#[test]
fn awkward_files_load_or_are_refused_cleanly() {
    let Some(folder) = crate::common::data("awkward") else {
        return;
    };
    let manifest = std::fs::read(folder.join("manifest.json")).unwrap();
    let manifest: Vec<Value> = serde_json::from_slice(&manifest).unwrap();
    let mut wrong = Vec::new();
    for entry in &manifest {
        let file = entry["file"].as_str().unwrap();
        let result = read_mesh(folder.join(file), LengthUnit::Meters);
        match (&result, expected_triangles(entry)) {
            (Ok(mesh), Some(expected)) => {
                if mesh.triangles().len() as u64 != expected {
                    wrong.push(format!(
                        "{file}: {} triangles, not {expected}",
                        mesh.triangles().len()
                    ));
                }
                let largest = mesh
                    .vertices()
                    .iter()
                    .flat_map(|p| p.iter().map(|x| f64::from(x.abs())))
                    .fold(0.0, f64::max);
                let stated = entry["max_abs_coord"].as_f64().unwrap();
                if (largest / stated - 1.0).abs() > 1e-6 {
                    wrong.push(format!("{file}: reaches {largest} m, not {stated}"));
                }
            }
            (Err(error), None) => {
                let text = error.to_string();
                assert!(text.contains(file), "{text}");
                let place = text.contains(", line ") || text.contains(", byte ");
                assert!(
                    place && text.contains("expected") || text.contains("promises"),
                    "{text}"
                );
                println!("{file}: {text}");
            }
            (Ok(mesh), None) => {
                wrong.push(format!("{file}: loads with {}", mesh.triangles().len()));
            }
            (Err(error), Some(_)) => wrong.push(format!(
                "{file}: {error} / {:?}",
                std::error::Error::source(error)
            )),
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(manifest.len() > 50);
}

#[test]
fn truncated_and_damaged_meshes_never_panic() {
    let Some(folder) = crate::common::data("awkward") else {
        return;
    };
    let dir = tempfile::tempdir().unwrap();
    for file in std::fs::read_dir(folder).unwrap() {
        let file = file.unwrap().path();
        let content = std::fs::read(&file).unwrap();
        if content.len() > 60_000 {
            continue;
        }
        let copy = dir.path().join(file.file_name().unwrap());
        for part in 1..24 {
            let cut = content.len() * part / 24;
            check(&copy, &content[..cut]);
            let mut damaged = content.clone();
            for byte in damaged.iter_mut().skip(cut).step_by(97) {
                *byte ^= 0x55;
            }
            check(&copy, &damaged);
        }
    }
}

fn check(path: &Path, content: &[u8]) {
    std::fs::write(path, content).unwrap();
    if let Ok(mesh) = read_mesh(path, LengthUnit::Millimeters) {
        assert!(mesh.area() > 0.0);
    }
}

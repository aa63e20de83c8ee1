//! The side of this project in the comparison of point cloud registrations, run by `cargo xtask
//! peers`.
//!
//! `peer_clouds` reads commands from standard input and prints a line of JSON for each:
//!
//! - `simulate NUMBER FOLDER` writes two scans of an object to a folder: `source.f32`,
//!   `target.f32` (raw little-endian points, meters), and the poses in `meta.json`.
//! - `run METHOD GATE FOLDER` registers the clouds of a folder, from points without normals.

use std::path::Path;
use std::time::Instant;

use hicp_benches::instances::instance;
use hicp_benches::peer::{Failure, matrix, serve, write_floats};
use hicp_sim::{RelativeGaussian, rng};
use hicp_tests::render;
use hybrid_icp::core::{Isometry3, Matrix4, Observation, Point3, UnitQuaternion, Vector3};
use hybrid_icp::nalgebra;
use hybrid_icp::{CloudOptions, Registration, align};
use serde_json::{Value, json};

/// The second scan is taken after a rotation of the object by this angle, degrees.
const BETWEEN_SCANS: f64 = 15.0;

/// Depth noise, percent of the depth.
const NOISE: f64 = 0.1;

fn main() -> Result<(), Failure> {
    serve(|line| {
        let words: Vec<&str> = line.splitn(4, ' ').collect();
        match words[..] {
            ["simulate", number, folder] => simulate(number.parse()?, Path::new(folder)),
            ["run", method, gate, folder] => run(method.parse()?, gate.parse()?, Path::new(folder)),
            _ => Err(format!("unknown command {line:?}").into()),
        }
    })
}

/// Writes two scans of an object with noise, the true pose between them, and an initial pose 6.2 mm
/// and 9.5° off.
fn simulate(number: usize, folder: &Path) -> Result<Value, Failure> {
    std::fs::create_dir_all(folder)?;
    let instance = instance(number, NOISE);
    let (scene, camera) = (&instance.scene, instance.scene.observation.camera());
    let axis = nalgebra::Unit::new_normalize(Vector3::new(0.3, 1.0, 0.2));
    let rotation = UnitQuaternion::from_axis_angle(&axis, BETWEEN_SCANS.to_radians());
    let center = scene.truth * scene.model.center();
    let target_from_source = nalgebra::Translation3::from(center.coords)
        * rotation
        * nalgebra::Translation3::from(-center.coords);
    let (depth, mask) = render(&scene.model, camera, &(target_from_source * scene.truth));
    let noise = RelativeGaussian { percent: NOISE };
    let depth = noise.apply(&mut rng(number as u64), &depth);
    let target = Observation::new(depth, mask, *camera)?;
    for (name, observation) in [("source", &scene.observation), ("target", &target)] {
        let points = observation.surfels(1).map(|(_, s)| s.point);
        write_floats(folder, name, points.flat_map(|p| [p.x, p.y, p.z]))?;
    }
    let init = target_from_source * instance.init * scene.truth.inverse();
    let meta = json!({ "truth": matrix(&target_from_source), "init": matrix(&init) });
    std::fs::write(folder.join("meta.json"), serde_json::to_vec(&meta)?)?;
    Ok(meta)
}

/// Registers two clouds; the normals and the search trees are built from the points.
fn run(method: Registration, gate: f64, folder: &Path) -> Result<Value, Failure> {
    let meta: Value = serde_json::from_slice(&std::fs::read(folder.join("meta.json"))?)?;
    let init: Vec<f64> = serde_json::from_value(meta["init"].clone())?;
    let init = Matrix4::from_row_slice(&init);
    let init: Isometry3<f64> =
        nalgebra::try_convert(init).ok_or("the initial pose is not a rigid motion")?;
    let (source, target) = (read(folder, "source")?, read(folder, "target")?);
    let options = CloudOptions::default();

    let start = Instant::now();
    let source = options.for_source_of(method).cloud(&source, None)?;
    let target = options.cloud(&target, None)?;
    let prepared = Instant::now();
    let found = align(&source, &target, &init, &mut *method.build(Some(gate)));
    let end = Instant::now();

    let nanoseconds = |from: Instant, to: Instant| (to - from).as_secs_f64() * 1e9;
    Ok(json!({
        "normals_ns": nanoseconds(start, prepared),
        "align_ns": nanoseconds(prepared, end),
        "iterations": found.outcome.iterations,
        "pose": matrix(&found.target_from_source()),
    }))
}

fn read(folder: &Path, name: &str) -> Result<Vec<Point3<f32>>, Failure> {
    let bytes = std::fs::read(folder.join(format!("{name}.f32")))?;
    let numbers = bytes
        .chunks_exact(4)
        .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let numbers: Vec<f32> = numbers.collect();
    Ok(numbers
        .chunks_exact(3)
        .map(|p| Point3::new(p[0], p[1], p[2]))
        .collect())
}

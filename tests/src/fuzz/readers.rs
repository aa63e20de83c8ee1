//! Fuzz targets of the readers.
//!
//! Whatever the bytes, a reader returns a valid value, or an error that names the file.

use std::path::Path;

use hicp_io::bop::{
    Rle, Scene, read_detections, read_models_info, read_results, read_targets, write_results,
};
use hicp_io::{
    IoError, LengthUnit, MaskFile, MaskRule, read_camera, read_camera_json, read_cloud, read_color,
    read_depth, read_depth_png, read_mask, read_mask_png, read_mesh, read_pose, read_pose_json,
    write_mask_png, write_ply, write_pose_json,
};
use hybrid_icp::core::{TriMesh, se3};
use hybrid_icp::pipeline::PipelineFile;

use super::file::{next_to, with_bytes};

/// Returns the value, or checks the error.
///
/// An error must name the file and be short, even if it quotes the file.
fn checked<T>(path: &Path, result: Result<T, IoError>) -> Option<T> {
    match result {
        Ok(value) => Some(value),
        Err(error) => {
            let message = error.to_string();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            assert!(message.contains(&*name), "{message:?} does not name {name}");
            assert!(message.len() < 2000, "{} bytes: {message}", message.len());
            None
        }
    }
}

fn mesh(name: &'static str, data: &[u8]) {
    let path = with_bytes(name, data);
    let Some(mesh) = checked(&path, read_mesh(&path, LengthUnit::Meters)) else {
        return;
    };
    check_mesh(&mesh);
    let copy = next_to(&path, "copy.ply");
    write_ply(&copy, &mesh, LengthUnit::Meters).expect("a mesh that can be written");
    let back = read_mesh(&copy, LengthUnit::Meters).expect("a mesh that was written");
    assert_eq!(mesh.vertices(), back.vertices());
    assert_eq!(mesh.triangles(), back.triangles());
    assert!(
        checked(&path, read_mesh(&path, LengthUnit::Millimeters))
            .is_none_or(|m| m.triangles() == mesh.triangles())
    );
}

fn check_mesh(mesh: &TriMesh) {
    let n = mesh.vertices().len();
    assert!(
        mesh.vertices()
            .iter()
            .all(|p| p.iter().all(|c| c.is_finite()))
    );
    assert!(mesh.triangles().iter().flatten().all(|i| (*i as usize) < n));
    assert!(!mesh.triangles().is_empty());
    let area = mesh.area();
    assert!(area.is_finite() && area >= 0.0, "{area}");
}

pub(super) fn obj(data: &[u8]) {
    mesh("a.obj", data);
}

pub(super) fn gltf(data: &[u8]) {
    mesh("a.glb", data);
}

/// Reads the bytes as a point cloud of any format.
pub(super) fn cloud(data: &[u8]) {
    let path = with_bytes("a.cloud", data);
    if let Some(cloud) = checked(&path, read_cloud(&path, LengthUnit::Meters)) {
        assert!(cloud.points.iter().all(|p| p.iter().all(|x| x.is_finite())));
        assert!(
            cloud
                .normals
                .is_none_or(|normals| normals.len() == cloud.points.len())
        );
    }
}

pub(super) fn stl(data: &[u8]) {
    mesh("a.stl", data);
}

/// Reads the bytes as a mesh and as a point cloud.
pub(super) fn ply(data: &[u8]) {
    mesh("a.ply", data);
    let path = with_bytes("cloud.ply", data);
    let _ = checked(&path, read_cloud(&path, LengthUnit::Meters));
}

/// Reads the bytes as a depth image, a mask and a color image.
pub(super) fn png(data: &[u8]) {
    let path = with_bytes("a.png", data);
    if let Some(depth) = checked(&path, read_depth_png(&path, 0.1)) {
        assert!(depth.pixels().iter().all(|z| z.is_finite() && *z >= 0.0));
    }
    if let Some(mask) = checked(&path, read_mask_png(&path)) {
        let copy = next_to(&path, "copy.png");
        write_mask_png(&copy, &mask).expect("a mask that can be written");
        assert_eq!(read_mask_png(&copy).expect("a mask that was written"), mask);
    }
    checked(&path, read_color(&path));
}

/// Reads the bytes as a depth image and as a mask of any format.
pub(super) fn image(data: &[u8]) {
    let path = with_bytes("a.image", data);
    if let Some(depth) = checked(&path, read_depth(&path, Some(0.1))) {
        assert!(depth.pixels().iter().all(|z| z.is_finite() && *z >= 0.0));
    }
    for rule in [MaskRule::NotZero, MaskRule::AtLeast(0.5)] {
        if let Some(MaskFile { warning, .. }) = checked(&path, read_mask(&path, rule)) {
            assert!(warning.is_none_or(|text| text.len() < 500));
        }
    }
}

/// Reads the bytes as one of BOP's JSON files, selected by the first byte.
pub(super) fn bop_json(data: &[u8]) {
    let (kind, json) = data.split_first().unwrap_or((&b'c', &[]));
    match kind % 6 {
        0 => scene(
            "{\"0\":{\"cam_K\":[500,0,3,0,500,3,0,0,1]}}".as_bytes(),
            b"{}",
            json,
        ),
        1 => scene(
            "{\"0\":{\"cam_K\":[500,0,3,0,500,3,0,0,1]}}".as_bytes(),
            json,
            b"{}",
        ),
        2 => scene(json, b"{}", b"{}"),
        3 => {
            let path = with_bytes("models_info.json", json);
            let _ = checked(&path, read_models_info(&path));
        }
        4 => {
            let path = with_bytes("targets.json", json);
            let _ = checked(&path, read_targets(&path));
        }
        _ => {
            let path = with_bytes("detections.json", json);
            for detection in checked(&path, read_detections(&path)).unwrap_or_default() {
                detection
                    .segmentation
                    .iter()
                    .filter(|code| is_small(code))
                    .for_each(check_code);
            }
        }
    }
}

fn scene(camera: &[u8], truth: &[u8], info: &[u8]) {
    let path = with_bytes("scene_camera.json", camera);
    with_bytes("scene_gt.json", truth);
    with_bytes("scene_gt_info.json", info);
    let scene = match Scene::open(next_to(&path, "")) {
        Ok(scene) => scene,
        Err(error) => {
            let message = error.to_string();
            assert!(
                message.contains(".json") && message.len() < 2000,
                "{message}"
            );
            return;
        }
    };
    let ids: Vec<u32> = scene.image_ids().collect();
    for id in ids {
        if let Ok(camera) = scene
            .camera(id)
            .expect("an image of the scene")
            .pinhole(64, 48)
        {
            assert!(camera.fx().is_finite() && camera.fx() != 0.0);
        }
        for truth in scene.ground_truth(id).unwrap_or_default() {
            assert!(se3::is_finite(&truth.camera_from_object));
        }
    }
}

pub(super) fn results_csv(data: &[u8]) {
    let path = with_bytes("a.csv", data);
    let Some(rows) = checked(&path, read_results(&path)) else {
        return;
    };
    for row in &rows {
        assert!(se3::is_finite(&row.camera_from_object()), "{row:?}");
    }
    let copy = next_to(&path, "copy.csv");
    write_results(&copy, &rows).expect("rows that can be written");
    let back = read_results(&copy).expect("rows that were written");
    assert_eq!(back, rows);
}

/// Reads two bytes of size, then COCO's text, and the same bytes as plain counts.
pub(super) fn rle(data: &[u8]) {
    let [width, height, rest @ ..] = data else {
        return;
    };
    let (width, height) = (u32::from(*width), u32::from(*height));
    if let Ok(text) = std::str::from_utf8(rest)
        && let Ok(code) = Rle::from_compressed(width, height, text)
    {
        check_code(&code);
        let back = Rle::from_compressed(width, height, &code.to_compressed());
        assert_eq!(back.as_ref(), Ok(&code));
    }
    let counts = rest
        .chunks_exact(4)
        .map(|c| u32::from_le_bytes([c[0], c[1], c[2], c[3]]));
    if let Ok(code) = Rle::from_counts(width, height, counts.collect()) {
        check_code(&code);
    }
}

fn is_small(code: &Rle) -> bool {
    u64::from(code.width()) * u64::from(code.height()) < 1 << 16
}

fn check_code(code: &Rle) {
    let mask = code.to_mask();
    assert_eq!((mask.width(), mask.height()), (code.width(), code.height()));
    let set: u64 = code
        .counts()
        .iter()
        .skip(1)
        .step_by(2)
        .map(|c| u64::from(*c))
        .sum();
    assert_eq!(mask.n_set() as u64, set);
    assert_eq!(Rle::of_mask(&mask).to_mask(), mask);
}

/// Reads text and builds the pipeline without running it.
pub(super) fn pipeline_toml(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    let error = match PipelineFile::parse(text, "a.toml") {
        Ok(file) => file.build().err(),
        Err(error) => Some(error),
    };
    if let Some(error) = error {
        let message = error.to_string();
        assert!(
            message.contains("a.toml"),
            "{message:?} does not name a.toml"
        );
    }
}

pub(super) fn pose_json(data: &[u8]) {
    let path = with_bytes("pose.json", data);
    if let Some(file) = checked(&path, read_pose(&path, Some(LengthUnit::Meters))) {
        let pose = file.camera_from_object;
        assert!(se3::is_finite(&pose), "{pose:?}");
    }
    let Some(file) = checked(&path, read_pose_json(&path)) else {
        return;
    };
    let pose = file.camera_from_object;
    assert!(se3::is_finite(&pose), "{pose:?}");
    let copy = next_to(&path, "copy.json");
    write_pose_json(&copy, &pose).expect("a pose that can be written");
    let back = read_pose_json(&copy)
        .expect("a pose that was written")
        .camera_from_object;
    let (angle, distance) = se3::pose_distance(&back, &pose);
    assert!(
        angle < 1e-6 && distance <= 1e-9 * (1.0 + pose.translation.vector.norm()),
        "{pose:?} {back:?}"
    );
}

pub(super) fn camera_json(data: &[u8]) {
    let path = with_bytes("camera.json", data);
    for file in [
        checked(&path, read_camera_json(&path, (64, 48))),
        checked(&path, read_camera(&path, (64, 48))),
    ]
    .into_iter()
    .flatten()
    {
        let camera = file.camera;
        assert_eq!((camera.width(), camera.height()), (64, 48));
        assert!(
            [camera.fx(), camera.fy(), camera.cx(), camera.cy()]
                .iter()
                .all(|v| v.is_finite())
        );
        assert!(
            file.depth_scale
                .is_none_or(|scale| scale.is_finite() && scale > 0.0)
        );
    }
}

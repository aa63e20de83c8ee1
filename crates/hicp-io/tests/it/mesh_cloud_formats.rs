//! glTF meshes and point clouds that other programs wrote (`tests/fixtures/make.py`).

use std::path::PathBuf;

use hicp_core::TriMesh;
use hicp_io::{LengthUnit, read_cloud, read_mesh};
use serde_json::Value;

use crate::common::{Folder, data, fixture, refused};

/// The corners of the bounding box.
fn bounds(mesh: &TriMesh) -> [[f32; 3]; 2] {
    let fold = |start: f32, choose: fn(f32, f32) -> f32| {
        [0, 1, 2].map(|axis| mesh.vertices().iter().map(|p| p[axis]).fold(start, choose))
    };
    [fold(f32::MAX, f32::min), fold(f32::MIN, f32::max)]
}

fn near(found: [[f32; 3]; 2], expected: [[f32; 3]; 2], tolerance: f32) -> bool {
    let pairs = found.iter().flatten().zip(expected.iter().flatten());
    pairs
        .into_iter()
        .all(|(a, b)| (a - b).abs() <= tolerance * b.abs().max(1.0))
}

/// Six times the volume, which is negative if the mesh is inside out.
fn volume(mesh: &TriMesh) -> f32 {
    let corner = |index: u32| mesh.vertices()[index as usize].coords;
    let cone = |t: &[u32; 3]| corner(t[0]).dot(&corner(t[1]).cross(&corner(t[2])));
    mesh.triangles().iter().map(cone).sum()
}

#[test]
fn gltf_boxes_have_their_size_and_face_outward() {
    for name in ["mesh_model.gltf", "mesh_embedded.gltf"] {
        let mesh = read_mesh(fixture(name), LengthUnit::Meters).unwrap();
        assert_eq!(mesh.triangles().len(), 12, "{name}");
        assert!(
            near(
                bounds(&mesh),
                [[-0.05, -0.1, -0.15], [0.05, 0.1, 0.15]],
                1e-6
            ),
            "{name}"
        );
        assert!((volume(&mesh) - 6.0 * 0.006).abs() < 1e-6, "{name}");
    }
}

#[test]
fn nodes_turn_move_and_mirror_their_meshes() {
    let mesh = read_mesh(fixture("mesh_scene.glb"), LengthUnit::Meters).unwrap();
    assert_eq!(mesh.triangles().len(), 24);
    assert!(near(
        bounds(&mesh),
        [[-0.05, -0.1, -1.15], [1.1, 0.1, 0.15]],
        1e-6
    ));
    assert!(
        (volume(&mesh) - 2.0 * 6.0 * 0.006).abs() < 1e-5,
        "{}",
        volume(&mesh)
    );
}

#[test]
fn compressed_and_misnamed_meshes_are_refused_with_advice() {
    let folder = Folder::new();
    let copy = |name: &str, to: &str| folder.write(to, std::fs::read(fixture(name)).unwrap());
    for (path, parts) in [
        (
            fixture("mesh_draco.gltf"),
            ["Draco compression", "gltf-transform"],
        ),
        (
            copy("mesh_scene.glb", "a.ply"),
            ["a binary glTF file", "rename it to .glb"],
        ),
        (
            copy("cloud_binary.ply", "a.stl"),
            ["a PLY file", "rename it to .ply"],
        ),
        (copy("cloud.npy", "a.obj"), ["a NumPy array", ".glb"]),
        (
            copy("mesh_model.gltf", "b.gltf"),
            ["cannot be read", "gltf_buffer.bin"],
        ),
    ] {
        refused(read_mesh(path, LengthUnit::Meters), &parts);
    }
}

/// Returns a glTF file with a node of one triangle, whose vertices are the first of `accessors`.
fn triangle(folder: &Folder, data: &[u8], views: &str, accessors: &str, rest: &str) -> PathBuf {
    folder.write("a.bin", data);
    let text = format!(
        r#"{{"buffers": [{{"uri": "a.bin", "byteLength": {}}}], "bufferViews": [{views}],
        "accessors": [{accessors}], "meshes": [{{"primitives": [{{"attributes":
        {{"POSITION": 0}}}}]}}], {rest}}}"#,
        data.len(),
    );
    folder.write("a.gltf", text)
}

#[test]
fn only_small_integers_are_normalized() {
    let folder = Folder::new();
    let read = |data: &[u8], views: &str, accessor: &str| {
        let rest = r#""nodes": [{"mesh": 0}]"#;
        let accessor = format!(r#"{{"type": "VEC3", "count": 3, "normalized": true, {accessor}}}"#);
        let path = triangle(&folder, data, views, &accessor, rest);
        bounds(&read_mesh(path, LengthUnit::Meters).unwrap())
    };
    let floats = [0.0_f32, 0.0, 0.0, -3.0, 0.0, 0.0, 0.0, 2.0, 0.0].map(f32::to_le_bytes);
    let view = r#"{"buffer": 0, "byteLength": 36}"#;
    let found = read(
        floats.as_flattened(),
        view,
        r#""bufferView": 0, "componentType": 5126"#,
    );
    assert_eq!(found, [[-3.0, 0.0, 0.0], [0.0, 2.0, 0.0]]);
    // Two bytes are the indices 1 and 2 of the sparse values in the others.
    let data = [1, 2, 127, 0, 0, 0, 127, 0];
    let views =
        r#"{"buffer": 0, "byteLength": 2}, {"buffer": 0, "byteOffset": 2, "byteLength": 6}"#;
    let sparse = r#""componentType": 5120, "sparse": {"count": 2, "values": {"bufferView": 1},
        "indices": {"bufferView": 0, "componentType": 5121}}"#;
    assert_eq!(read(&data, views, sparse), [[0.0; 3], [1.0, 1.0, 0.0]]);
}

#[test]
fn skins_morph_targets_and_extensions_do_not_move_a_mesh_unseen() {
    let folder = Folder::new();
    let corners = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes);
    let read = |rest: &str| {
        let view = r#"{"buffer": 0, "byteLength": 36}"#;
        let accessors = r#"{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}"#;
        let path = triangle(&folder, corners.as_flattened(), view, accessors, rest);
        read_mesh(path, LengthUnit::Meters)
    };
    for deformed in [r#""skin": 0"#, r#""weights": [0, 0.5]"#] {
        let found = read(&format!(r#""nodes": [{{"mesh": 0, {deformed}}}]"#));
        let parts = ["$.meshes[0]: found a mesh that a skin", "shape keys"];
        refused(found, &parts);
    }
    read(r#""nodes": [{"mesh": 0, "weights": [0, 0]}]"#).unwrap();
    let required = |name: &str| {
        read(&format!(
            r#""nodes": [{{"mesh": 0}}], "extensionsRequired": ["{name}"]"#
        ))
    };
    required("KHR_texture_transform").unwrap();
    let parts = [
        "$.extensionsRequired",
        "\"EXT_mesh_gpu_instancing\"",
        "Blender",
    ];
    refused(required("EXT_mesh_gpu_instancing"), &parts);
}

#[test]
fn a_gltf_file_cannot_read_other_folders_or_loop() {
    let folder = Folder::new();
    let refused = |text: &str, parts: &[&str]| {
        let path = folder.write("a.gltf", text);
        refused(read_mesh(path, LengthUnit::Meters), parts);
    };
    for uri in ["../secret.bin", "/etc/passwd", "file:///etc/passwd", "C:/x"] {
        let text = format!(r#"{{"buffers": [{{"uri": "{uri}", "byteLength": 4}}]}}"#);
        refused(&text, &["expected a file next to this one"]);
    }
    let text = r#"{"scenes": [{"nodes": [0]}], "nodes": [{"children": [0]}]}"#;
    refused(text, &["$.nodes[0]: found a node with two parents"]);
    let accessor = r#"{"componentType": 5126, "type": "VEC3", "count": 1000000000000}"#;
    let mesh =
        r#""nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]"#;
    let text = format!(r#"{{"accessors": [{accessor}], {mesh}}}"#);
    refused(&text, &["--max-vertices"]);
}

#[test]
fn clouds_of_every_format_are_the_same() {
    let points = [[0.1, -0.2, 0.8], [0.3, 0.1, 1.0], [-0.4, 0.25, 1.5]];
    let normals = [[0.0, 0.0, -1.0], [0.6, 0.0, -0.8], [0.0, 1.0, 0.0]];
    for name in [
        "cloud_ascii.pcd",
        "cloud_binary.pcd",
        "cloud_compressed.pcd",
        "cloud_bare.pcd",
        "cloud_binary.ply",
        "cloud.xyzn",
        "cloud_bare.xyz",
        "cloud_bare_named.csv",
        "cloud_named.csv",
        "cloud_bare_colors.xyz",
        "cloud.npy",
        "cloud_bare_organized.npy",
        "cloud_bare_several.npz",
    ] {
        let cloud = read_cloud(fixture(name), LengthUnit::Meters).unwrap();
        assert_eq!((cloud.points.len(), cloud.n_skipped), (3, 0), "{name}");
        for (found, expected) in cloud.points.iter().zip(points) {
            assert!(
                (found - hicp_core::Point3::from(expected)).norm() < 1e-6,
                "{name}: {found}"
            );
        }
        assert_eq!(cloud.normals.is_none(), name.contains("bare"), "{name}");
        for (found, expected) in cloud.normals.iter().flatten().zip(normals) {
            let error = (found.into_inner() - hicp_core::Vector3::from(expected)).norm();
            assert!(error < 1e-6, "{name}: {found:?}");
        }
    }
    let millimeters = read_cloud(fixture("cloud_ascii.pcd"), LengthUnit::Millimeters).unwrap();
    assert!((millimeters.points[0].x - 0.0001).abs() < 1e-9);
}

#[test]
fn points_without_a_usable_normal_are_skipped() {
    let folder = Folder::new();
    // The second normal has no length, the third one is infinite as `f32`.
    let text = "x y z nx ny nz\n0 0 1 0 0 -1\n0 0 2 0 0 0\n0 0 3 0 0 -1e39\n";
    let cloud = read_cloud(folder.write("a.xyzn", text), LengthUnit::Meters).unwrap();
    assert_eq!((cloud.points.len(), cloud.n_skipped), (1, 2));
}

/// Empty cells keep their place. Without a coordinate, a point is skipped.
#[test]
fn tables_have_one_separator() {
    let folder = Folder::new();
    for text in [
        "x,y,z,c\n1,2,3,9\n1,,3,9\n",
        "x\ty\tz\tc\n1\t2\t3\t9\n\t2\t3\t9\n",
        "point id,x,y,z\n7,1,2,3\n,1,2,\n",
        "time,,x,y,z\n7,,1,2,3\n8,5,1,nan,3\n",
        "c;\"x\";\"y\";\"z\"\n;1;2;3;\nlow, far;1;;3\n",
        "# z y x\n3, 2, 1,\n3, 2, ,\n",
        "2\n1 2 3\n1 2 nan\n",
        "//x, y, z\n  1  2\t 3 # far\n1 2 nan\n",
        "1,\t2,\t3\n1,\t,\t3\n",
        "\t1\t\t2\t\t3\n\t1\t\t2\t\tnan\n",
        "X;Y;Z\n1 2 3\n1 2 nan\n",
        "# Columns: x y z r g b\n1 2 3 4 5 6\n1 2 nan 4 5 6\n",
    ] {
        let cloud = read_cloud(folder.write("a.csv", text), LengthUnit::Meters).unwrap();
        assert_eq!(cloud.points, [[1.0, 2.0, 3.0].into()], "{text}");
        assert_eq!(cloud.n_skipped, 1, "{text}");
    }
}

/// Returns an NPY file of bytes.
fn npy(shape: &str) -> Vec<u8> {
    let header = format!("{{'descr': '|u1', 'fortran_order': False, 'shape': ({shape})}}");
    let length = u16::try_from(header.len()).unwrap().to_le_bytes();
    let start = [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes()].concat();
    [start, vec![1; 10_000]].concat()
}

#[test]
fn files_that_are_no_cloud_are_refused() {
    let folder = Folder::new();
    let whole = std::fs::read(fixture("cloud_binary.pcd")).unwrap();
    let header = String::from_utf8_lossy(&whole).replace("WIDTH 3", "WIDTH 99999999");
    let header = header.replace("POINTS 3", "POINTS 4000000");
    for (content, part) in [
        (whole[..whole.len() - 1].to_vec(), "promises 3 points"),
        (header.into_bytes(), "promises 4000000 points"),
        (
            b"VERSION .7\nFIELDS x y\nSIZE 4 4\nTYPE F F\nWIDTH 1\nHEIGHT 1\nDATA ascii\n1 2\n"
                .to_vec(),
            "x, y and z",
        ),
        (
            b"1 2 3\n4 five 6\n".to_vec(),
            "line 2: found \"five\" in the column y",
        ),
        (
            b"x;y;z\n1;2;3\n0,1;0,2;0,3\n".to_vec(),
            "line 3: found \"0,1\" in the column x",
        ),
        (
            b"0,1;0,2;0,3\n".to_vec(),
            "line 1: found \"0,1\" in the column x",
        ),
        (
            b"1;2;3;0,6;0,8;0\n".to_vec(),
            "found \"0,6\" in the column nx",
        ),
        (b"0,1 0,2 0,3\n".to_vec(), "in the column y"),
        (
            b"x [m],y [m],z [m],a\n1,2,3,4\n".to_vec(),
            "line 1: found \"x [m]\" in the column x",
        ),
        (
            b"i,x,y,z\n0,1,2,3\n1,2\n".to_vec(),
            "line 3: found \"1,2\", without a column y",
        ),
        (
            b"x,y,X,Y,Z\n1,2,3,4,5\n".to_vec(),
            "line 1: found two columns \"x\"",
        ),
        (npy("3, 48, 64"), "[3, 48, 64]"),
        (npy("1, 3, 50"), "[1, 3, 50]"),
        (npy("3, 50"), "[3, 50]"),
        (b"\x89HDF\r\n\x1a\n".to_vec(), "an HDF5 file"),
        (b"".to_vec(), "no points"),
    ] {
        let path = folder.write("a.pcd", content);
        refused(read_cloud(path, LengthUnit::Meters), &[part]);
    }
}

/// glTF files of the data folder, with the counts and bounds of a reference reader.
#[test]
fn real_gltf_files_agree_with_a_reference_reader() {
    let Some(folder) = data("gltf") else {
        return;
    };
    let manifest = std::fs::read(folder.join("manifest.json")).unwrap();
    let manifest: Vec<Value> = serde_json::from_slice(&manifest).unwrap();
    // The reference reader ignores fans and normalized integers, and reads what a damaged part of a
    // file does not reach.
    let differs = ["PrimitiveMode_12", "OutOfRange", "badObject", "quantized"];
    let mut wrong = Vec::new();
    for entry in &manifest {
        let file = entry["file"].as_str().unwrap();
        if differs.iter().any(|part| file.contains(part)) {
            continue;
        }
        let faces = entry["reader"]["faces"].as_u64();
        match read_mesh(folder.join(file), LengthUnit::Meters) {
            Ok(mesh) => {
                let expected = serde_json::from_value(entry["reader"]["bounds"].clone());
                let found = mesh.triangles().len() as u64;
                let same = expected.is_ok_and(|expected| near(bounds(&mesh), expected, 1e-4));
                if Some(found) != faces || !same {
                    wrong.push(format!(
                        "{file}: {found} faces {:?}, not {}",
                        bounds(&mesh),
                        entry["reader"]
                    ));
                }
            }
            Err(error) => {
                let text = error.to_string();
                let compressed = text.contains("Draco") || text.contains("meshopt");
                if entry["expect"] == "load" && faces != Some(0) && !compressed {
                    wrong.push(format!("{text} ({})", entry["reader"]));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    for name in ["apple", "bowl-soup", "cooking-spatula", "knife-block"] {
        let mesh = |path: String| read_mesh(folder.join(path), LengthUnit::Meters).unwrap();
        let quantized = mesh(format!("awkward/quantized_{name}.glb"));
        let original = mesh(format!("household/{name}.glb"));
        assert_eq!(
            quantized.triangles().len(),
            original.triangles().len(),
            "{name}"
        );
        assert!(near(bounds(&quantized), bounds(&original), 1e-4), "{name}");
    }
}

/// Clouds of sensors and other programs in the data folder.
#[test]
fn real_clouds_are_read() {
    let Some(folder) = data("pointclouds") else {
        return;
    };
    for (name, count, normals) in [
        ("pcl_bun0.pcd", 397, true),
        ("pcl_colored_cloud.pcd", 1000, true),
        ("pcl_cturtle.pcd", 167_198, false),
        ("pcl_milk.pcd", 13_704, false),
        ("ycbv50_1_ascii.pcd", 5339, false),
        ("ycbv50_1_binary_compressed.pcd", 32_029, false),
        ("ycbv50_1_double.ply", 32_029, false),
        ("ycbv50_1.xyzrgb", 5339, false),
        ("trimesh_points_agisoft.xyz", 100, false),
        ("trimesh_points_cloudcompare.xyz", 101, false),
    ] {
        let cloud = read_cloud(folder.join(name), LengthUnit::Meters);
        let cloud = cloud.unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(
            (cloud.points.len(), cloud.normals.is_some()),
            (count, normals),
            "{name}"
        );
    }
    for name in [
        "kinect_frame_20121214T142255.814212.pcd",
        "osd_learn0.pcd",
        "ycbv50_1_organised_binary.pcd",
    ] {
        let cloud = read_cloud(folder.join(name), LengthUnit::Meters).unwrap();
        assert!((10_000..307_200).contains(&cloud.points.len()), "{name}");
    }
    for name in [
        "libpointmatcher_car/car_cloud400.csv",
        "libpointmatcher_car/car_cloud401.csv",
    ] {
        let cloud = read_cloud(folder.join("../clouds").join(name), LengthUnit::Meters).unwrap();
        assert_eq!(cloud.normals.is_some(), name.contains("400"), "{name}");
    }
}

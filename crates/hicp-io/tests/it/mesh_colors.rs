//! Colors of meshes.

use std::path::Path;

use hicp_core::SurfaceColor;
use hicp_io::{LengthUnit, MeshFile, ReadLimits};

use crate::common::{Folder, assert_contains};

fn read(path: &Path) -> MeshFile {
    let read = ReadLimits::DEFAULT.read_mesh_file(path, LengthUnit::Meters);
    read.unwrap()
}

/// Reads the text of a PLY triangle whose vertices have these properties after their position.
fn ply(properties: &str, values: [&str; 3]) -> MeshFile {
    let names = properties.replace(' ', "\nproperty ").replace(':', " ");
    let [a, b, c] = values;
    let text = format!(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
         property float z\nproperty {names}\nelement face 1\n\
         property list uchar int vertex_indices\nend_header\n\
         0 0 0 {a}\n1 0 0 {b}\n0 1 0 {c}\n3 0 1 2\n"
    );
    let folder = Folder::new();
    let path = folder.write("a.ply", text);
    let geometry = ReadLimits::DEFAULT.read_mesh_geometry(&path, LengthUnit::Meters);
    assert!(geometry.unwrap().color().is_none());
    read(&path)
}

#[test]
fn ply_vertex_colors_of_every_type_are_read() {
    let expected = SurfaceColor::Vertices(vec![[255, 0, 51], [0, 102, 1], [1, 2, 204]]);
    let bytes = ["255 0 51", "0 102 1", "1 2 204"];
    let with_alpha = bytes.map(|color| format!("{color} 7"));
    let with_alpha = [0, 1, 2].map(|i: usize| with_alpha[i].as_str());
    let fractions = ["1 0 0.2", "0 0.4 0.004", "0.004 0.008 0.8"];
    let words = ["65535 0 13107", "0 26214 257", "257 514 52428"];
    for (properties, values) in [
        ("uchar:red uchar:green uchar:blue", bytes),
        (
            "uint8:diffuse_red uint8:diffuse_green uint8:diffuse_blue",
            bytes,
        ),
        ("uchar:red uchar:green uchar:blue uchar:alpha", with_alpha),
        ("float:red float:green float:blue", bytes),
        ("float:red float:green float:blue", fractions),
        ("ushort:red ushort:green ushort:blue", words),
    ] {
        let MeshFile { mesh, color_fault } = ply(properties, values);
        assert!(color_fault.is_none(), "{properties}: {color_fault:?}");
        assert_eq!(mesh.color(), Some(&expected), "{properties}");
    }
    // A mesh that is nearly black has bytes as well.
    let MeshFile { mesh, .. } = ply("uchar:red uchar:green uchar:blue", ["0 1 0"; 3]);
    let black = SurfaceColor::Vertices(vec![[0, 1, 0]; 3]);
    assert_eq!(mesh.color(), Some(&black));
}

#[test]
fn unusable_ply_colors_leave_the_mesh_without_color_and_are_reported() {
    let properties = "float:red float:green float:blue";
    let MeshFile { mesh, color_fault } = ply(properties, ["0 0 0", "0 nan 0", "0 0 0"]);
    assert!(mesh.color().is_none());
    let fault = color_fault.unwrap().to_string();
    assert_contains(&fault, &["vertex 1", "a.ply"]);
    let MeshFile { mesh, color_fault } = ply(properties, ["0 0 0", "0 red 0", "0 0 0"]);
    assert!(mesh.color().is_none() && color_fault.is_some());
    // Two of three channels are no color.
    let MeshFile { mesh, color_fault } = ply("uchar:red uchar:green", ["0 0"; 3]);
    assert!(mesh.color().is_none() && color_fault.is_none());
}

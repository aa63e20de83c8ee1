//! Malicious or damaged mesh files. Each error names the file, the place, the value found and the
//! value expected.

mod access;
mod content;

use std::fs::File;
use std::path::Path;

use hicp_io::{IoError, IoErrorKind, LengthUnit, Place, ReadLimits};
use hicp_io::{read_depth_png, read_mesh, read_pose_json};

use crate::common::{self, Folder, message};

/// Asserts that a mesh file is refused with its name and all of these texts.
#[track_caller]
fn refused(name: &str, content: impl AsRef<[u8]>, parts: &[&str]) {
    let folder = Folder::new();
    refused_mesh(&folder.write(name, content), &[&[name], parts].concat());
}

#[track_caller]
fn refused_mesh(path: &Path, parts: &[&str]) -> IoError {
    common::refused(read_mesh(path, LengthUnit::Meters), parts)
}

#[track_caller]
fn triangles(name: &str, content: impl AsRef<[u8]>) -> usize {
    let folder = Folder::new();
    let mesh = read_mesh(folder.write(name, content), LengthUnit::Meters);
    let mesh = mesh.unwrap_or_else(|error| panic!("{}", message(&error)));
    mesh.triangles().len()
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

fn ply(format: &str, vertices: &str, faces: &str, list: &str) -> String {
    format!(
        "ply\nformat {format} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {faces}\nproperty list {list} vertex_indices\nend_header\n"
    )
}

fn stl(header: &str, count: u32, triangles: u32) -> Vec<u8> {
    let mut content = header.as_bytes().to_vec();
    content.resize(80, b' ');
    content.extend(count.to_le_bytes());
    for number in 0..triangles {
        let x = number as f32;
        for value in [0., 0., 1., x, 0., 0., x + 1., 0., 0., x, 1., 0.] {
            content.extend(value.to_le_bytes());
        }
        content.extend([0, 0]);
    }
    content
}

#[test]
fn unusual_but_valid_files_are_read() {
    let odd = format!(
        "\u{feff}# tabs\r\n{}\tf\t1\t2\t3\t4",
        SQUARE.replace(' ', "\t").replace('\n', "\t# c\r\n")
    );
    assert_eq!(triangles("a.obj", odd), 2);
    assert_eq!(
        triangles("a.obj", format!("{SQUARE}f -4 -3 \\\n-2 \\\n-1")),
        2
    );
    assert_eq!(
        triangles("a.obj", format!("{SQUARE}f 1 1 2\nf 1 2 3\nf 1 2 3\n")),
        3
    );
    let ngon: String = (0..5000)
        .map(|i| f64::from(i).to_radians() / 14.0)
        .map(|a| format!("v {} {} 0\n", a.cos(), a.sin()))
        .collect();
    let corners: String = (1..=5000).map(|i| format!(" {i}")).collect();
    assert_eq!(triangles("a.obj", format!("{ngon}f{corners}")), 4998);
    let comments = "ply\ncomment a\nformat ascii 1.0\ncomment\nobj_info b\nelement vertex 3\ncomment c\nproperty double x\nproperty int16 y\nproperty uint8 z\nproperty list uint8 float32 uv\nelement face 1\nproperty uchar flags\nproperty list int8 uint16 vertex_index\nend_header\n0 0 0 0\n1 0 0 2 0.5 .5\n\n0 1\t0 1 nan\n7 3 0 1 2";
    assert_eq!(triangles("a.ply", comments), 1);
    assert_eq!(triangles("a.ply", comments.replace('\n', "\r\n")), 1);
    assert_eq!(triangles("a.ply", comments.replace('\n', "\r")), 1);
}

#[test]
fn other_text_encodings_are_refused() {
    let text = format!("{SQUARE}f 1 2 3\n");
    let wide = |bytes: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(bytes).collect::<Vec<u8>>();
    for (content, name) in [
        (wide(u16::to_be_bytes), "UTF-16 BE"),
        (wide(u16::to_le_bytes), "UTF-16 LE"),
    ] {
        refused("a.obj", content, &["byte 0", name, "UTF-8"]);
    }
    let off = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let wide: Vec<u8> = off.encode_utf16().flat_map(u16::to_le_bytes).collect();
    refused("a.off", wide, &["UTF-16 LE"]);
    for name in ["a.ply", "a.ply.gz"] {
        refused(name, [0x1f, 0x8b, 8, 0, 0, 0], &["gzip", "gunzip"]);
    }
    for name in ["a.ply", "a.pcd"] {
        let parts = ["PCD point cloud", "make a surface first"];
        refused(name, "# .PCD v0.7\n", &parts);
    }
    refused("a.xyz", "0 0 0\n", &["\"xyz\"", "expected .glb"]);
}

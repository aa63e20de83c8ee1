//! The shell blocks of the book run, in order, in a folder with the files that they name.

use std::path::Path;

use hicp_io::LengthUnit;
use hybrid_icp::core::{DepthImage, Isometry3, Mask, PinholeCamera};
use hybrid_icp::raster::render_depth_image;

use crate::common::*;

/// Returns the blocks of a page in one language.
fn blocks<'a>(page: &'a str, language: &str) -> Vec<&'a str> {
    let fence = format!("```{language}\n");
    let rest = page.split(fence.as_str()).skip(1);
    rest.filter_map(|block| block.split("\n```").next())
        .collect()
}

/// Writes the files that the page "From what you have" names, in other formats.
fn write_other_formats(scene: &Scene, depth: &DepthImage) {
    let npy = |name: &str, header: &str, data: Vec<u8>| {
        let header = format!("{header:<117}\n");
        let start = [b"\x93NUMPY\x01\x00", &118_u16.to_le_bytes()[..]].concat();
        scene.write(name, [&start, header.as_bytes(), &data].concat());
    };
    let (width, height) = (depth.width(), depth.height());
    let floats = |meters: &[f32]| {
        meters
            .iter()
            .flat_map(|z| z.to_le_bytes())
            .collect::<Vec<u8>>()
    };
    let header =
        format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({height}, {width}), }}");
    npy("depth.npy", &header, floats(depth.pixels()));
    let rows = depth.pixels().chunks_exact(width as usize).rev();
    let upside_down: Vec<u8> = rows.flat_map(floats).collect();
    let pfm = format!("Pf\n{width} {height}\n-1.0\n");
    scene.write("depth.pfm", [pfm.as_bytes(), &upside_down].concat());
    let labels = depth.pixels().iter().zip(0..);
    let labels = labels.flat_map(|(z, i)| [if *z > 0.0 { 3 } else { (i % 2) as u8 }; 3]);
    let labels: Vec<u8> = labels.collect();
    hicp_io::write_rgb_png(scene.path("labels.png"), width, height, &labels).unwrap();
    scene.write(
        "camera.yaml",
        "image_width: 320\nimage_height: 240\ncamera_matrix:\n  rows: 3\n  cols: 3\n  \
         data: [400, 0, 161.5, 0, 402, 118, 0, 0, 1]\n",
    );
    let text = |pose: &Isometry3<f64>| {
        let matrix = pose.to_homogeneous();
        let rows = matrix.row_iter();
        let rows = rows.map(|row| row.iter().map(f64::to_string).collect::<Vec<_>>().join(" "));
        rows.collect::<Vec<_>>().join("\n")
    };
    let init = off(&truth(), 5);
    scene.write("T.txt", text(&init));
    let (t, q) = (init.translation, init.rotation.coords);
    scene.write(
        "tum.txt",
        format!("{} {} {} {} {} {} {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w),
    );
    scene.write("color.txt", "500 0 200\n0 500 150\n0 0 1\n");
    let color = PinholeCamera::new(500.0, 500.0, 200.0, 150.0, 400, 300).unwrap();
    let color_from_depth = Isometry3::translation(-0.02, 0.005, 0.0);
    scene.write("color_from_depth.txt", text(&color_from_depth));
    let seen = render_depth_image(&car(), &color, &(color_from_depth * truth()));
    hicp_io::write_mask_png(scene.path("color_mask.png"), &Mask::measured(&seen)).unwrap();
    scene.write(
        "color_pose.json",
        pose_json(&(color_from_depth * init)).to_string(),
    );
    let gray = vec![90; 3 * width as usize * height as usize];
    hicp_io::write_rgb_png(scene.path("rgb.png"), width, height, &gray).unwrap();
    let mesh = car();
    let mut painted = String::new();
    for p in mesh.vertices() {
        let (p, red) = (p * 1000.0, if p.x > 0.0 { 1 } else { 0 });
        painted += &format!("v {} {} {} {red} 0.5 0\n", p.x, p.y, p.z);
    }
    for triangle in mesh.triangles() {
        let [a, b, c] = triangle.map(|index| index + 1);
        painted += &format!("f {a} {b} {c}\n");
    }
    scene.write("painted.obj", painted);
    let vertices: Vec<u8> = mesh
        .vertices()
        .iter()
        .flat_map(|p| floats(p.coords.as_slice()))
        .collect();
    let corners: Vec<u8> = mesh
        .triangles()
        .iter()
        .flatten()
        .flat_map(|i| i.to_le_bytes())
        .collect();
    let json = serde_json::json!({
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": mesh.vertices().len()},
            {"bufferView": 1, "componentType": 5125, "type": "SCALAR", "count": 3 * mesh.triangles().len()},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": vertices.len()},
            {"buffer": 0, "byteOffset": vertices.len(), "byteLength": corners.len()},
        ],
        "buffers": [{"byteLength": vertices.len() + corners.len()}],
    });
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let chunk =
        |kind: &[u8], data: &[u8]| [&(data.len() as u32).to_le_bytes(), kind, data].concat();
    let chunks = [
        chunk(b"JSON", &json),
        chunk(b"BIN\0", &[vertices, corners].concat()),
    ]
    .concat();
    let header = [
        &b"glTF"[..],
        &2_u32.to_le_bytes(),
        &(12 + chunks.len() as u32).to_le_bytes(),
    ];
    scene.write("mug.glb", [header.concat(), chunks].concat());
}

/// Runs the `sh` blocks of a page. Blocks marked `bash` need data or tools that may be missing.
fn run_page(name: &str) {
    let page = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../docs")
        .join(name);
    let Ok(page) = std::fs::read_to_string(&page) else {
        eprintln!("SKIPPED: the package has no {}", page.display());
        return;
    };
    let scene = Scene::new();
    let depth = render_depth_image(&car(), &camera(), &truth());
    hicp_io::write_ply(scene.path("mug.ply"), &car(), LengthUnit::Millimeters).unwrap();
    hicp_io::write_depth_png(scene.path("depth.png"), &depth, 1.0).unwrap();
    std::fs::copy(scene.path("init.json"), scene.path("pose.json")).unwrap();
    write_other_formats(&scene, &depth);
    write_clouds(&scene, &truth());
    let blocks = blocks(&page, "sh");
    assert!(!blocks.is_empty(), "{name}: no `sh` block");
    for block in blocks {
        run_script(scene.root(), block, name);
    }
}

#[test]
fn the_page_about_other_formats_runs() {
    run_page("from-what-you-have.md");
}

#[test]
fn the_first_refinement_runs() {
    run_page("book/first-refinement.md");
}

#[test]
fn the_chapter_about_custom_parts_runs() {
    run_page("book/build-your-own.md");
}

#[test]
fn the_chapter_about_datasets_runs() {
    run_page("book/datasets.md");
}

#[test]
fn the_chapter_about_sequences_runs() {
    run_page("book/sequences.md");
}

#[test]
fn the_page_about_the_command_line_runs() {
    run_page("cli.md");
}

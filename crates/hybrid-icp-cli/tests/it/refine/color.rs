//! Color images and colored meshes.

use hicp_io::LengthUnit;
use hybrid_icp::core::TriMesh;

use crate::common::*;

/// Returns the text of a PLY file, red at one end and green at the other.
fn colored(mesh: &TriMesh, units_per_meter: f32) -> String {
    let (vertices, faces) = (mesh.vertices().len(), mesh.triangles().len());
    let mut text = format!(
        "ply
format ascii 1.0
element vertex {vertices}
\
         property float x
property float y
property float z
\
         property uchar red
property uchar green
property uchar blue
\
         element face {faces}
property list uchar int vertex_index
end_header
"
    );
    for p in mesh.vertices() {
        let color = if p.x > 0.0 { "250 0 0" } else { "0 250 0" };
        let p = p * units_per_meter;
        text += &format!("{} {} {} {color}\n", p.x, p.y, p.z);
    }
    for [a, b, c] in mesh.triangles() {
        text += &format!("3 {a} {b} {c}\n");
    }
    text
}

fn write_gray(path: std::path::PathBuf, width: u32, height: u32) {
    let bytes = vec![90; 3 * width as usize * height as usize];
    hicp_io::write_rgb_png(path, width, height, &bytes).unwrap();
}

#[test]
fn a_color_image_is_used_with_a_colored_mesh_and_a_trace_repeats_it() {
    let scene = Scene::new()
        .with("--rgb", "rgb.png")
        .with("--model", "colored.ply")
        .with("--trace", "trace.jsonl");
    scene.write("colored.ply", colored(&car(), 1.0));
    let told = scene.command("inspect colored.ply").exits(0);
    told.prints(&[", vertex colors\n"]);
    write_gray(scene.path("rgb.png"), 320, 240);
    let result = scene.result();
    assert_improved(&pose_of(&result), &truth());
    assert_eq!(result["warnings"], serde_json::json!([]));
    let trace = scene.read("trace.jsonl");
    let header = trace.lines().next().unwrap();
    assert_contains(header, &[r#""rgb":"rgb.png""#]);
    scene.command("replay trace.jsonl").exits(0);
}

#[test]
fn a_warning_says_why_a_color_image_is_ignored() {
    let scene = Scene::new().with("--rgb", "rgb.png");
    write_gray(scene.path("rgb.png"), 320, 240);
    let parts = [
        "warning: mesh.ply has no colors",
        "--rgb rgb.png is ignored",
    ];
    scene.run().warns(&parts);
    let text = colored(&car(), 1.0).replacen("250 0 0", "250 none 0", 1);
    scene.write("colored.ply", text);
    let scene = scene.with("--model", "colored.ply");
    scene.run().warns(&["a color that is not a number"]);
}

#[test]
fn a_pipeline_that_ignores_colors_is_warned_of() {
    let scene = Scene::new()
        .with("--rgb", "rgb.png")
        .with("--model", "colored.ply");
    scene.write("colored.ply", colored(&car(), 1.0));
    write_gray(scene.path("rgb.png"), 320, 240);
    let scene = scene.with("--pipeline", "auto");
    scene
        .run()
        .warns(&["--rgb is not used", "auto", "expected --pipeline color"]);
    let scene = scene.with("--pipeline", "color");
    assert!(!scene.run().err.contains("not used"));
    let scene = scene
        .without("--pipeline")
        .with("--set", "max_rotation_degrees=30");
    scene.run().warns(&["colors are not used", "--set"]);
}

#[test]
fn a_color_image_of_another_size_is_refused() {
    let scene = Scene::new().with("--rgb", "rgb.png");
    write_gray(scene.path("rgb.png"), 640, 480);
    let parts = ["rgb.png is 640x480", "320x240", "--depth-camera"];
    scene.run().fails(&parts);
    scene.write("rgb.png", "not an image");
    scene.run().fails(&["rgb.png", "PNG, JPEG or TIFF"]);
}

#[test]
fn bop_refine_finds_the_color_images_and_takes_meshes_from_another_folder() {
    let world = World::new();
    let rows = world.rows();
    let (_, depth_only) = world.refine(&rows, "");
    world.create_dir("models_color");
    for id in [1, 2] {
        let path = world.path(format!("models/obj_{id:06}.ply"));
        let mesh = hicp_io::read_mesh(path, LengthUnit::Millimeters).unwrap();
        let name = format!("models_color/obj_{id:06}.ply");
        world.write(name, colored(&mesh, 1000.0));
    }
    let info = r#"{"1": {"diameter": 0.5}, "2": {"diameter": 100}}"#;
    world.write("models/models_info.json", info);
    let (warned, _) = world.refine(&rows, "--models models_color");
    warned.warns(&["models/models_info.json: object 1"]);
    world.remove("models/models_info.json");

    let rgb = world.scene(3).join("rgb");
    world.create_dir(&rgb);
    let (missing, _) = world.refine(&rows, "--models models_color");
    missing.warns(&[
        "without an image in rgb/",
        "frame",
        "refined by depth alone",
    ]);
    let set = "--models models_color --set max_rotation_degrees=30";
    let (unused, _) = world.refine(&rows, set);
    unused.warns(&["colors are not used", "--set"]);
    world.write(rgb.join("000040.png"), "damaged");
    let (damaged, _) = world.refine(&rows, "--models models_color");
    let parts = ["rgb/000040.png", "PNG, JPEG or TIFF", "by depth alone"];
    damaged
        .fails(&parts)
        .complains(&["1 file could not be used; 0 rows unchanged"]);
    let (_, refined) = world.refine(&rows, "--models models_color --no-color");
    for (color, depth) in refined.iter().zip(&depth_only) {
        let (a, b) = (color.camera_from_object(), depth.camera_from_object());
        assert!((a.translation.vector - b.translation.vector).norm() < 1e-4);
    }
    let path = world.path("models_color/obj_000001.ply");
    world.replace(path, "250 0 0", "250 none 0");
    let (warned, _) = world.refine(&rows, "--models models_color --no-color");
    assert!(!warned.exits(0).err.contains("a color"));
    std::fs::rename(world.path("models"), world.path("models_gray")).unwrap();
    std::fs::rename(world.path("models_color"), world.path("models")).unwrap();
    let (warned, _) = world.refine(&rows, "");
    warned.complains(&["obj_000001.ply", "a color that is not a number"]);
    std::fs::rename(world.path("models"), world.path("models_color")).unwrap();
    std::fs::rename(world.path("models_gray"), world.path("models")).unwrap();
    std::fs::remove_dir_all(&rgb).unwrap();
    let (warned, _) = world.refine(&rows, "--models models_color");
    warned.warns(&["obj_000001.ply", "a color that is not a number"]);
    let (warned, _) = world.refine(&rows, "--models models_color --pipeline color");
    warned.warns(&["without an image in rgb/"]);
    world
        .run("--models nothing")
        .fails(&["folder of models", "nothing"]);
}

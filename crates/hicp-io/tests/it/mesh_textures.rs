//! Textures of meshes.
//!
//! The mesh is the unit square. Its texture is red at the upper left, green at the upper right,
//! blue at the lower left, and white at the lower right.

use std::path::Path;

use hicp_core::{Point3, TriMesh, sample_colored_surface};
use hicp_io::bop::Dataset;
use hicp_io::{LengthUnit, MeshFile, ReadLimits, read_mesh, write_rgb_png};

use crate::common::{Folder, assert_contains, limits};

const RED: [u8; 3] = [250, 0, 0];
const GREEN: [u8; 3] = [0, 250, 0];
const BLUE: [u8; 3] = [0, 0, 250];
const WHITE: [u8; 3] = [250; 3];
const CORNERS: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

/// Creates a folder with the texture as `a b.png`.
fn folder() -> Folder {
    let folder = Folder::new();
    let rgb = [RED, GREEN, BLUE, WHITE].as_flattened().to_vec();
    write_rgb_png(folder.path("a b.png"), 2, 2, &rgb).unwrap();
    folder
}

fn read(path: &Path) -> MeshFile {
    let file = ReadLimits::DEFAULT.read_mesh_file(path, LengthUnit::Meters);
    let file = file.unwrap();
    let geometry = ReadLimits::DEFAULT.read_mesh_geometry(path, LengthUnit::Meters);
    let geometry = geometry.unwrap();
    assert_eq!(geometry.vertices(), file.mesh.vertices());
    assert!(geometry.color().is_none());
    file
}

/// Returns the color of the mesh at a place of the plane.
fn color_at(mesh: &TriMesh, x: f32, y: f32) -> [f32; 3] {
    let place = Point3::new(x, y, 0.0);
    let inside = (0..mesh.triangles().len()).find_map(|triangle| {
        let [a, b, c] = mesh.corners(triangle);
        let area =
            |a: &Point3<f32>, b: &Point3<f32>, c: &Point3<f32>| (b - a).xy().perp(&(c - a).xy());
        let whole = area(&a, &b, &c);
        let weights = [
            area(&place, &b, &c),
            area(&a, &place, &c),
            area(&a, &b, &place),
        ];
        let weights = weights.map(|part| part / whole);
        weights
            .iter()
            .all(|w| *w >= 0.0)
            .then_some((triangle, weights))
    });
    let (triangle, weights) = inside.unwrap();
    mesh.color_at(triangle, weights).unwrap()
}

#[track_caller]
fn assert_textured(file: &MeshFile) {
    assert!(file.color_fault.is_none(), "{:?}", file.color_fault);
    for (x, y, color) in [
        (0.25, 0.75, RED),
        (0.75, 0.75, GREEN),
        (0.25, 0.25, BLUE),
        (0.75, 0.25, WHITE),
    ] {
        let found = color_at(&file.mesh, x, y);
        let near = found
            .iter()
            .zip(color)
            .all(|(a, b)| (a - f32::from(b)).abs() < 1.0);
        assert!(near, "{x} {y}: {found:?}");
    }
}

const OBJ: &str = "mtllib some.mtl\nv 9 9 9\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n\
    vt 0.5 0.5\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl picture\n";

#[test]
fn obj_textures_cover_polygons_and_triangles() {
    let folder = folder();
    let mtl = "# two materials\nnewmtl picture\nKd 0 0 0\nmap_Kd -clamp on x.png\nmap_Kd a b.png\n\
        newmtl plain\nKd 1 0.2 0\n";
    folder.write("some.mtl", mtl);
    for faces in [
        "f 2/2 3/3 4/4 5/5\n",
        "f 2/2/1 3/3/1 4/4/1\nf -4/-4 -2/-2 -1/-1\n",
        "f 5/5 2/2 3/3 4/4\n",
    ] {
        let path = folder.write("a.obj", format!("{OBJ}{faces}"));
        assert_textured(&read(&path));
    }
    let two = format!("{OBJ}f 2/2 3/3 4/4\nusemtl plain\nf 2 4 5\n");
    let file = read(&folder.write("a.obj", two));
    assert_eq!(color_at(&file.mesh, 0.2, 0.9), [255.0, 51.0, 0.0]);
    // A path of another computer: the file has the same name here.
    let mtl = "newmtl picture\nmap_Kd C:\\textures\\a b.png\n";
    folder.write("some.mtl", mtl);
    assert_textured(&read(
        &folder.write("a.obj", format!("{OBJ}f 2/2 3/3 4/4 5/5\n")),
    ));
}

#[test]
fn obj_vertex_colors_follow_their_vertices() {
    let folder = folder();
    let text = "v 9 9 9 0 0 0\nv 0 1 0 0 0 1\nv 1 1 0 0 1 0\nv 0 0 0 1 0 0\nf 4 3 2\n";
    let file = read(&folder.write("a.obj", text));
    assert!(file.color_fault.is_none());
    for (x, y, color) in [(0.0, 0.0, 0), (1.0, 1.0, 1), (0.0, 1.0, 2)] {
        let mut expected = [0.0; 3];
        expected[color] = 255.0;
        assert_eq!(color_at(&file.mesh, x, y), expected);
    }
    let some = text.replace("9 9 9 0 0 0", "9 9 9");
    assert!(read(&folder.write("a.obj", some)).mesh.color().is_none());
}

#[test]
fn ply_textures_are_read_by_vertex_and_by_face() {
    let folder = folder();
    let head = |vertex: &str, face: &str| {
        format!(
            "ply\nformat ascii 1.0\ncomment TextureFile a b.png\nelement vertex 4\n\
             property float x\nproperty float y\nproperty float z\n{vertex}element face 1\n\
             {face}property list uchar int vertex_indices\nend_header\n"
        )
    };
    for names in ["texture_u texture_v", "s t", "u v"] {
        let names = names
            .split(' ')
            .map(|name| format!("property float {name}\n"));
        let mut text = head(&names.collect::<String>(), "");
        for [x, y] in CORNERS {
            text += &format!("{x} {y} 0 {x} {y}\n");
        }
        assert_textured(&read(&folder.write("a.ply", text + "4 0 1 2 3\n")));
    }
    let face = "property list uchar float texcoord\nproperty int texnumber\n";
    let mut text = head("", face);
    for [x, y] in CORNERS {
        text += &format!("{x} {y} 0\n");
    }
    let faces = "8 0 0 1 0 1 1 0 1 0 4 0 1 2 3\n";
    assert_textured(&read(&folder.write("a.ply", format!("{text}{faces}"))));
    for bad in ["8 0 0 1 0 1 1 0 1 1 4 0 1 2 3\n", "2 0 0 0 4 0 1 2 3\n"] {
        let file = read(&folder.write("a.ply", format!("{text}{bad}")));
        let fault = file.color_fault.unwrap().to_string();
        assert!(
            file.mesh.color().is_none() && fault.contains("texture"),
            "{fault}"
        );
    }
}

/// Returns the JSON text of a glTF file, with the texture at `image` and this base color.
fn gltf(image: &str, factor: &str, bytes: usize) -> String {
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "meshes": [{{"primitives": [{{"attributes":
        {{"POSITION": 0, "TEXCOORD_0": 1}}, "indices": 2, "material": 0}}]}}],
        "nodes": [{{"mesh": 0}}], "materials": [{{"pbrMetallicRoughness": {{
        "baseColorTexture": {{"index": 0}}, "baseColorFactor": {factor}}}}}],
        "textures": [{{"source": 0}}], "images": [{image}],
        "buffers": [{{"uri": "a.bin", "byteLength": {bytes}}}], "bufferViews": [
        {{"buffer": 0, "byteLength": 48}}, {{"buffer": 0, "byteOffset": 48, "byteLength": 32}},
        {{"buffer": 0, "byteOffset": 80, "byteLength": 6}},
        {{"buffer": 0, "byteOffset": 88, "byteLength": {}}}], "accessors": [
        {{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}},
        {{"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"}},
        {{"bufferView": 2, "componentType": 5121, "count": 6, "type": "SCALAR"}}]}}"#,
        bytes - 88
    )
}

#[test]
fn gltf_textures_come_from_files_and_buffers_and_have_a_factor() {
    let folder = folder();
    let picture = std::fs::read(folder.path("a b.png")).unwrap();
    let positions = CORNERS.iter().flat_map(|[x, y]| [*x, *y, 0.0]);
    // The origin of the texture is its upper left corner.
    let coordinates = CORNERS.iter().flat_map(|[x, y]| [*x, 1.0 - y]);
    let numbers = positions.chain(coordinates).flat_map(f32::to_le_bytes);
    let mut bin: Vec<u8> = numbers.collect();
    bin.extend([0, 1, 2, 0, 2, 3, 0, 0]);
    bin.extend(&picture);
    folder.write("a.bin", &bin);
    for image in [r#"{"uri": "a%20b.png"}"#, r#"{"bufferView": 3}"#] {
        let text = gltf(image, "[1, 1, 1, 1]", bin.len());
        assert_textured(&read(&folder.write("a.gltf", text)));
    }
    // Factors are linear: a fifth of the light is 48 % of the value.
    let text = gltf(r#"{"bufferView": 3}"#, "[0.2, 1, 0, 1]", bin.len());
    let file = read(&folder.write("a.gltf", text));
    let [red, green, blue] = color_at(&file.mesh, 0.75, 0.25);
    assert!(
        (red - 120.0).abs() < 3.0 && green == 250.0 && blue == 0.0,
        "{red}"
    );
    // A transform of the texture names other coordinates, and rotates them around the corner.
    let transform = r#"{"index": 0, "texCoord": 7, "extensions": {"KHR_texture_transform":
        {"texCoord": 0, "offset": [0, 1], "rotation": 1.5707963267948966}}}"#;
    let text = gltf(r#"{"bufferView": 3}"#, "[1, 1, 1, 1]", bin.len());
    let file = read(&folder.write("a.gltf", text.replace(r#"{"index": 0}"#, transform)));
    let places = [(0.25, 0.75), (0.75, 0.75), (0.25, 0.25), (0.75, 0.25)];
    for ((x, y), expected) in places.into_iter().zip([BLUE, RED, WHITE, GREEN]) {
        assert_eq!(color_at(&file.mesh, x, y), expected.map(f32::from));
    }
    // Without a texture, the base color is that of the vertices.
    let text = gltf("", "[0.2, 1, 0, 1]", bin.len());
    let text = text.replace(r#""baseColorTexture": {"index": 0},"#, "");
    let file = read(&folder.write("a.gltf", text));
    assert_eq!(color_at(&file.mesh, 0.5, 0.2), [124.0, 255.0, 0.0]);
    for image in [
        "",
        r#"{"bufferView": 2}"#,
        r#"{"uri": "no.png"}"#,
        r#"{"uri": "data:,"}"#,
    ] {
        let file = read(&folder.write("a.gltf", gltf(image, "[1, 1, 1, 1]", bin.len())));
        let fault = file.color_fault.unwrap();
        assert!(
            file.mesh.color().is_none() && !fault.found.is_empty(),
            "{fault}"
        );
    }
    let strange = gltf("", "\"red\"", bin.len());
    assert!(read(&folder.write("a.gltf", strange)).color_fault.is_some());
}

#[test]
fn unreadable_materials_and_textures_leave_the_mesh_without_color() {
    let folder = folder();
    let path = folder.write("a.obj", format!("{OBJ}f 2/2 3/3 4/4 5/5\n"));
    let fault = |parts: &[&str]| {
        let file = read(&path);
        assert!(file.mesh.color().is_none());
        let fault = file.color_fault.unwrap().to_string();
        assert_contains(&fault, parts);
    };
    fault(&["a.obj", "material file", "some.mtl"]);
    folder.write("some.mtl", "newmtl other\nKd 1 1 1\n");
    fault(&["the material \"picture\""]);
    folder.write("some.mtl", "newmtl picture\nmap_Kd no.png\n");
    fault(&["the texture \"no.png\""]);
    folder.write("no.png", "damaged");
    fault(&["the texture \"no.png\""]);
    let limits = limits(|limits| limits.max_pixels = 4);
    folder.write("some.mtl", "newmtl picture\nmap_Kd a b.png\n");
    let file = limits.read_mesh_file(&path, LengthUnit::Meters).unwrap();
    assert!(file.color_fault.unwrap().found.contains("5 pixels"));
}

#[test]
fn textures_and_vertex_colors_of_the_same_object_agree() {
    let Some(root) = crate::common::data("bop/ycbv") else {
        return;
    };
    let dataset = Dataset::open(root).unwrap();
    let open = |folder: &str| dataset.clone().with_models(folder).unwrap();
    let (colored, textured) = (open("models_color"), open("models_textured"));
    for obj_id in [1, 5, 9, 15] {
        let colored = colored.read_model(obj_id).unwrap();
        let path = textured.model_path(obj_id).unwrap();
        let textured = read_mesh(path, LengthUnit::Millimeters).unwrap();
        let places = sample_colored_surface(&textured, 500);
        let vertices = sample_colored_surface(&colored, 60_000);
        let mut differences = 0.0;
        for (surfel, color) in &places {
            let near = vertices.iter().min_by(|(a, _), (b, _)| {
                let distance = |other: &Point3<f32>| (other - surfel.point).norm_squared();
                distance(&a.point).total_cmp(&distance(&b.point))
            });
            let other = near.unwrap().1;
            let sum: f32 = (0..3)
                .map(|channel| (color[channel] - other[channel]).abs())
                .sum();
            differences += sum / 3.0;
        }
        let mean = differences / places.len() as f32;
        println!("object {obj_id}: {mean:.1} gray levels");
        assert!(mean < 15.0, "object {obj_id}: {mean}");
    }
}

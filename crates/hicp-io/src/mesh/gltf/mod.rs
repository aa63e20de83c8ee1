//! glTF 2.0 files: binary (`.glb`), or JSON (`.gltf`) with buffers next to it or inside of it.
//!
//! Coordinates stay as the format defines them, with y up. The crate `gltf` does not read quantized
//! positions, and takes longer to compile than the rest of this crate.

mod accessor;
mod buffers;
mod paint;
mod schema;

use std::collections::HashSet;

use hicp_core::{Isometry3, Matrix4, Point3, Quaternion, Translation3, UnitQuaternion};

use self::accessor::Accessors;
use self::paint::Paint;
use self::schema::{Node, Primitive, Root};
use super::colors::Colors;
use super::raw::{FACE, RawMesh, Reading};
use crate::error::{IoError, Place, quote};
use crate::json;
use crate::limits::Limit;
use crate::number::whole;

/// Parts of the names of extensions that leave shapes as they are, or that readers of parts handle.
const KNOWN_EXTENSIONS: [&str; 9] = [
    "_materials_",
    "_texture_",
    "_lights_",
    "_xmp",
    "_metadata",
    "VRM",
    "KHR_mesh_quantization",
    "draco",
    "meshopt",
];

/// Parses the triangles of the default scene, with the transforms of its nodes.
pub(super) fn parse(reading: Reading<'_>, content: Vec<u8>) -> Result<RawMesh<'_>, IoError> {
    let (text, binary) = buffers::split(&reading, &content)?;
    let root: Root = json::parse(reading.path, text)?;
    let is_known = |name: &String| KNOWN_EXTENSIONS.iter().any(|part| name.contains(part));
    if let Some(name) = root.extensions_required.iter().find(|name| !is_known(name)) {
        let place = Place::Field("$.extensionsRequired".to_owned());
        let expected = "a file without it: Blender's export writes one";
        return Err(reading.refuse(place, quote(name), expected));
    }
    let buffers = buffers::load(&reading, &root, binary)?;
    let mut mesh_colors = Colors::default();
    let paint = match reading.with_color {
        true => Paint::parse(&reading, text).unwrap_or_else(|error| {
            mesh_colors.refuse(error);
            None
        }),
        false => None,
    };
    let place = Place::Field("$.meshes".to_owned());
    let found = format!("{} meshes", root.meshes.len());
    let mut scene = Scene {
        accessors: Accessors {
            reading,
            root: &root,
            buffers: &buffers,
        },
        visited: HashSet::new(),
        paint,
        mesh: RawMesh::new(reading, reading.refuse(place, found, FACE)),
    };
    scene.mesh.colors = mesh_colors;
    let tops: Vec<usize> = match root.scenes.get(root.scene.unwrap_or(0)) {
        Some(scene) => scene.nodes.clone(),
        None => {
            let children = root.nodes.iter().flat_map(|node| &node.children);
            let children: HashSet<&usize> = children.collect();
            let nodes = 0..root.nodes.len();
            nodes.filter(|node| !children.contains(node)).collect()
        }
    };
    // The stack holds the first node on top, so that vertices are in the order of the file.
    let tops = tops.iter().rev().map(|node| (*node, Matrix4::identity()));
    let mut open: Vec<(usize, Matrix4<f64>)> = tops.collect();
    while let Some((index, parent)) = open.pop() {
        let node = scene.visit(index)?;
        let world = parent * local(node);
        if let Some(mesh) = node.mesh {
            scene.add_mesh(mesh, node, &world)?;
        }
        open.extend(node.children.iter().rev().map(|child| (*child, world)));
    }
    Ok(scene.mesh)
}

/// Returns the transform of a node relative to its parent.
fn local(node: &Node) -> Matrix4<f64> {
    if let Some(matrix) = &node.matrix {
        return Matrix4::from_column_slice(&matrix.0);
    }
    let [x, y, z] = node.translation.map_or([0.0; 3], |t| t.0);
    let [i, j, k, w] = node.rotation.map_or([0.0, 0.0, 0.0, 1.0], |r| r.0);
    let [sx, sy, sz] = node.scale.map_or([1.0; 3], |s| s.0);
    let turned = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
    let moved = Isometry3::from_parts(Translation3::new(x, y, z), turned);
    moved
        .to_homogeneous()
        .prepend_nonuniform_scaling(&[sx, sy, sz].into())
}

struct Scene<'a, 'r> {
    accessors: Accessors<'a, 'r>,
    visited: HashSet<usize>,
    /// The colors of the file, if there are any.
    paint: Option<Paint>,
    mesh: RawMesh<'r>,
}

impl<'a> Scene<'a, '_> {
    /// Returns a node. Refuses a node with two parents, which could multiply without end.
    fn visit(&mut self, index: usize) -> Result<&'a Node, IoError> {
        let place = Place::Field(format!("$.nodes[{index}]"));
        let (reading, nodes) = (self.mesh.reading, &self.accessors.root.nodes);
        let Some(node) = nodes.get(index) else {
            let expected = format!("one of {} nodes", nodes.len());
            return Err(reading.refuse(place, "a node that does not exist", expected));
        };
        match self.visited.insert(index) {
            true => Ok(node),
            false => Err(reading.refuse(place, "a node with two parents", "a tree of nodes")),
        }
    }

    fn add_mesh(&mut self, index: usize, node: &Node, world: &Matrix4<f64>) -> Result<(), IoError> {
        let root = self.accessors.root;
        let Some(mesh) = root.meshes.get(index) else {
            let place = Place::Field(format!("$.meshes[{index}]"));
            let (reading, expected) = (
                self.mesh.reading,
                format!("one of {} meshes", root.meshes.len()),
            );
            return Err(reading.refuse(place, "a mesh that does not exist", expected));
        };
        let mut weights = node.weights.iter().chain(&mesh.weights).take(1).flatten();
        if node.skin.is_some() || weights.any(|weight| *weight != 0.0) {
            let place = Place::Field(format!("$.meshes[{index}]"));
            let found = "a mesh that a skin or morph targets deform";
            let expected = "a rigid mesh: apply the armature and the shape keys before the export";
            return Err(self.mesh.reading.refuse(place, found, expected));
        }
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            let place = Place::Field(format!("$.meshes[{index}].primitives[{number}]"));
            self.add_primitive(primitive, (index, number), &place, world)?;
        }
        Ok(())
    }

    fn add_primitive(
        &mut self,
        primitive: &Primitive,
        numbers: (usize, usize),
        place: &Place,
        world: &Matrix4<f64>,
    ) -> Result<(), IoError> {
        let reading = self.mesh.reading;
        let mut extensions = primitive.extensions.keys();
        if let Some(name) = extensions.find(|name| name.contains("draco")) {
            let found = format!("Draco compression ({name})");
            let expected = "a file without Draco compression: gltf-transform copy, or Blender's \
                            export without compression, writes one";
            return Err(reading.refuse(place.clone(), found, expected));
        }
        // Points and lines have no area.
        let mode = primitive.mode.unwrap_or(4);
        let (Some(positions), 4..=6) = (primitive.attributes.get("POSITION"), mode) else {
            return Ok(());
        };
        let first = self.mesh.vertices.len();
        let positions = self.accessors.read(*positions, 3, Limit::VERTICES)?;
        for position in positions.chunks_exact(3) {
            let point = Point3::new(position[0], position[1], position[2]).to_homogeneous();
            let point = world * point;
            self.mesh
                .add_vertex(place.clone(), [point.x, point.y, point.z])?;
        }
        let count = self.mesh.vertices.len() - first;
        let accessors = self.accessors;
        let paint = self.paint.as_mut();
        let texture = paint
            .and_then(|paint| paint.primitive(&accessors, numbers, count, &mut self.mesh.colors));
        let corners = match primitive.indices {
            Some(indices) => self.accessors.read(indices, 1, Limit::TRIANGLES)?,
            None => (0..count).map(|index| index as f64).collect(),
        };
        let is_beyond = |index: &&f64| !(0.0..count as f64).contains(*index);
        if let Some(index) = corners.iter().find(is_beyond) {
            let found = format!("vertex {index} of a face");
            return Err(reading.refuse(place.clone(), found, format!("below {count}")));
        }
        let faces = match mode {
            4 => corners.len() / 3,
            _ => corners.len().saturating_sub(2),
        };
        // A mirrored part would be inside out.
        let mirrored = world.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
        for face in 0..faces {
            let [a, b, c] = match mode {
                4 => [3 * face, 3 * face + 1, 3 * face + 2],
                5 if face % 2 == 1 => [face + 1, face, face + 2],
                5 => [face, face + 1, face + 2],
                _ => [0, face + 1, face + 2],
            };
            let order = if mirrored { [a, c, b] } else { [a, b, c] };
            let vertices = order.map(|corner| corners[corner] + first as f64);
            self.mesh.add_corners(place.clone(), face, &vertices)?;
            if let Some((image, coordinates)) = &texture {
                let coordinates = order.map(|corner| coordinates[whole(corners[corner]) as usize]);
                self.mesh.texture_face(*image, &coordinates);
            }
        }
        Ok(())
    }
}

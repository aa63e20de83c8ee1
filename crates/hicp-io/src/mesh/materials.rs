//! The colors of OBJ files: materials, texture coordinates, and vertex colors.

use std::collections::HashMap;

use hicp_core::ColorImage;

use super::colors::Colors;
use super::lines::{Lines, numbers, without_comment};
use super::raw::{RawMesh, Reading};
use super::texture;
use crate::error::{IoError, quote};
use crate::number::byte;
use crate::source::{is_absent, lossy_text};

/// The index of a corner without texture coordinates, and of a face without a material.
const NONE: u32 = u32::MAX;
/// The most records `mtllib` that count, so that a file cannot name another one without end.
const MAX_LIBRARIES: usize = 100;
/// The color of a face without a material, as common viewers show it.
const PLAIN: [u8; 3] = [204; 3];

/// The records of an OBJ file that colors need.
#[derive(Debug, Default)]
pub(super) struct Materials {
    /// The colors of the vertices; fewer if some vertices have none.
    vertices: Vec<[f64; 3]>,
    coordinates: Vec<[f32; 2]>,
    /// The vertex and the texture coordinates of each corner of the faces.
    corners: Vec<[u32; 2]>,
    /// The material of each face.
    faces: Vec<u32>,
    /// The indices of materials by name, and the current one.
    names: HashMap<String, u32>,
    current: Option<u32>,
    /// The names of material files.
    libraries: Vec<String>,
}

impl Materials {
    /// Stores the color of a vertex, which follows its position.
    pub(super) fn add_vertex<'a>(&mut self, words: impl Iterator<Item = &'a str>) {
        let mut numbers = words.map_while(|word| word.parse().ok());
        if let [Some(red), Some(green), Some(blue)] = [(); 3].map(|()| numbers.next()) {
            self.vertices.push([red, green, blue]);
        }
    }

    /// Stores the corners of a face after `vertices` vertices: `vertex/coordinates/normal`.
    pub(super) fn add_face<'a>(&mut self, words: impl Iterator<Item = &'a str>, vertices: usize) {
        // Indices count from 1, or back from the last record.
        let index = |word: Option<&str>, count: usize| {
            let index = match word.and_then(|word| word.parse::<i64>().ok()) {
                Some(index) if index < 0 => index.saturating_add_unsigned(count as u64),
                Some(index) => index - 1,
                None => -1,
            };
            u32::try_from(index).unwrap_or(NONE)
        };
        for word in words {
            let mut parts = word.split('/');
            let vertex = index(parts.next(), vertices);
            let coordinates = index(parts.next(), self.coordinates.len());
            self.corners.push([vertex, coordinates]);
        }
        self.faces.push(self.current.unwrap_or(NONE));
    }

    /// Stores another record.
    pub(super) fn add(&mut self, kind: &str, line: &str) {
        let rest = line.trim_start().strip_prefix(kind).unwrap_or_default();
        let rest = rest.trim();
        match kind {
            "vt" => {
                let mut numbers = numbers::<f32>(rest);
                let s = numbers.next().unwrap_or(0.0);
                // The origin is the lower left corner.
                let t = 1.0 - numbers.next().unwrap_or(0.0);
                self.coordinates.push([s, t]);
            }
            "mtllib" if self.libraries.len() < MAX_LIBRARIES => {
                self.libraries.push(rest.to_owned());
            }
            "usemtl" => {
                let next = u32::try_from(self.names.len()).unwrap_or(NONE);
                self.current = Some(*self.names.entry(rest.to_owned()).or_insert(next));
            }
            _ => {}
        }
    }

    /// Loads the materials that faces use. `vertices` is the number of vertices of the file.
    pub(super) fn load(
        &self,
        reading: &Reading<'_>,
        vertices: usize,
        colors: &mut Colors,
    ) -> Coverage<'_> {
        let colored = vertices > 0 && self.vertices.len() == vertices;
        let mut coverage = Coverage {
            materials: self,
            corner: 0,
            face: 0,
            images: Vec::new(),
            plain: 0,
            vertices: colored.then(Vec::new),
        };
        if self.names.is_empty() {
            return coverage;
        }
        let mut known = HashMap::new();
        for name in &self.libraries {
            if let Err(error) = read_library(reading, name, &mut known) {
                colors.refuse(error);
            }
        }
        let (limits, path) = (reading.limits, reading.path);
        let one = |color| ColorImage::new(1, 1, vec![color]);
        let one = |color| one(color).map_err(|e| IoError::unusable(path, "color", e));
        coverage.plain = colors.add_image(limits, path, || one(PLAIN));
        coverage.images = vec![coverage.plain; self.names.len()];
        let mut of_maps = HashMap::new();
        let mut used = vec![false; self.names.len()];
        for material in &self.faces {
            used.get_mut(*material as usize)
                .into_iter()
                .for_each(|used| *used = true);
        }
        let mut names: Vec<_> = self.names.iter().collect();
        names.sort_unstable_by_key(|(_, index)| **index);
        for ((name, index), used) in names.into_iter().zip(used) {
            let image = match known.get(name) {
                Some(Material { map: Some(map), .. }) => *of_maps.entry(map).or_insert_with(|| {
                    colors.add_image(limits, path, || texture::read(reading, map))
                }),
                Some(material) => colors.add_image(limits, path, || one(material.color)),
                None if used => {
                    let found = format!("the material {}", quote(name));
                    let expected = "one of the material files that `mtllib` names";
                    colors.refuse(IoError::new(path, None, found, expected));
                    continue;
                }
                None => continue,
            };
            coverage.images[*index as usize] = image;
        }
        coverage
    }
}

/// The colors of the faces of a mesh, which are added in the order of the file.
pub(super) struct Coverage<'a> {
    materials: &'a Materials,
    /// The next corner and the next face.
    corner: usize,
    face: usize,
    /// The image of each material; empty if there are no materials.
    images: Vec<u32>,
    /// The image of faces without a material.
    plain: u32,
    /// The colors of the vertices of the mesh, if the file has them.
    vertices: Option<Vec<[f64; 3]>>,
}

impl Coverage<'_> {
    /// Colors the last face of the mesh, which has these corners.
    pub(super) fn cover(&mut self, corners: &[u32], mesh: &mut RawMesh<'_>) {
        let all = &self.materials.corners;
        let Some(stored) = all.get(self.corner..self.corner + corners.len()) else {
            return;
        };
        if let Some(colors) = &mut self.vertices {
            // The vertices of the mesh are those that faces use, in another order.
            colors.resize(mesh.vertices.len(), [0.0; 3]);
            for (corner, [vertex, _]) in corners.iter().zip(stored) {
                if let Some(color) = self.materials.vertices.get(*vertex as usize) {
                    colors[*corner as usize] = *color;
                }
            }
        }
        if !self.images.is_empty() {
            let material = self.materials.faces[self.face] as usize;
            let image = self.images.get(material).copied().unwrap_or(self.plain);
            let coordinates = |[_, index]: &[u32; 2]| {
                let found = self.materials.coordinates.get(*index as usize);
                found.copied().unwrap_or_default()
            };
            let coordinates: Vec<[f32; 2]> = stored.iter().map(coordinates).collect();
            mesh.texture_face(image, &coordinates);
        }
        self.corner += corners.len();
        self.face += 1;
    }

    /// Adds the colors of the vertices.
    pub(super) fn finish(self, colors: &mut Colors) {
        for color in self.vertices.into_iter().flatten() {
            colors.add(color, false);
        }
    }
}

/// A material of an MTL file.
#[derive(Clone, Debug)]
struct Material {
    color: [u8; 3],
    /// The name of the texture.
    map: Option<String>,
}

/// Reads the materials of an MTL file, of which only the diffuse color counts.
fn read_library(
    reading: &Reading<'_>,
    name: &str,
    known: &mut HashMap<String, Material>,
) -> Result<(), IoError> {
    // A name may have spaces, and a record several names.
    let whole = texture::find(reading, name);
    let paths = match is_absent(&whole) {
        true => name
            .split_whitespace()
            .map(|name| texture::find(reading, name))
            .collect(),
        false => vec![whole],
    };
    for path in paths {
        let content = reading.limits.read_bytes(&path).map_err(|error| {
            let found = format!("the material file {}, which cannot be read", quote(name));
            let expected = "a file next to this one";
            IoError::new(reading.path, None, found, expected).with_source(error)
        })?;
        let text = lossy_text(&path, &content)?;
        let mut current = None;
        for line in Lines::new(&text).map(without_comment) {
            let (kind, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
            let rest = rest.trim();
            if kind == "newmtl" {
                let (color, map) = ([255; 3], None);
                known.insert(rest.to_owned(), Material { color, map });
                current = Some(rest.to_owned());
            }
            let Some(material) = current.as_ref().and_then(|name| known.get_mut(name)) else {
                continue;
            };
            match kind {
                "Kd" => {
                    for (channel, number) in material.color.iter_mut().zip(numbers::<f64>(rest)) {
                        *channel = byte(number * 255.0);
                    }
                }
                // Options precede the name.
                "map_Kd" if rest.starts_with('-') => {
                    material.map = rest.split_whitespace().last().map(str::to_owned);
                }
                "map_Kd" => material.map = Some(rest.to_owned()),
                _ => {}
            }
        }
    }
    Ok(())
}

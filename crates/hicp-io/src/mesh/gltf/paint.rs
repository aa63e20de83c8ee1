//! The colors of glTF files: base colors of materials, their textures, and vertex colors.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use hicp_core::ColorImage;
use serde::Deserialize;

use super::accessor::Accessors;
use super::buffers;
use crate::error::{IoError, Place, quote};
use crate::image::color;
use crate::json::{self, Numbers};
use crate::limits::Limit;
use crate::mesh::colors::Colors;
use crate::mesh::raw::Reading;
use crate::mesh::texture;
use crate::number::{byte, narrow};

/// The parts of a file that colors need. They are parsed separately, so that a fault in them leaves
/// the geometry readable.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct Root {
    meshes: Vec<Mesh>,
    materials: Vec<Material>,
    textures: Vec<Texture>,
    images: Vec<Image>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Mesh {
    primitives: Vec<Primitive>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Primitive {
    attributes: BTreeMap<String, usize>,
    material: Option<usize>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct Material {
    pbr_metallic_roughness: BaseColor,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct BaseColor {
    base_color_factor: Option<Numbers<4>>,
    base_color_texture: Option<TextureUse>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct TextureUse {
    index: usize,
    tex_coord: usize,
    extensions: UseExtensions,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
struct UseExtensions {
    #[serde(rename = "KHR_texture_transform")]
    transform: Transform,
}

/// A transform of texture coordinates: scaled, rotated, and moved by the offset.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct Transform {
    offset: Option<Numbers<2>>,
    rotation: f64,
    scale: Option<Numbers<2>>,
    /// Replaces [`TextureUse::tex_coord`].
    tex_coord: Option<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Texture {
    source: Option<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct Image {
    uri: Option<String>,
    buffer_view: Option<usize>,
}

impl Primitive {
    fn texture<'a>(&self, materials: &'a [Material]) -> Option<&'a TextureUse> {
        let material = materials.get(self.material?)?;
        material.pbr_metallic_roughness.base_color_texture.as_ref()
    }
}

/// The colors of a file.
///
/// Without textures, each vertex has a color. Otherwise, each material has a texture, which may be
/// a single pixel.
#[derive(Debug)]
pub(super) struct Paint {
    root: Root,
    textured: bool,
    /// The textures of materials. `None` is the material of primitives without one.
    images: BTreeMap<Option<usize>, u32>,
}

impl Paint {
    /// Parses the JSON text of a file. Returns `None` if it states no colors.
    pub(super) fn parse(reading: &Reading<'_>, text: &[u8]) -> Result<Option<Self>, IoError> {
        let root: Root = json::parse(reading.path, text)?;
        let mut primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
        let is_textured = |part: &Primitive| part.texture(&root.materials).is_some();
        let is_colored =
            |part: &Primitive| part.material.is_some() || part.attributes.contains_key("COLOR_0");
        let (textured, colored) = (
            primitives.clone().any(is_textured),
            primitives.any(is_colored),
        );
        let images = BTreeMap::new();
        Ok(colored.then_some(Self {
            root,
            textured,
            images,
        }))
    }

    /// Adds the colors of a primitive with `count` vertices, given by its mesh and its number.
    ///
    /// Returns its texture and the texture coordinates of its vertices, if the file has textures.
    pub(super) fn primitive(
        &mut self,
        accessors: &Accessors<'_, '_>,
        numbers: (usize, usize),
        count: usize,
        colors: &mut Colors,
    ) -> Option<(u32, Vec<[f32; 2]>)> {
        let primitive = self.root.meshes.get(numbers.0)?.primitives.get(numbers.1)?;
        if !self.textured {
            let vertices = self.vertex_colors(accessors, primitive, count);
            let vertices = vertices.map_err(|error| colors.refuse(error)).ok()?;
            vertices
                .into_iter()
                .for_each(|color| colors.add(color, true));
            return None;
        }
        let coordinates = self.coordinates(accessors, primitive, count);
        let coordinates = coordinates.map_err(|error| colors.refuse(error)).ok()?;
        let reading = &accessors.reading;
        let image = match self.images.entry(primitive.material) {
            Entry::Occupied(known) => *known.get(),
            Entry::Vacant(new) => {
                *new.insert(colors.add_image(reading.limits, reading.path, || {
                    self.root.image(accessors, primitive)
                }))
            }
        };
        Some((image, coordinates))
    }

    /// Returns the color of each vertex, 0 to 255.
    fn vertex_colors(
        &self,
        accessors: &Accessors<'_, '_>,
        primitive: &Primitive,
        count: usize,
    ) -> Result<Vec<[f64; 3]>, IoError> {
        let factor = self.root.factor(primitive);
        let channel = |linear: f64| 255.0 * encode(linear.clamp(0.0, 1.0));
        let Some(index) = primitive.attributes.get("COLOR_0") else {
            return Ok(vec![factor.map(channel); count]);
        };
        let accessor = accessors.root.accessors.get(*index);
        let has_alpha = accessor.is_some_and(|found| found.shape == "VEC4");
        let components = if has_alpha { 4 } else { 3 };
        let numbers = accessors.read(*index, components, Limit::VERTICES)?;
        let numbers = numbers.chunks_exact(components);
        let color = |c: &[f64]| [0, 1, 2].map(|i| channel(c[i] * factor[i]));
        Ok(numbers.map(color).collect())
    }

    /// Returns the texture coordinates of each vertex; zeros if its material has no texture.
    fn coordinates(
        &self,
        accessors: &Accessors<'_, '_>,
        primitive: &Primitive,
        count: usize,
    ) -> Result<Vec<[f32; 2]>, IoError> {
        let Some(texture) = primitive.texture(&self.root.materials) else {
            return Ok(vec![[0.0; 2]; count]);
        };
        let refuse = |found: String, expected: String| {
            let place = Place::Field("$.meshes".to_owned());
            Err(accessors.reading.refuse(place, found, expected))
        };
        let transform = &texture.extensions.transform;
        let set = transform.tex_coord.unwrap_or(texture.tex_coord);
        let name = format!("TEXCOORD_{set}");
        let Some(index) = primitive.attributes.get(&name) else {
            return refuse(format!("a texture without {name}"), "both".to_owned());
        };
        let numbers = accessors.read(*index, 2, Limit::VERTICES)?;
        if numbers.len() != 2 * count {
            let found = format!("{} texture coordinates", numbers.len() / 2);
            return refuse(found, format!("{count}, one for each vertex"));
        }
        let Numbers([x, y]) = transform.offset.unwrap_or(Numbers([0.0; 2]));
        let Numbers([sx, sy]) = transform.scale.unwrap_or(Numbers([1.0; 2]));
        let (sin, cos) = transform.rotation.sin_cos();
        let pairs = numbers
            .chunks_exact(2)
            .map(|pair| (sx * pair[0], sy * pair[1]));
        let moved = pairs.map(|(s, t)| [x + cos * s + sin * t, y - sin * s + cos * t]);
        Ok(moved.map(|pair| pair.map(narrow)).collect())
    }
}

impl Root {
    /// Returns the base color of a primitive, linear.
    fn factor(&self, primitive: &Primitive) -> [f64; 3] {
        let material = primitive
            .material
            .and_then(|index| self.materials.get(index));
        let factor = material.and_then(|found| found.pbr_metallic_roughness.base_color_factor);
        factor.map_or([1.0; 3], |Numbers([red, green, blue, _])| {
            [red, green, blue]
        })
    }

    /// Returns the texture of a primitive, or a pixel of its base color.
    fn image(
        &self,
        accessors: &Accessors<'_, '_>,
        primitive: &Primitive,
    ) -> Result<ColorImage, IoError> {
        let reading = &accessors.reading;
        let unusable = |error| IoError::unusable(reading.path, "texture", error);
        let factor = self.factor(primitive);
        let white = || ColorImage::new(1, 1, vec![[255; 3]]).map_err(unusable);
        let texture = primitive.texture(&self.materials);
        let image = texture.map_or_else(white, |texture| self.texture(accessors, texture))?;
        if factor == [1.0; 3] {
            return Ok(image);
        }
        let table = |factor: f64| -> Vec<u8> {
            let scaled = |byte| encode((factor * decode(f64::from(byte) / 255.0)).clamp(0.0, 1.0));
            (0..=255_u8)
                .map(|value| byte(255.0 * scaled(value)))
                .collect()
        };
        let tables = factor.map(table);
        let scale = |color: &[u8; 3]| [0, 1, 2].map(|c| tables[c][usize::from(color[c])]);
        let pixels = image.pixels().iter().map(scale).collect();
        ColorImage::new(image.width(), image.height(), pixels).map_err(unusable)
    }

    /// Decodes a texture.
    fn texture(
        &self,
        accessors: &Accessors<'_, '_>,
        texture: &TextureUse,
    ) -> Result<ColorImage, IoError> {
        let reading = &accessors.reading;
        let place = || Place::Field(format!("$.textures[{}]", texture.index));
        let source = self.textures.get(texture.index).map(|found| found.source);
        let image = source.flatten().and_then(|source| self.images.get(source));
        let data = match image {
            Some(Image { uri: Some(uri), .. }) => match uri.strip_prefix("data:") {
                Some(data) => buffers::decode(data).map(Cow::Owned),
                None => return texture::read(reading, &uri.replace("%20", " ")),
            },
            Some(Image { buffer_view, .. }) => {
                let view = buffer_view.and_then(|view| accessors.view(view));
                view.map(Cow::Borrowed)
            }
            None => None,
        };
        let Some(data) = data else {
            let found = "a texture without an image that can be read";
            return Err(reading.refuse(place(), found, "a PNG or JPEG image"));
        };
        color::decode(reading.limits, reading.path, &data).map_err(|error| {
            let found = format!("an image that cannot be read: {}", quote(&error.found));
            reading
                .refuse(place(), found, "a PNG or JPEG image")
                .with_source(error)
        })
    }
}

/// Converts a linear value from 0 to 1 to sRGB.
fn encode(linear: f64) -> f64 {
    match linear {
        ..=0.003_130_8 => 12.92 * linear,
        _ => 1.055 * linear.powf(1.0 / 2.4) - 0.055,
    }
}

/// Converts an sRGB value from 0 to 1 to a linear one.
fn decode(encoded: f64) -> f64 {
    match encoded {
        ..=0.040_45 => encoded / 12.92,
        _ => ((encoded + 0.055) / 1.055).powf(2.4),
    }
}

//! The colors of a mesh during parsing.

use std::path::Path;

use hicp_core::{ColorImage, SurfaceColor, TexturedTriangle};

use crate::error::IoError;
use crate::limits::{Limit, ReadLimits};
use crate::number::{byte, narrow};

/// The colors of a mesh as its file states them: textures, or else those of the vertices.
#[derive(Debug, Default)]
pub(crate) struct Colors {
    /// The numbers of each vertex.
    vertices: Vec<[f32; 3]>,
    /// `true` if the numbers are bytes. Otherwise, the largest one shows their scale.
    bytes: bool,
    largest: f32,
    images: Vec<ColorImage>,
    /// The number of pixels of all images.
    pixels: u64,
    triangles: Vec<TexturedTriangle>,
    /// The first reason why colors of the file cannot be used.
    fault: Option<IoError>,
}

impl Colors {
    /// Adds the color of the next vertex.
    pub(super) fn add(&mut self, color: [f64; 3], bytes: bool) {
        let color = color.map(narrow);
        self.bytes = bytes;
        self.largest = color.into_iter().fold(self.largest, f32::max);
        self.vertices.push(color);
    }

    /// Adds a texture that `read` returns, and returns its index. Reads nothing after a fault.
    ///
    /// All textures together may have as many pixels as an image.
    pub(super) fn add_image(
        &mut self,
        limits: &ReadLimits,
        path: &Path,
        read: impl FnOnce() -> Result<ColorImage, IoError>,
    ) -> u32 {
        let index = u32::try_from(self.images.len()).unwrap_or(u32::MAX);
        if self.fault.is_some() {
            return index;
        }
        let image = read().and_then(|image| {
            self.pixels += image.pixels().len() as u64;
            let within = limits.check(Limit::PIXELS, path, None, self.pixels);
            within.map(|()| image)
        });
        match image {
            Ok(image) => self.images.push(image),
            Err(error) => self.refuse(error),
        }
        index
    }

    /// Covers the next triangle with a part of an image.
    pub(super) fn cover(&mut self, image: u32, corners: [[f32; 2]; 3]) {
        self.triangles.push(TexturedTriangle { image, corners });
    }

    /// Sets the reason why colors cannot be used, unless there is one.
    pub(super) fn refuse(&mut self, fault: IoError) {
        self.fault.get_or_insert(fault);
    }

    /// Returns the color of a mesh, and the reason if colors of its file cannot be used.
    pub(super) fn finish(
        mut self,
        path: &Path,
        vertices: usize,
        triangles: usize,
    ) -> (Option<SurfaceColor>, Option<IoError>) {
        let images = self.images.len();
        let exists = |triangle: &TexturedTriangle| (triangle.image as usize) < images;
        if images > 0
            && self.triangles.len() == triangles
            && self.fault.is_none()
            && self.triangles.iter().all(exists)
        {
            let color = SurfaceColor::Textures {
                images: self.images,
                triangles: self.triangles,
            };
            return (Some(color), None);
        }
        if !self.triangles.is_empty() || images > 0 {
            let found = "triangles without a texture or texture coordinates";
            self.refuse(IoError::new(path, None, found, "both for each triangle"));
        }
        if self.vertices.is_empty() {
            return (None, self.fault);
        }
        let is_number = |color: &[f32; 3]| color.iter().all(|number| number.is_finite());
        let found = match self.vertices.iter().position(|color| !is_number(color)) {
            Some(vertex) => format!("vertex {vertex} with a color that is not a number"),
            None if self.vertices.len() == vertices => {
                return (Some(self.vertex_colors()), self.fault);
            }
            None => format!("{} colors of {vertices} vertices", self.vertices.len()),
        };
        self.refuse(IoError::new(path, None, found, "a color for each vertex"));
        (None, self.fault)
    }

    fn vertex_colors(&self) -> SurfaceColor {
        let scale = match self.largest {
            _ if self.bytes => 1.0,
            ..=1.0 => 255.0,
            ..=255.0 => 1.0,
            _ => 255.0 / 65535.0,
        };
        let channel = |number: f32| byte(f64::from(number * scale));
        let colors = self.vertices.iter().map(|color| color.map(channel));
        SurfaceColor::Vertices(colors.collect())
    }
}

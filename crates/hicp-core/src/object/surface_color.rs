//! The color of a mesh's surface.

use crate::sensor::image::ColorImage;

/// The color of a mesh's surface: red, green and blue from 0 to 255, as files encode them.
#[derive(Clone, Debug, PartialEq)]
pub enum SurfaceColor {
    /// One color per vertex, interpolated over the triangles.
    Vertices(Vec<[u8; 3]>),
    /// Images that cover the triangles.
    Textures {
        /// The images. A material of one color is an image of one pixel.
        images: Vec<ColorImage>,
        /// The part of an image that covers each triangle, in the order of the triangles.
        triangles: Vec<TexturedTriangle>,
    },
}

/// The part of a texture that covers a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexturedTriangle {
    /// Index of the image.
    pub image: u32,
    /// The corners of the triangle in the image: (0, 0) is the upper left corner of the upper left
    /// pixel, (1, 1) the lower right corner of the lower right one. Beyond them, the image repeats.
    pub corners: [[f32; 2]; 3],
}

impl SurfaceColor {
    /// Returns the color at a place of a triangle with these vertices.
    ///
    /// `weights` are the barycentric coordinates of the place.
    pub(crate) fn at(&self, triangle: usize, vertices: [u32; 3], weights: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Vertices(colors) => {
                let corners = vertices.map(|index| colors[index as usize].map(f32::from));
                blend(&corners, &weights)
            }
            Self::Textures { images, triangles } => {
                let textured = &triangles[triangle];
                let [s, t] = blend(&textured.corners, &weights);
                sample(&images[textured.image as usize], s, t)
            }
        }
    }
}

/// Returns the weighted sum of some vectors.
fn blend<const N: usize, const D: usize>(vectors: &[[f32; D]; N], weights: &[f32; N]) -> [f32; D] {
    let mut sum = [0.0; D];
    for (vector, weight) in vectors.iter().zip(weights) {
        for (sum, value) in sum.iter_mut().zip(vector) {
            *sum += weight * value;
        }
    }
    sum
}

/// Returns the bilinear interpolation of an image that repeats.
fn sample(image: &ColorImage, s: f32, t: f32) -> [f32; 3] {
    let (width, height) = (image.width(), image.height());
    let (left, x) = cell(s, width);
    let (top, y) = cell(t, height);
    let (right, bottom) = ((left + 1) % width, (top + 1) % height);
    let corners = [(left, top), (right, top), (left, bottom), (right, bottom)];
    let pixel = |(u, v): (u32, u32)| image.pixels()[(v * width + u) as usize].map(f32::from);
    let weights = [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y];
    blend(&corners.map(pixel), &weights)
}

/// Returns the pixel before a place along one axis, and the fraction beyond its center.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // Checked to be in range.
fn cell(place: f32, size: u32) -> (u32, f32) {
    // Coordinates that are not finite show the first pixel.
    let place = if place.is_finite() { place } else { 0.0 };
    let at = (place.rem_euclid(1.0) * size as f32 - 0.5).rem_euclid(size as f32);
    let before = (at as u32).min(size - 1);
    (before, at - before as f32)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::object::mesh::{MeshError, TriMesh};
    use nalgebra::Point3;

    fn triangle() -> TriMesh {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        TriMesh::new(corners.map(Point3::from).to_vec(), vec![[0, 1, 2]]).unwrap()
    }

    fn textured(image: u32) -> SurfaceColor {
        let pixels = vec![[0, 0, 0], [200, 0, 0], [0, 100, 0], [200, 100, 0]];
        SurfaceColor::Textures {
            images: vec![ColorImage::new(2, 2, pixels).unwrap()],
            triangles: vec![TexturedTriangle {
                image,
                corners: [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75]],
            }],
        }
    }

    #[test]
    fn vertex_colors_are_interpolated() {
        let colors = SurfaceColor::Vertices(vec![[0, 0, 0], [100, 0, 0], [0, 200, 40]]);
        let mesh = triangle().with_color(colors).unwrap();
        assert_eq!(mesh.color_at(0, [0.0, 0.0, 1.0]), Some([0.0, 200.0, 40.0]));
        assert_eq!(
            mesh.color_at(0, [0.25, 0.5, 0.25]),
            Some([50.0, 50.0, 10.0])
        );
        assert_eq!(triangle().color_at(0, [1.0, 0.0, 0.0]), None);
    }

    #[test]
    fn textures_are_bilinear_and_repeat() {
        let mesh = triangle().with_color(textured(0)).unwrap();
        // The corners lie at the centers of three pixels.
        assert_eq!(mesh.color_at(0, [1.0, 0.0, 0.0]), Some([0.0, 0.0, 0.0]));
        assert_eq!(mesh.color_at(0, [0.0, 1.0, 0.0]), Some([200.0, 0.0, 0.0]));
        assert_eq!(mesh.color_at(0, [0.0, 0.5, 0.5]), Some([100.0, 50.0, 0.0]));
        let image = ColorImage::new(2, 1, vec![[0; 3], [80; 3]]).unwrap();
        for (place, red) in [(0.0, 40.0), (1.0, 40.0), (-0.25, 80.0), (7.25, 0.0)] {
            assert_eq!(sample(&image, place, 0.3)[0], red, "{place}");
        }
        assert_eq!(sample(&image, f32::NAN, f32::INFINITY)[0], 40.0);
    }

    #[test]
    fn counts_that_do_not_match_the_mesh_are_refused() {
        let error = triangle().with_color(SurfaceColor::Vertices(vec![[0; 3]; 2]));
        assert_eq!(
            error.unwrap_err().to_string(),
            "mesh has 2 vertex colors, expected 3"
        );
        let error = triangle().with_color(textured(1)).unwrap_err();
        let (triangle, image, images) = (0, 1, 1);
        let expected = MeshError::NoTexture {
            triangle,
            image,
            images,
        };
        assert_eq!(error, expected);
    }
}

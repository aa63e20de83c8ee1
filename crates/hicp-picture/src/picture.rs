//! RGB pictures, and lines on them.

use std::sync::Arc;

use hicp_core::{DepthImage, ImageError, Mask, Observation, PinholeCamera};

use crate::PictureError;

/// A color, 8 bits per channel.
pub type Rgb = [u8; 3];

/// Solid sky blue: the poses of a result, after a refinement.
pub const RESULT: Line = Line {
    color: [86, 180, 233],
    dashed: false,
};
/// Dashed orange: the poses to compare with, before a refinement.
///
/// Color-blind people can tell the two colors apart.
pub const AGAINST: Line = Line {
    color: [230, 159, 0],
    dashed: true,
};

/// The length of a dash and of a gap, in sides of pixels.
const DASH: (usize, usize) = (7, 5);
/// The opacity of the shade on a surface that is seen from the side.
const TURNED: f32 = 0.6;

/// The style of an outline.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    /// Its color.
    pub color: Rgb,
    /// `true` if it has gaps.
    pub dashed: bool,
}

impl Line {
    /// Returns whether it is drawn at a place along it, in pixels.
    #[must_use]
    pub fn draws(&self, place: usize) -> bool {
        !self.dashed || place % (DASH.0 + DASH.1) < DASH.0
    }
}

/// An RGB picture.
///
/// Drawing panics if the number of bytes is not that of the pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Number of columns.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// Red, green and blue of every pixel, row by row: `3 * width * height` bytes.
    pub rgb: Vec<u8>,
}

impl Picture {
    /// Creates a white picture.
    #[must_use]
    pub fn white(width: u32, height: u32) -> Self {
        let rgb = vec![255; 3 * width as usize * height as usize];
        Self { width, height, rgb }
    }

    /// Shows depth in gray: near is bright, nothing is black.
    #[must_use]
    pub fn of_depth(depth: &DepthImage) -> Self {
        let mut measured: Vec<f32> = depth.pixels().to_vec();
        measured.retain(|z| *z > 0.0);
        measured.sort_by(f32::total_cmp);
        // The middle 96 % set the contrast, so that a stray pixel does not.
        let last = measured.len().saturating_sub(1);
        let at = |share: usize| measured.get(last * share / 100).copied();
        let (near, far) = (at(2).unwrap_or(0.0), at(98).unwrap_or(1.0));
        let range = (far - near).max(1e-3);
        let gray = |z: f32| {
            let t = ((z - near) / range).clamp(0.0, 1.0);
            if z > 0.0 {
                (210.0 - 150.0 * t) as u8
            } else {
                0
            }
        };
        let (width, height) = (depth.width(), depth.height());
        let rgb = depth.pixels().iter().flat_map(|z| [gray(*z); 3]).collect();
        Self { width, height, rgb }
    }

    /// Shows depth like [`Picture::of_depth`], darker where the surface turns away from the camera.
    ///
    /// # Errors
    ///
    /// [`ImageError`] if the sizes of the image and of the camera differ.
    pub fn shaded(depth: &Arc<DepthImage>, camera: &PinholeCamera) -> Result<Self, ImageError> {
        let mask = Mask::full(depth.width(), depth.height());
        let observation = Observation::new(Arc::clone(depth), mask, *camera)?;
        let mut picture = Self::of_depth(depth);
        for (index, surfel) in observation.surfels(1) {
            let (u, v) = observation.pixel(index);
            let facing = surfel.normal.dot(&surfel.point.coords.normalize()).abs();
            picture.mix((u.into(), v.into()), [0; 3], TURNED * (1.0 - facing));
        }
        Ok(picture)
    }

    /// Mixes a color into a pixel. Does nothing outside the picture.
    pub fn mix(&mut self, (u, v): (i64, i64), color: Rgb, opacity: f32) {
        let u = u32::try_from(u).ok().filter(|u| *u < self.width);
        let v = u32::try_from(v).ok().filter(|v| *v < self.height);
        let (Some(u), Some(v)) = (u, v) else {
            return;
        };
        let index = 3 * (v as usize * self.width as usize + u as usize);
        for (channel, color) in self.rgb[index..index + 3].iter_mut().zip(color) {
            let mixed = f32::from(*channel) * (1.0 - opacity) + f32::from(color) * opacity;
            // In the range of a byte, as both are.
            *channel = mixed.round() as u8;
        }
    }

    /// Copies another picture into this one, its upper left pixel to (`u`, `v`).
    ///
    /// Pixels outside of this picture are left out.
    pub fn paste(&mut self, other: &Self, u: u32, v: u32) {
        let (own, left) = (3 * self.width as usize, 3 * u.min(self.width) as usize);
        let width = (3 * other.width as usize).min(own - left);
        let rows = self.rgb.chunks_exact_mut(own.max(1)).skip(v as usize);
        for (to, from) in rows.zip(other.rgb.chunks_exact((3 * other.width as usize).max(1))) {
            to[left..left + width].copy_from_slice(&from[..width]);
        }
    }

    /// Returns the picture, in the middle of the width, above white rows.
    #[must_use]
    pub fn above(&self, width: u32, rows: u32) -> Self {
        let mut all = Self::white(width, self.height + rows);
        all.paste(self, width.saturating_sub(self.width) / 2, 0);
        all
    }

    /// Draws a sample of a line, its left end at `(x, y)`.
    pub fn stroke(&mut self, (x, y): (i32, i32), length: i32, thickness: i32, line: Line) {
        let rows = y - thickness / 2..y - thickness / 2 + thickness;
        for (u, v) in rows.flat_map(|v| (0..length).map(move |u| (u, v))) {
            if line.draws(u as usize) {
                self.mix(((x + u).into(), v.into()), line.color, 1.0);
            }
        }
    }

    /// Encodes the picture as PNG.
    ///
    /// # Errors
    ///
    /// [`PictureError::Encoding`] if the number of bytes is not that of the pixels, or if there are
    /// no pixels.
    pub fn png(&self) -> Result<Vec<u8>, PictureError> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.rgb)?;
        writer.finish()?;
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pasted_pixels_outside_of_the_picture_are_left_out() {
        let black = Picture {
            width: 3,
            height: 3,
            rgb: vec![0; 27],
        };
        let mut picture = Picture::white(4, 5);
        picture.paste(&black, 2, 3);
        picture.paste(&black, 9, 9);
        let dark = picture.rgb.chunks_exact(3).enumerate();
        let dark: Vec<usize> = dark.filter(|(_, p)| p[0] == 0).map(|(i, _)| i).collect();
        assert_eq!(dark, [14, 15, 18, 19]);
    }
}

//! Pictures of images, with the outlines of models drawn on them.

mod before_after;
mod contour;
pub(crate) mod legend;
pub(crate) mod text;

use std::collections::BTreeMap;
use std::sync::Arc;

use hybrid_icp::core::{DepthImage, Mask, Observation, PinholeCamera, RenderedView};

use contour::contours;

/// A color, 8 bits per channel.
pub(crate) type Rgb = [u8; 3];

/// Solid sky blue: the poses of a result, after a refinement.
pub(crate) const RESULT: Line = Line {
    color: [86, 180, 233],
    dashed: false,
};
/// Dashed orange: the poses to compare with, before a refinement.
///
/// Color-blind people can tell the two colors apart.
pub(crate) const AGAINST: Line = Line {
    color: [230, 159, 0],
    dashed: true,
};

/// The length of a dash and of a gap, in sides of pixels.
const DASH: (usize, usize) = (7, 5);
/// The opacity of a line where something hides the model.
const FAINT: f32 = 0.4;
/// The opacity of the shade next to a line, which makes it visible on any color.
const SHADE: f32 = 0.55;

/// The opacity of the shade on a surface that is seen from the side.
const TURNED: f32 = 0.6;

/// The style of an outline.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    pub(crate) color: Rgb,
    pub(crate) dashed: bool,
}

impl Line {
    /// Returns whether it is drawn at a place along it, in pixels.
    pub(crate) fn draws(&self, place: usize) -> bool {
        !self.dashed || place % (DASH.0 + DASH.1) < DASH.0
    }
}

/// An RGB picture.
pub(crate) struct Picture {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) rgb: Vec<u8>,
}

impl Picture {
    /// Shows depth in gray: near is bright, nothing is black.
    pub(crate) fn of_depth(depth: &DepthImage) -> Self {
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
    pub(crate) fn shaded(
        depth: &Arc<DepthImage>,
        camera: &PinholeCamera,
    ) -> Result<Self, hybrid_icp::core::ImageError> {
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

    /// Draws lines: first the shade next to all of them, then the lines in their order.
    pub(crate) fn draw(&mut self, ink: &Ink) {
        let mut shade: BTreeMap<(i64, i64), f32> = BTreeMap::new();
        for ((u, v), _, opacity) in &ink.dots {
            for (du, dv) in (-1..=1).flat_map(|dv| (-1..=1).map(move |du| (du, dv))) {
                let most = shade.entry((u + du, v + dv)).or_default();
                *most = most.max(SHADE * opacity);
            }
        }
        for (place, opacity) in shade {
            self.mix(place, [0; 3], opacity);
        }
        for (place, color, opacity) in &ink.dots {
            self.mix(*place, *color, *opacity);
        }
    }

    /// Mixes a color into a pixel. Does nothing outside the picture.
    pub(crate) fn mix(&mut self, (u, v): (i64, i64), color: Rgb, opacity: f32) {
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

    /// Returns the picture, in the middle of the width, above white rows.
    pub(crate) fn above(&self, width: u32, rows: u32) -> Self {
        let (row, height) = (3 * width as usize, self.height + rows);
        let mut rgb = vec![255; row * height as usize];
        let own = 3 * self.width as usize;
        let left = 3 * ((width - self.width) / 2) as usize;
        let pairs = rgb
            .chunks_exact_mut(row)
            .zip(self.rgb.chunks_exact(own.max(1)));
        pairs.for_each(|(to, from)| to[left..left + own].copy_from_slice(from));
        Self { width, height, rgb }
    }

    /// Draws a sample of a line, its left end at `(x, y)`.
    pub(crate) fn stroke(&mut self, (x, y): (i32, i32), length: i32, thickness: i32, line: Line) {
        let rows = y - thickness / 2..y - thickness / 2 + thickness;
        for (u, v) in rows.flat_map(|v| (0..length).map(move |u| (u, v))) {
            if line.draws(u as usize) {
                self.mix(((x + u).into(), v.into()), line.color, 1.0);
            }
        }
    }

    /// Encodes the picture as PNG.
    pub(crate) fn png(&self) -> Result<Vec<u8>, png::EncodingError> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.rgb)?;
        writer.finish()?;
        Ok(bytes)
    }

    /// Writes the picture as PNG.
    pub(crate) fn write(&self, path: &std::path::Path) -> Result<(), hicp_io::IoError> {
        hicp_io::write_rgb_png(path, self.width, self.height, &self.rgb)
    }
}

/// All lines of a picture. They are drawn together, so that no line shades another.
#[derive(Debug)]
pub(crate) struct Ink {
    width: i64,
    height: i64,
    /// Pixels with their colors and opacities.
    dots: Vec<((i64, i64), Rgb, f32)>,
}

impl Ink {
    /// Creates ink for a picture.
    pub(crate) fn of(picture: &Picture) -> Self {
        Self {
            width: picture.width.into(),
            height: picture.height.into(),
            dots: Vec::new(),
        }
    }

    /// Adds the outline of a view, two pixels wide.
    ///
    /// It is faint where `hidden(u, v, depth of the model)` holds.
    /// There is no outline where the border of the image cuts the silhouette.
    pub(crate) fn outline(
        &mut self,
        view: &RenderedView,
        line: Line,
        hidden: impl Fn(u32, u32, f32) -> bool,
    ) {
        let (columns, rows) = (0..self.width, 0..self.height);
        let mut dots: BTreeMap<(i64, i64), f32> = BTreeMap::new();
        for path in contours(view) {
            for (place, side) in path.iter().enumerate() {
                let is_inside = columns.contains(&side.outside.0) && rows.contains(&side.outside.1);
                if !line.draws(place) || !is_inside {
                    continue;
                }
                let (u, v) = side.inside;
                let is_hidden = hidden(u, v, view.depth_at(u, v));
                for place in [(i64::from(u), i64::from(v)), side.outside] {
                    let most = dots.entry(place).or_default();
                    *most = most.max(if is_hidden { FAINT } else { 1.0 });
                }
            }
        }
        let dots = dots.into_iter();
        self.dots
            .extend(dots.map(|(place, opacity)| (place, line.color, opacity)));
    }
}

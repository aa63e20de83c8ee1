//! All lines of a picture.

use std::collections::BTreeMap;

use hicp_core::RenderedView;

use crate::contour::contours;
use crate::picture::{Line, Picture, Rgb};

/// The opacity of a line where something hides the model.
const FAINT: f32 = 0.4;
/// The opacity of the shade next to a line, which makes it visible on any color.
const SHADE: f32 = 0.55;

/// All lines of a picture. They are drawn together, so that no line shades another.
#[derive(Debug)]
pub struct Ink {
    width: i64,
    height: i64,
    /// Pixels with their colors and opacities.
    dots: Vec<((i64, i64), Rgb, f32)>,
}

impl Ink {
    /// Creates ink for a picture.
    #[must_use]
    pub fn of(picture: &Picture) -> Self {
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
    pub fn outline(
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

impl Picture {
    /// Draws lines: first the shade next to all of them, then the lines in their order.
    pub fn draw(&mut self, ink: &Ink) {
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
}

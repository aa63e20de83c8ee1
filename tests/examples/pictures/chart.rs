//! Line charts, with every line named at its end.

use std::ops::Range;

use crate::svg::{Anchor, GRAY, INK, Place, Svg};

/// A line of a chart.
pub(crate) struct Line {
    pub(crate) name: String,
    pub(crate) color: &'static str,
    pub(crate) points: Vec<(f64, f64)>,
}

/// The axes of a chart.
pub(crate) struct Axes {
    pub(crate) title: &'static str,
    pub(crate) x: (&'static str, Range<f64>, Vec<f64>),
    pub(crate) y: (&'static str, Range<f64>, Vec<f64>),
    /// If `true`, the y axis is logarithmic.
    pub(crate) log: bool,
}

/// Corners of the plotted area in a picture of 760 × 400.
const LEFT_TOP: Place = (70.0, 50.0);
const RIGHT_BOTTOM: Place = (540.0, 340.0);
/// Least distance between two names.
const NAME_HEIGHT: f64 = 18.0;

impl Axes {
    /// Returns the place of a point, which is clamped to the axes.
    pub(crate) fn place(&self, (x, y): (f64, f64)) -> Place {
        let share = |value: f64, range: &Range<f64>| {
            ((value - range.start) / (range.end - range.start)).clamp(0.0, 1.0)
        };
        let y = match self.log {
            true => share(y.ln(), &(self.y.1.start.ln()..self.y.1.end.ln())),
            false => share(y, &self.y.1),
        };
        let (left, top) = LEFT_TOP;
        let (right, bottom) = RIGHT_BOTTOM;
        (
            left + share(x, &self.x.1) * (right - left),
            bottom - y * (bottom - top),
        )
    }

    /// Draws the axes with a grid; returns a picture of 760 × 400.
    pub(crate) fn draw(&self) -> Svg {
        let mut svg = Svg::new(760.0, 400.0);
        let (left, top) = LEFT_TOP;
        let (right, bottom) = RIGHT_BOTTOM;
        svg.text((left, 28.0), 17, INK, Anchor::Start, self.title);
        for y in &self.y.2 {
            let (_, v) = self.place((self.x.1.start, *y));
            svg.path(&[(left, v), (right, v)], r##"stroke="#e3e6ea""##);
            svg.text((left - 8.0, v + 5.0), 14, GRAY, Anchor::End, &y.to_string());
        }
        for x in &self.x.2 {
            let (u, _) = self.place((*x, self.y.1.start));
            svg.path(&[(u, bottom), (u, bottom + 5.0)], r##"stroke="#7d8590""##);
            svg.text((u, bottom + 22.0), 14, GRAY, Anchor::Middle, &x.to_string());
        }
        svg.path(&[(left, bottom), (right, bottom)], r##"stroke="#7d8590""##);
        let middle = f64::midpoint(left, right);
        svg.text((middle, bottom + 45.0), 14, INK, Anchor::Middle, self.x.0);
        let middle = f64::midpoint(top, bottom);
        svg.add(&format!(
            r#"<text transform="translate(22 {middle}) rotate(-90)" font-size="14" fill="{INK}" text-anchor="middle">{}</text>"#,
            self.y.0
        ));
        svg
    }

    /// Draws lines, and their names in the order of their ends.
    pub(crate) fn plot(&self, svg: &mut Svg, lines: &[Line]) {
        let mut names: Vec<(f64, &Line)> = Vec::new();
        for line in lines {
            let places: Vec<Place> = line.points.iter().map(|p| self.place(*p)).collect();
            let style = format!(
                r#"fill="none" stroke="{}" stroke-width="2.5" stroke-linejoin="round""#,
                line.color
            );
            svg.path(&places, &style);
            for place in places.iter().filter(|_| places.len() < 20) {
                svg.dot(*place, 3.5, line.color);
            }
            names.push((places.last().map_or(0.0, |place| place.1), line));
        }
        names.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut lowest = f64::NEG_INFINITY;
        // The last name must not be below the axis.
        let room = RIGHT_BOTTOM.1 - NAME_HEIGHT * (names.len() as f64 - 1.0);
        for (index, (v, line)) in names.iter().enumerate() {
            let most = room + NAME_HEIGHT * index as f64;
            let v = v
                .max(lowest + NAME_HEIGHT)
                .min(most.max(lowest + NAME_HEIGHT));
            lowest = v;
            let place = (RIGHT_BOTTOM.0 + 12.0, v + 5.0);
            svg.text(place, 14, line.color, Anchor::Start, &line.name);
        }
    }
}

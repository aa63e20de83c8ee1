//! Legends: rows of text and samples of lines below a picture.

use super::text::{Align, Text, fitted};
use super::{Line, Picture, Rgb};

pub(crate) const BLACK: Rgb = [20; 3];
pub(crate) const GRAY: Rgb = [110; 3];
pub(crate) const RED: Rgb = [200, 30, 30];

/// The width of a legend at least, and the width that lengths refer to. Wider pictures scale them.
pub(crate) const WIDTH: i32 = 640;
/// Distance of the text from both sides.
pub(crate) const LEFT: i32 = 12;
/// Height of a row.
const ROW: i32 = 19;
/// Half the height of the font. Letters of fonts of odd heights do not align.
const HALF_FONT: i32 = 7;
/// Length of a sample of a line, and the distance of its name from the left end of the sample.
const SAMPLE: (i32, i32) = (32, 40);

/// Returns the height of the font for a picture of some width.
pub(crate) fn font(width: u32) -> i32 {
    2 * scaled(HALF_FONT, width)
}

fn scaled(length: i32, width: u32) -> i32 {
    let scale = (f64::from(width) / f64::from(WIDTH)).max(1.0);
    (f64::from(length) * scale).round() as i32
}

/// A picture with white rows below it. A place is a column and the number of a row.
pub(crate) struct Legend {
    canvas: Picture,
    texts: Vec<Text>,
    top: i32,
}

impl Legend {
    /// Starts a legend of some rows below a picture.
    pub(crate) fn below(picture: &Picture, rows: i32) -> anyhow::Result<Self> {
        let width = picture.width.max(WIDTH.unsigned_abs());
        let height = scaled(ROW * rows + 12, width);
        Ok(Self {
            canvas: picture.above(width, u32::try_from(height)?),
            texts: Vec::new(),
            top: i32::try_from(picture.height)?,
        })
    }

    /// Adds a text, shortened if it is wider than the picture.
    pub(crate) fn text(&mut self, text: &str, place: (i32, i32), align: Align, color: Rgb) {
        self.fit(text, place, WIDTH - 2 * LEFT, align, color);
    }

    /// Adds a sample of a line and its name, both within `length`.
    pub(crate) fn line(&mut self, name: &str, place: (i32, i32), length: i32, line: Line) {
        let (sample, indent) = SAMPLE;
        let (at, [sample, thickness]) = (self.at(place), [sample, 2].map(|l| self.scaled(l)));
        self.canvas.stroke(at, sample, thickness, line);
        let place = (place.0 + indent, place.1);
        self.fit(name, place, length - indent, Align::Left, BLACK);
    }

    /// Writes the texts and returns the picture with its legend.
    pub(crate) fn finish(mut self) -> anyhow::Result<Picture> {
        self.canvas.write_texts(&self.texts)?;
        Ok(self.canvas)
    }

    fn fit(&mut self, text: &str, place: (i32, i32), length: i32, align: Align, color: Rgb) {
        let size = font(self.canvas.width);
        self.texts.push(Text {
            text: fitted(text, size, self.scaled(length).unsigned_abs()),
            at: self.at(place),
            align,
            size,
            color,
        });
    }

    fn at(&self, (column, row): (i32, i32)) -> (i32, i32) {
        let row = self.scaled(6 + ROW * row + ROW / 2);
        (self.scaled(column), self.top + row)
    }

    fn scaled(&self, length: i32) -> i32 {
        scaled(length, self.canvas.width)
    }
}

//! Legends: rows of text and samples of lines below a picture.

use crate::text::{Align, Text, fitted};
use crate::{Line, Picture, PictureError, Rgb};

/// The color of text.
pub const BLACK: Rgb = [20; 3];
/// The color of headings and notes.
pub const GRAY: Rgb = [110; 3];
/// The color of figures that are far off.
pub const RED: Rgb = [200, 30, 30];

/// The width of a legend at least, and the width that lengths refer to. Wider pictures scale them.
pub const WIDTH: i32 = 640;
/// Distance of the text from both sides.
pub const LEFT: i32 = 12;
/// Height of a row.
const ROW: i32 = 19;
/// Half the height of the font. Letters of fonts of odd heights do not align.
const HALF_FONT: i32 = 7;
/// Length of a sample of a line, and the distance of its name from the left end of the sample.
const SAMPLE: (i32, i32) = (32, 40);

/// Returns the height of the font for a picture of some width.
#[must_use]
pub fn font(width: u32) -> i32 {
    2 * scaled(HALF_FONT, width)
}

fn scaled(length: i32, width: u32) -> i32 {
    let scale = (f64::from(width) / f64::from(WIDTH)).max(1.0);
    (f64::from(length) * scale).round() as i32
}

/// A picture with white rows below it. A place is a column and the number of a row.
#[derive(Clone, Debug)]
pub struct Legend {
    canvas: Picture,
    texts: Vec<Text>,
    top: i32,
}

impl Legend {
    /// Starts a legend of some rows below a picture.
    ///
    /// # Errors
    ///
    /// [`PictureError::Rows`] if both together have too many rows of pixels.
    pub fn below(picture: &Picture, rows: usize) -> Result<Self, PictureError> {
        let width = picture.width.max(WIDTH.unsigned_abs());
        let height = i32::try_from(rows).unwrap_or(i32::MAX).saturating_mul(ROW);
        let height = scaled(height.saturating_add(12), width).unsigned_abs();
        let all = u64::from(picture.height) + u64::from(height);
        if i32::try_from(all).is_err() {
            return Err(PictureError::Rows { rows: all });
        }
        Ok(Self {
            canvas: picture.above(width, height),
            texts: Vec::new(),
            top: i32::try_from(picture.height).unwrap_or(i32::MAX),
        })
    }

    /// Adds a text, shortened if it is wider than the picture.
    pub fn text(&mut self, text: &str, place: (i32, i32), align: Align, color: Rgb) {
        self.fit(text, place, WIDTH - 2 * LEFT, align, color);
    }

    /// Adds a sample of a line and its name, both within `length`.
    pub fn line(&mut self, name: &str, place: (i32, i32), length: i32, line: Line) {
        let (sample, indent) = SAMPLE;
        let (at, [sample, thickness]) = (self.at(place), [sample, 2].map(|l| self.scaled(l)));
        self.canvas.stroke(at, sample, thickness, line);
        let place = (place.0 + indent, place.1);
        self.fit(name, place, length - indent, Align::Left, BLACK);
    }

    /// Writes the texts and returns the picture with its legend.
    ///
    /// # Errors
    ///
    /// [`PictureError::Text`] if a text cannot be drawn.
    pub fn finish(mut self) -> Result<Picture, PictureError> {
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

//! Text in pictures, in a font that is part of the crate.

use std::sync::Once;

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontStyle, register_font};

use crate::{Picture, PictureError, Rgb};

/// The part of a text whose place is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// The left end.
    Left,
    /// The middle.
    Center,
    /// The right end.
    Right,
}

/// A line of text.
#[derive(Clone, Debug)]
pub struct Text {
    /// The letters.
    pub text: String,
    /// Column of the part that `align` names, and row of the middle.
    pub at: (i32, i32),
    /// The part that is at the column of `at`.
    pub align: Align,
    /// Height of the font, pixels; even, because letters of odd heights do not align.
    pub size: i32,
    /// Its color.
    pub color: Rgb,
}

impl Picture {
    /// Writes texts, one after the other.
    ///
    /// # Errors
    ///
    /// [`PictureError::Text`] if a text cannot be drawn.
    pub fn write_texts(&mut self, texts: &[Text]) -> Result<(), PictureError> {
        register();
        let failed = |text: &str, reason: String| PictureError::Text {
            text: text.to_owned(),
            reason,
        };
        let size = (self.width, self.height);
        let area = BitMapBackend::with_buffer(&mut self.rgb, size).into_drawing_area();
        for text in texts {
            let [red, green, blue] = text.color;
            let color = RGBColor(red, green, blue);
            let align = match text.align {
                Align::Left => HPos::Left,
                Align::Center => HPos::Center,
                Align::Right => HPos::Right,
            };
            let style = TextStyle::from(("sans-serif", text.size).into_font())
                .color(&color)
                .pos(Pos::new(align, VPos::Center));
            area.draw_text(&text.text, &style, text.at)
                .map_err(|error| failed(&text.text, error.to_string()))?;
        }
        area.present()
            .map_err(|error| failed("", error.to_string()))
    }
}

/// Returns a text that is at most `width` pixels wide.
///
/// A shortened text has an ellipsis in its middle.
#[must_use]
pub fn fitted(text: &str, size: i32, width: u32) -> String {
    register();
    let font = ("sans-serif", size).into_font();
    let fits = |text: &str| font.box_size(text).is_ok_and(|(found, _)| found <= width);
    let letters: Vec<char> = text.chars().collect();
    let shortened = |kept: usize| -> String {
        let (head, tail) = letters.split_at(kept / 2);
        let tail = &tail[letters.len() - kept..];
        head.iter().chain(['…'].iter()).chain(tail).collect()
    };
    if fits(text) {
        return text.to_owned();
    }
    let mut tried = (0..letters.len()).rev().map(shortened);
    tried.find(|text| fits(text)).unwrap_or_default()
}

fn register() {
    static FONT: Once = Once::new();
    FONT.call_once(|| {
        // Fails only for bytes that are no font. Writing then fails too.
        let _ = register_font("sans-serif", FontStyle::Normal, dejavu::sans::regular());
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_names_keep_their_ends() {
        let name = "a_rather_long_name_of_a_result_file_ycbv-test.csv";
        let short = fitted(name, 14, 150);
        assert!(
            short.starts_with("a_r") && short.ends_with("test.csv"),
            "{short}"
        );
        assert!(short.contains('…') && short.chars().count() > 12, "{short}");
        assert_eq!(fitted(name, 14, 1000), name);
        assert_eq!(fitted("ä", 14, 0), "");
    }

    #[test]
    fn text_is_drawn_at_its_place() {
        let mut picture = Picture::white(80, 30);
        let text = Text {
            text: "0.25".to_owned(),
            at: (70, 15),
            align: Align::Right,
            size: 14,
            color: [0; 3],
        };
        picture.write_texts(&[text]).unwrap();
        let dark = picture.rgb.chunks_exact(3).enumerate();
        let dark: Vec<usize> = dark.filter(|(_, p)| p[0] < 128).map(|(i, _)| i).collect();
        assert!(dark.len() > 30, "{}", dark.len());
        for index in dark {
            assert!((35..=70).contains(&(index % 80)) && (5..25).contains(&(index / 80)));
        }
    }
}

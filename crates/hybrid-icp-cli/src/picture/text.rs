//! Text in pictures, in a font that is part of the program.

use std::sync::Once;

use anyhow::anyhow;
use plotters::prelude::*;
pub(crate) use plotters::style::text_anchor::HPos as Align;
use plotters::style::text_anchor::{Pos, VPos};
use plotters::style::{FontStyle, register_font};

use super::{Picture, Rgb};

/// A line of text.
#[derive(Clone)]
pub(crate) struct Text {
    pub(crate) text: String,
    /// Column of the end that `align` names, and row of the middle.
    pub(crate) at: (i32, i32),
    pub(crate) align: Align,
    /// Height of the font, pixels; even, because letters of odd heights do not align.
    pub(crate) size: i32,
    pub(crate) color: Rgb,
}

impl Picture {
    /// Writes texts, one after the other.
    pub(crate) fn write_texts(&mut self, texts: &[Text]) -> anyhow::Result<()> {
        register();
        let size = (self.width, self.height);
        let area = BitMapBackend::with_buffer(&mut self.rgb, size).into_drawing_area();
        for text in texts {
            let [red, green, blue] = text.color;
            let color = RGBColor(red, green, blue);
            let style = TextStyle::from(("sans-serif", text.size).into_font())
                .color(&color)
                .pos(Pos::new(text.align, VPos::Center));
            area.draw_text(&text.text, &style, text.at)
                .map_err(|error| anyhow!("cannot write {:?}: {error}", text.text))?;
        }
        area.present()
            .map_err(|error| anyhow!("cannot write text: {error}"))
    }
}

/// Returns a text that is at most `width` pixels wide.
///
/// A shortened text has an ellipsis in its middle.
pub(crate) fn fitted(text: &str, size: i32, width: u32) -> String {
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
        let mut picture = Picture {
            width: 80,
            height: 30,
            rgb: vec![255; 3 * 80 * 30],
        };
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

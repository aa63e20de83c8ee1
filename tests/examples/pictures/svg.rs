//! SVG text, and images inside of it.

use std::fmt::Write as _;
use std::path::Path;

use base64::prelude::{BASE64_STANDARD, Engine as _};

/// A point of a picture: x to the right, y down.
pub(crate) type Place = (f64, f64);

pub(crate) const INK: &str = "#24292f";
pub(crate) const GRAY: &str = "#7d8590";
/// The rough pose, the pose before. Color-blind readers can distinguish it from [`AFTER`].
pub(crate) const BEFORE: &str = "#e69f00";
/// The refined pose, and what was observed.
pub(crate) const AFTER: &str = "#0072b2";
pub(crate) const GOOD: &str = "#009e73";
pub(crate) const BAD: &str = "#d55e00";
pub(crate) const OTHER: &str = "#cc79a7";

/// The alignment of a text at its position.
#[derive(Clone, Copy)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// A picture of vector graphics.
pub(crate) struct Svg {
    size: Place,
    body: String,
}

impl Svg {
    pub(crate) fn new(width: f64, height: f64) -> Self {
        let size = (width, height);
        Self {
            size,
            body: String::new(),
        }
    }

    /// Adds an element as text.
    pub(crate) fn add(&mut self, element: &str) {
        self.body.push_str(element);
        self.body.push('\n');
    }

    pub(crate) fn text(
        &mut self,
        (x, y): Place,
        size: u32,
        color: &str,
        anchor: Anchor,
        text: &str,
    ) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let text = text.replace('&', "&amp;").replace('<', "&lt;");
        self.add(&format!(
            r#"<text x="{x:.1}" y="{y:.1}" font-size="{size}" fill="{color}" text-anchor="{anchor}">{text}</text>"#
        ));
    }

    /// Adds a line through points. `style` holds SVG attributes.
    pub(crate) fn path(&mut self, points: &[Place], style: &str) {
        let mut data = String::new();
        for (index, (x, y)) in points.iter().enumerate() {
            let letter = if index == 0 { 'M' } else { 'L' };
            let _ = write!(data, "{letter}{x:.1} {y:.1}");
        }
        self.add(&format!(r#"<path d="{data}" {style}/>"#));
    }

    pub(crate) fn dot(&mut self, (x, y): Place, radius: f64, color: &str) {
        self.add(&format!(
            r#"<circle cx="{x:.1}" cy="{y:.1}" r="{radius}" fill="{color}"/>"#
        ));
    }

    /// Adds an image of `size` gray pixels that fills a rectangle.
    pub(crate) fn image(
        &mut self,
        (x, y): Place,
        (w, h): Place,
        size: (u32, u32),
        gray: &[u8],
    ) -> Result<(), hicp_io::IoError> {
        let rgb: Vec<u8> = gray.iter().flat_map(|g| [*g; 3]).collect();
        let file = std::env::temp_dir().join(format!("hicp-{}.png", std::process::id()));
        hicp_io::write_rgb_png(&file, size.0, size.1, &rgb)?;
        let bytes = std::fs::read(&file).unwrap_or_default();
        let _ = std::fs::remove_file(&file);
        let data = BASE64_STANDARD.encode(bytes);
        self.add(&format!(
            r#"<image x="{x}" y="{y}" width="{w}" height="{h}" href="data:image/png;base64,{data}"/>"#
        ));
        Ok(())
    }

    pub(crate) fn write(&self, path: &Path) -> std::io::Result<()> {
        let (w, h) = self.size;
        std::fs::write(
            path,
            format!(
                "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" height=\"{h}\" \
                 font-family=\"Helvetica, Arial, sans-serif\">\n\
                 <rect width=\"{w}\" height=\"{h}\" fill=\"white\"/>\n{}</svg>\n",
                self.body
            ),
        )
    }
}

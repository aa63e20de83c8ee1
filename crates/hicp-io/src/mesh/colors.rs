//! The colors of a mesh during parsing.

use hicp_core::SurfaceColor;

/// The colors of a mesh as its file states them.
#[derive(Debug, Default)]
pub(crate) struct Colors {
    /// The numbers of each vertex.
    vertices: Vec<[f32; 3]>,
    /// Whether the numbers are bytes. Otherwise, the largest one shows their scale.
    bytes: bool,
    largest: f32,
}

impl Colors {
    /// Adds the color of the next vertex.
    #[allow(clippy::cast_possible_truncation, reason = "colors become bytes")]
    pub(super) fn add(&mut self, color: [f64; 3], bytes: bool) {
        let color = color.map(|number| number as f32);
        self.bytes = bytes;
        self.largest = color.into_iter().fold(self.largest, f32::max);
        self.vertices.push(color);
    }

    /// Returns the colors of a mesh with `vertices` vertices, or the reason why there are none.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the conversion saturates"
    )]
    pub(super) fn finish(self, vertices: usize) -> Result<Option<SurfaceColor>, String> {
        if self.vertices.is_empty() {
            return Ok(None);
        }
        let is_number = |color: &[f32; 3]| color.iter().all(|number| number.is_finite());
        if let Some(vertex) = self.vertices.iter().position(|color| !is_number(color)) {
            return Err(format!("vertex {vertex} with a color that is not a number"));
        }
        if self.vertices.len() != vertices {
            let found = self.vertices.len();
            return Err(format!("{found} colors of {vertices} vertices"));
        }
        let scale = match self.largest {
            _ if self.bytes => 1.0,
            ..=1.0 => 255.0,
            ..=255.0 => 1.0,
            _ => 255.0 / 65535.0,
        };
        let byte = |number: f32| (number * scale).round() as u8;
        let colors = self.vertices.into_iter();
        let colors = colors.map(|color| color.map(byte)).collect();
        Ok(Some(SurfaceColor::Vertices(colors)))
    }
}

//! Smooth random fields over an image.

use rand_distr::{Distribution, StandardNormal};

use crate::SimRng;

/// A smooth random field: normal values on a grid, smoothly interpolated.
pub(crate) struct Field {
    values: Vec<f64>,
    columns: usize,
    area: f64,
}

impl Field {
    /// Draws a field for an image. It changes over distances of `area` pixels.
    pub(crate) fn draw(rng: &mut SimRng, area: u32, width: u32, height: u32) -> Self {
        let area = area.max(1);
        let (columns, rows) = (width / area + 2, height / area + 2);
        let values = (0..columns * rows).map(|_| StandardNormal.sample(rng));
        Self {
            values: values.collect(),
            columns: columns as usize,
            area: f64::from(area),
        }
    }

    /// Returns the value at a pixel, of standard deviation 1.
    pub(crate) fn at(&self, u: u32, v: u32) -> f64 {
        let split = |x: u32| {
            let x = f64::from(x) / self.area;
            let share = x.fract();
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // Not negative.
            (x as usize, share * share * (3.0 - 2.0 * share))
        };
        let ((column, x), (row, y)) = (split(u), split(v));
        let corners = [
            (0, (1.0 - x) * (1.0 - y)),
            (1, x * (1.0 - y)),
            (self.columns, (1.0 - x) * y),
            (self.columns + 1, x * y),
        ];
        let first = row * self.columns + column;
        let sum: f64 = corners
            .iter()
            .map(|(o, w)| self.values[first + o] * w)
            .sum();
        sum / corners.iter().map(|(_, w)| w * w).sum::<f64>().sqrt()
    }
}

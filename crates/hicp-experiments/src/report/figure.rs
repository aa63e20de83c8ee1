//! Drawing of figures, as SVG and as pixels.

use std::sync::Once;

use hybrid_icp::core::internal::index;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::{FontStyle, register_font};

use super::curve::{Curve, Panel};
use super::panel::{Drawn, draw_entry, draw_panel};
use crate::error::ExperimentError;

/// Size of a panel, pixels.
const PANEL: (u32, u32) = (440, 320);
/// Height of an entry of the legend, pixels.
const ENTRY: u32 = 20;

/// Panels in rows, above one legend.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figure {
    /// The rows.
    pub rows: Vec<Vec<Panel>>,
}

impl Figure {
    /// Creates a figure from the panels that have curves, and the curves that have points.
    pub(crate) fn new(mut rows: Vec<Vec<Panel>>) -> Self {
        for row in &mut rows {
            for panel in &mut *row {
                panel.curves.retain(|curve| !curve.points.is_empty());
            }
            row.retain(|panel| !panel.curves.is_empty());
        }
        rows.retain(|row| !row.is_empty());
        Self { rows }
    }

    /// Returns whether there is nothing to draw.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Returns the labels of the legend: every variant once, in the order of the study.
    ///
    /// The place of a label decides the color and the marker of the variant in all panels.
    fn labels(&self) -> Vec<&str> {
        let panels = self.rows.iter().flatten();
        let mut curves: Vec<&Curve> = panels.flat_map(|panel| &panel.curves).collect();
        curves.sort_by_key(|curve| curve.variant);
        let mut labels = Vec::new();
        for curve in curves {
            if !labels.contains(&&*curve.label) {
                labels.push(&*curve.label);
            }
        }
        labels
    }

    /// Returns the width of an entry of the legend, pixels: enough for the longest label.
    fn entry_width(&self) -> u32 {
        let lengths = self.labels().into_iter().map(|l| l.chars().count());
        50 + 7 * index(lengths.max().unwrap_or(0).min(100))
    }

    /// Returns the numbers of rows and columns of the panels, and those of the legend below them.
    fn grids(&self) -> [(usize, usize); 2] {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0).max(1);
        let across = (PANEL.0 * index(columns) / self.entry_width()).max(1) as usize;
        let down = self.labels().len().div_ceil(across).max(1);
        [(self.rows.len().max(1), columns), (down, across)]
    }

    fn size(&self) -> (u32, u32) {
        let [(rows, columns), (down, _)] = self.grids();
        let height = PANEL.1 * index(rows) + ENTRY * index(down);
        (PANEL.0 * index(columns), height)
    }

    /// Draws the figure as SVG.
    ///
    /// # Errors
    ///
    /// [`ExperimentError::Figure`] when it cannot be laid out.
    pub fn svg(&self) -> Result<String, ExperimentError> {
        let mut text = String::new();
        drawn(SVGBackend::with_string(&mut text, self.size()), |area| {
            self.draw(area)
        })?;
        Ok(text)
    }

    /// Draws the figure as pixels: width, height, and red, green and blue of every pixel.
    ///
    /// # Errors
    ///
    /// [`ExperimentError::Figure`] when it cannot be laid out.
    pub fn pixels(&self) -> Result<(u32, u32, Vec<u8>), ExperimentError> {
        let (width, height) = self.size();
        let mut rgb = vec![0; 3 * width as usize * height as usize];
        let backend = BitMapBackend::with_buffer(&mut rgb, (width, height));
        drawn(backend, |area| self.draw(area))?;
        Ok((width, height, rgb))
    }

    /// Draws the entries of the legend and the panels one by one, as HTML that fits a page of any
    /// width.
    ///
    /// # Errors
    ///
    /// [`ExperimentError::Figure`] when it cannot be laid out.
    pub(crate) fn html(&self) -> Result<String, ExperimentError> {
        let labels = self.labels();
        let mut html = "<figure>\n<div>\n".to_owned();
        for (style, label) in labels.iter().enumerate() {
            let backend = SVGBackend::with_string(&mut html, (self.entry_width(), ENTRY));
            drawn(backend, |area| draw_entry(area, label, style))?;
        }
        for row in &self.rows {
            html += "</div>\n<div>\n";
            for panel in row {
                let backend = SVGBackend::with_string(&mut html, PANEL);
                drawn(backend, |area| draw_panel(area, panel, row, &labels))?;
            }
        }
        Ok(html + "</div>\n</figure>\n")
    }

    fn draw<B: DrawingBackend>(&self, area: &DrawingArea<B, Shift>) -> Drawn<B> {
        let [(rows, columns), legend] = self.grids();
        let labels = self.labels();
        let (panels, band) = area.split_vertically(PANEL.1 * index(rows));
        let bands = panels.split_evenly((rows, 1));
        for (row, band) in self.rows.iter().zip(bands) {
            for (panel, cell) in row.iter().zip(band.split_evenly((1, columns))) {
                draw_panel(&cell, panel, row, &labels)?;
            }
        }
        let mut entries = labels.iter().zip(band.split_evenly(legend)).enumerate();
        entries.try_for_each(|(style, (label, cell))| draw_entry(&cell, label, style))
    }
}

/// Fills the area of a backend with white, and draws on it.
fn drawn<B: DrawingBackend>(
    backend: B,
    draw: impl FnOnce(&DrawingArea<B, Shift>) -> Drawn<B>,
) -> Result<(), ExperimentError> {
    static FONT: Once = Once::new();
    FONT.call_once(|| {
        // Fails only for bytes that are not a font; drawing then reports it.
        let _ = register_font("sans-serif", FontStyle::Normal, dejavu::sans::regular());
    });
    let area = backend.into_drawing_area();
    let all = area
        .fill(&WHITE)
        .and_then(|()| draw(&area))
        .and_then(|()| area.present());
    all.map_err(|error| ExperimentError::Figure(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::super::curve::Curve;
    use super::*;
    use crate::analysis::Interval;

    fn figure() -> Figure {
        let at = |estimate| Interval {
            estimate,
            cases: 1,
            low: estimate - 0.05,
            high: estimate + 0.05,
        };
        let panel = Panel {
            title: "a".to_owned(),
            x_title: "b".to_owned(),
            y_title: "mean post-ICP VSD".to_owned(),
            curves: vec![Curve {
                label: "hybrid".to_owned(),
                variant: 0,
                points: vec![(0.1, at(0.2)), (0.9, at(0.4))],
            }],
        };
        Figure {
            rows: vec![vec![panel.clone(), panel]],
        }
    }

    #[test]
    fn a_variant_has_one_color_and_one_legend_entry_in_all_panels() {
        let mut figure = figure();
        let curve = figure.rows[0][0].curves[0].clone();
        let local = Curve {
            label: "local".to_owned(),
            variant: 1,
            ..curve
        };
        // Here `hybrid` is the second curve, but the first variant of the study.
        figure.rows[0][1].curves.insert(0, local);
        assert_eq!(figure.labels(), ["hybrid", "local"]);
        let page = figure.html().unwrap();
        // Each color has an entry of the legend and its panels; the second one has one panel.
        let parts = |color: &str| page.split("<svg").filter(|svg| svg.contains(color)).count();
        assert_eq!((parts("#0072B2"), parts("#E69F00")), (1 + 2, 1 + 1));
    }

    #[test]
    fn empty_panels_and_curves_are_left_out() {
        let mut rows = figure().rows;
        rows[0][1].curves[0].points.clear();
        rows.push(vec![rows[0][1].clone()]);
        let figure = Figure::new(rows);
        assert_eq!((figure.rows.len(), figure.rows[0].len()), (1, 1));
    }

    #[test]
    fn text_and_curves_are_drawn_in_both_formats() {
        let svg = figure().svg().unwrap();
        assert!(
            svg.contains("hybrid") && svg.contains("mean post-ICP VSD") && svg.contains("#0072B2")
        );
        let (width, height, rgb) = figure().pixels().unwrap();
        assert_eq!((width, height), (2 * PANEL.0, PANEL.1 + ENTRY));
        let count = |color: [u8; 3]| rgb.chunks_exact(3).filter(|p| *p == color).count();
        // Two curves of some hundred pixels, and black text.
        assert!(count([0, 114, 178]) > 500, "{}", count([0, 114, 178]));
        assert!(count([0, 0, 0]) > 200, "{}", count([0, 0, 0]));
    }
}

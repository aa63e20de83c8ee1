//! Drawing of figures, as SVG and as pixels.

use std::sync::Once;

use hybrid_icp::core::internal::index;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::{FontStyle, RelativeSize, register_font};

use super::curve::Panel;
use crate::error::ExperimentError;

/// Size of a panel, pixels.
const PANEL: (u32, u32) = (460, 330);
/// The palette of Okabe & Ito, which color-blind readers can distinguish; each color also has its
/// own marker.
const PALETTE: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(230, 159, 0),
    RGBColor(0, 158, 115),
    RGBColor(213, 94, 0),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];

/// Panels in rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figure {
    /// The rows.
    pub rows: Vec<Vec<Panel>>,
}

impl Figure {
    /// Returns whether there is nothing to draw.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    fn size(&self) -> (u32, u32) {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let count = |n: usize| index(n.clamp(1, 50));
        (PANEL.0 * count(columns), PANEL.1 * count(self.rows.len()))
    }

    /// Draws the figure as SVG.
    ///
    /// # Errors
    ///
    /// [`ExperimentError::Figure`] when it cannot be laid out.
    pub fn svg(&self) -> Result<String, ExperimentError> {
        let mut text = String::new();
        self.draw(&SVGBackend::with_string(&mut text, self.size()).into_drawing_area())?;
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
        self.draw(&BitMapBackend::with_buffer(&mut rgb, (width, height)).into_drawing_area())?;
        Ok((width, height, rgb))
    }

    fn draw<B: DrawingBackend>(&self, area: &DrawingArea<B, Shift>) -> Result<(), ExperimentError> {
        static FONT: Once = Once::new();
        FONT.call_once(|| {
            // Fails only for bytes that are not a font; drawing then reports it.
            let _ = register_font("sans-serif", FontStyle::Normal, dejavu::sans::regular());
        });
        let wrong =
            |error: DrawingAreaErrorKind<B::ErrorType>| ExperimentError::Figure(error.to_string());
        area.fill(&WHITE).map_err(wrong)?;
        for (row, band) in self
            .rows
            .iter()
            .zip(area.split_evenly((self.rows.len(), 1)))
        {
            let columns = self.rows.iter().map(Vec::len).max().unwrap_or(1);
            for (panel, cell) in row.iter().zip(band.split_evenly((1, columns))) {
                draw_panel(&cell, panel, top(row)).map_err(wrong)?;
            }
        }
        area.present().map_err(wrong)
    }
}

/// Returns the end of the y axis, which the panels of a row share.
fn top(row: &[Panel]) -> f64 {
    let points = row.iter().flat_map(|p| &p.curves).flat_map(|c| &c.points);
    let highest = points.map(|(_, i)| i.high).fold(0.05, f64::max);
    // Room for the legend.
    (highest * 1.3).min(1.3)
}

fn draw_panel<B: DrawingBackend>(
    cell: &DrawingArea<B, Shift>,
    panel: &Panel,
    top: f64,
) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
    let mut chart = ChartBuilder::on(cell)
        .caption(&panel.title, ("sans-serif", 15))
        .margin(8)
        .x_label_area_size(38)
        .y_label_area_size(50)
        .build_cartesian_2d(panel.x.clone(), 0.0..top)?;
    chart
        .configure_mesh()
        .x_desc(&panel.x_title)
        .y_desc(&panel.y_title)
        .axis_desc_style(("sans-serif", 12))
        .label_style(("sans-serif", 11))
        .x_labels(panel.x_numbers)
        .y_labels(7)
        .light_line_style(TRANSPARENT)
        .bold_line_style(RGBColor(225, 225, 225))
        .draw()?;
    let width = panel.x.end - panel.x.start;
    for (index, curve) in panel.curves.iter().enumerate() {
        let color = PALETTE[curve.style % PALETTE.len()];
        // Intervals are next to each other instead of on top of each other.
        let aside = (index as f64 - (panel.curves.len() as f64 - 1.0) / 2.0) * width * 0.006;
        let at = |x: f64| x + aside;
        let style = curve.style;
        chart
            .draw_series(LineSeries::new(
                curve.points.iter().map(|(x, i)| (at(*x), i.estimate)),
                color.stroke_width(2),
            ))?
            .label(&curve.label)
            .legend(move |(x, y)| {
                EmptyElement::at((x, y))
                    + PathElement::new(vec![(0, 0), (20, 0)], color.stroke_width(2))
                    + Polygon::new(marker(style, (10, 0)), color.filled())
            });
        chart.draw_series(curve.points.iter().map(|(x, i)| {
            PathElement::new(
                vec![(at(*x), i.low), (at(*x), i.high)],
                color.stroke_width(1),
            )
        }))?;
        chart.draw_series(curve.points.iter().map(|(x, i)| {
            EmptyElement::at((at(*x), i.estimate))
                + Polygon::new(marker(style, (0, 0)), color.filled())
        }))?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE.mix(0.85))
        .border_style(RGBColor(200, 200, 200))
        .label_font(("sans-serif", 11))
        .legend_area_size(RelativeSize::Width(0.06).min(26))
        .draw()
}

/// Returns the corners of a marker at a place, pixels: a square, a diamond, and triangles in four
/// directions.
fn marker(style: usize, (x, y): (i32, i32)) -> Vec<(i32, i32)> {
    let shape: &[(i32, i32)] = match style % 6 {
        0 => &[(-4, -4), (4, -4), (4, 4), (-4, 4)],
        1 => &[(0, -5), (5, 0), (0, 5), (-5, 0)],
        2 => &[(0, -5), (5, 4), (-5, 4)],
        3 => &[(0, 5), (5, -4), (-5, -4)],
        4 => &[(-5, 0), (4, 5), (4, -5)],
        _ => &[(5, 0), (-4, 5), (-4, -5)],
    };
    shape.iter().map(|(dx, dy)| (x + dx, y + dy)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::curve::Curve;
    use super::*;
    use crate::analysis::Interval;

    fn figure() -> Figure {
        let at = |estimate| Interval {
            estimate,
            low: estimate - 0.05,
            high: estimate + 0.05,
        };
        let panel = Panel {
            title: "a".to_owned(),
            x_title: "b".to_owned(),
            y_title: "mean post-ICP VSD".to_owned(),
            x: 0.0..1.0,
            x_numbers: 11,
            curves: vec![Curve {
                label: "hybrid".to_owned(),
                style: 0,
                points: vec![(0.1, at(0.2)), (0.9, at(0.4))],
            }],
        };
        Figure {
            rows: vec![vec![panel.clone(), panel]],
        }
    }

    #[test]
    fn text_and_curves_are_drawn_in_both_formats() {
        let svg = figure().svg().unwrap();
        assert!(
            svg.contains("hybrid") && svg.contains("mean post-ICP VSD") && svg.contains("#0072B2")
        );
        let (width, height, rgb) = figure().pixels().unwrap();
        assert_eq!((width, height), (2 * PANEL.0, PANEL.1));
        let count = |color: [u8; 3]| rgb.chunks_exact(3).filter(|p| *p == color).count();
        // Two curves of some hundred pixels, and black text.
        assert!(count([0, 114, 178]) > 500, "{}", count([0, 114, 178]));
        assert!(count([0, 0, 0]) > 200, "{}", count([0, 0, 0]));
    }
}

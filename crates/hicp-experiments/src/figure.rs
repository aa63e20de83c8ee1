//! Figures like Figure 6 of the paper: a row per study, three columns of curves.

use std::ops::Range;
use std::sync::Once;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::{FontStyle, RelativeSize, register_font};

use crate::analysis::{Analysis, Interval, Metric};
use crate::error::ExperimentError;
use crate::experiment::Experiment;

/// Size of a panel, pixels.
const PANEL: (u32, u32) = (460, 330);
/// The palette of Okabe & Ito, whose colours the colour-blind tell apart; each has a marker of its own as well.
const PALETTE: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(230, 159, 0),
    RGBColor(0, 158, 115),
    RGBColor(213, 94, 0),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];

/// Curves over the same axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Heading.
    pub title: String,
    /// What is along x.
    pub x_title: String,
    /// What is along y.
    pub y_title: String,
    /// Ends of the x axis.
    pub x: Range<f64>,
    /// About how many numbers stand along it.
    pub x_numbers: usize,
    /// The curves.
    pub curves: Vec<Curve>,
}

/// A variant's curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Name in the legend.
    pub label: String,
    /// Index of the colour and marker.
    pub style: usize,
    /// Points (x, mean with interval), from left to right.
    pub points: Vec<(f64, Interval)>,
}

/// Panels in rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figure {
    /// The rows.
    pub rows: Vec<Vec<Panel>>,
}

impl Figure {
    /// Lays out studies as the paper does: a row each; nearest-neighbour variants, projective variants, and the rest with the best
    /// of either. A study of α has one panel. Studies of time have none.
    #[must_use]
    pub fn of<'a>(analyses: impl IntoIterator<Item = &'a Analysis>) -> Self {
        let rows = analyses
            .into_iter()
            .map(row_of)
            .filter(|row| !row.is_empty());
        Self {
            rows: rows.collect(),
        }
    }

    /// Whether there is nothing to draw.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    fn size(&self) -> (u32, u32) {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let count = |n: usize| u32::try_from(n.clamp(1, 50)).unwrap_or(1);
        (PANEL.0 * count(columns), PANEL.1 * count(self.rows.len()))
    }

    /// Draws it as SVG.
    ///
    /// # Errors
    ///
    /// [`ExperimentError::Figure`] when it cannot be laid out.
    pub fn svg(&self) -> Result<String, ExperimentError> {
        let mut text = String::new();
        self.draw(&SVGBackend::with_string(&mut text, self.size()).into_drawing_area())?;
        Ok(text)
    }

    /// Draws it as pixels: width, height, and red, green and blue of every pixel.
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
            // Fails only for bytes that are no font; then nothing can be drawn, and drawing says so.
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

/// The end of the y axis of a row: its panels share it.
fn top(row: &[Panel]) -> f64 {
    let points = row.iter().flat_map(|p| &p.curves).flat_map(|c| &c.points);
    let highest = points.map(|(_, i)| i.high).fold(0.05, f64::max);
    // Room for the legend.
    (highest * 1.3).min(1.3)
}

fn row_of(analysis: &Analysis) -> Vec<Panel> {
    let (x_title, x): (&str, Range<f64>) = match analysis.experiment() {
        Experiment::InitNoise | Experiment::Beyond => ("pre-ICP VSD", 0.0..1.0),
        Experiment::DepthNoise => ("depth noise, % of the depth", -0.2..5.2),
        Experiment::ModelNoise => ("model noise level", -0.2..4.2),
        Experiment::Alpha => ("α", 0.0..1.0),
        Experiment::Timing => return Vec::new(),
    };
    let names = analysis.variants();
    let family = |prefix: &str| -> Vec<usize> {
        (0..names.len())
            .filter(|v| names[*v].starts_with(prefix))
            .collect()
    };
    let (nearest, projective) = (family("nn-"), family("projective-"));
    let mean = |v: usize| {
        analysis
            .mean(Metric::Vsd, analysis.overall(), v)
            .map_or(f64::INFINITY, |i| i.estimate)
    };
    let best = |among: &[usize]| {
        among
            .iter()
            .copied()
            .min_by(|a, b| mean(*a).total_cmp(&mean(*b)))
    };
    let rest = (0..names.len()).filter(|v| !nearest.contains(v) && !projective.contains(v));
    let last: Vec<usize> = rest
        .chain(best(&nearest))
        .chain(best(&projective))
        .collect();
    let panel = |title: &str, variants: &[usize]| Panel {
        title: format!("{}: {title}", analysis.experiment()),
        x_title: x_title.to_owned(),
        y_title: "mean post-ICP VSD".to_owned(),
        x: x.clone(),
        x_numbers: if x.end > 1.0 { 6 } else { 11 },
        curves: variants
            .iter()
            .enumerate()
            .map(|(style, v)| curve(analysis, *v, style))
            .collect(),
    };
    let whole = match analysis.experiment() {
        Experiment::Alpha => Some("mean VSD against the threshold"),
        Experiment::Beyond => Some("perfect images"),
        _ => None,
    };
    if let Some(title) = whole {
        let all: Vec<usize> = (0..names.len()).collect();
        return vec![panel(title, &all)];
    }
    [
        panel("nearest neighbours", &nearest),
        panel("projective", &projective),
        panel("hybrid and the best of either", &last),
    ]
    .into_iter()
    .filter(|p| !p.curves.is_empty())
    .collect()
}

/// The means of a variant over the single groups.
pub(crate) fn curve(analysis: &Analysis, variant: usize, style: usize) -> Curve {
    let singles = analysis
        .groups()
        .iter()
        .enumerate()
        .filter(|(_, g)| g.single);
    let points = singles
        .enumerate()
        .filter_map(|(step, (group, described))| {
            let x = match &described.bins {
                // The middle of the bin.
                Some(bins) => (bins.start as f64 + 0.5) / analysis.n_bins() as f64,
                None => described.label.parse().unwrap_or(step as f64),
            };
            Some((x, analysis.mean(Metric::Vsd, group, variant)?))
        });
    Curve {
        label: analysis.variants()[variant].clone(),
        style,
        points: points.collect(),
    }
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
        // Intervals side by side rather than on top of each other.
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

/// Corners of a marker about a place, pixels: a square, a diamond, and triangles in four directions.
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
    use super::*;

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

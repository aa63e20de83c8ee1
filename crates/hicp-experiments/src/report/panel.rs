//! Drawing of a panel, and of the entries of the legend.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::curve::Panel;

/// Largest number of labels along the x axis.
const MAX_LABELS: usize = 11;
/// The palette of Okabe & Ito without yellow, and three more colors. Color-blind readers can
/// distinguish it; each color also has its own marker.
const PALETTE: [u32; 10] = [
    0x0072b2, 0xe69f00, 0x009e73, 0xd55e00, 0xcc79a7, 0x56b4e9, 0x000000, 0x999933, 0x882255,
    0x828282,
];

/// The result of drawing on an area.
pub(super) type Drawn<B> = Result<(), DrawingAreaErrorKind<<B as DrawingBackend>::ErrorType>>;

/// Draws an entry of the legend at the upper left corner of an area.
pub(super) fn draw_entry<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    label: &str,
    style: usize,
) -> Drawn<B> {
    let (color, middle) = (color(style), 10);
    area.draw(&PathElement::new(
        vec![(10, middle), (34, middle)],
        color.stroke_width(2),
    ))?;
    area.draw(&Polygon::new(marker(style, (22, middle)), color.filled()))?;
    area.draw(&Text::new(label, (40, 4), ("sans-serif", 12)))
}

/// Draws a panel; those of a row share their axes.
pub(super) fn draw_panel<B: DrawingBackend>(
    cell: &DrawingArea<B, Shift>,
    panel: &Panel,
    row: &[Panel],
    labels: &[&str],
) -> Drawn<B> {
    let points = || row.iter().flat_map(|p| &p.curves).flat_map(|c| &c.points);
    let mut places: Vec<f64> = points().map(|(x, _)| *x).collect();
    places.sort_by(f64::total_cmp);
    places.dedup();
    let (Some(first), Some(last)) = (places.first(), places.last()) else {
        return Ok(());
    };
    // Half a bin of ten.
    let margin = ((last - first) / 18.0).max(0.05);
    let top = 1.05 * points().map(|(_, i)| i.high).fold(0.05, f64::max);
    let mut chart = ChartBuilder::on(cell)
        .caption(&panel.title, ("sans-serif", 15))
        .margin(8)
        .x_label_area_size(40)
        .y_label_area_size(54)
        .build_cartesian_2d(first - margin..last + margin, 0.0..top)?;
    chart
        .configure_mesh()
        .x_desc(&panel.x_title)
        .y_desc(&panel.y_title)
        .axis_desc_style(("sans-serif", 13))
        .label_style(("sans-serif", 12))
        .x_labels((places.len() + 1).min(MAX_LABELS))
        .x_label_formatter(&|x| ((100.0 * x).round() / 100.0 + 0.0).to_string())
        .y_labels(7)
        .light_line_style(TRANSPARENT)
        .bold_line_style(RGBColor(225, 225, 225))
        .draw()?;
    for (index, curve) in panel.curves.iter().enumerate() {
        let style = labels.iter().position(|label| *label == curve.label);
        let style = style.unwrap_or(0);
        let color = color(style);
        // Intervals are next to each other instead of on top of each other.
        let aside = (index as f64 - (panel.curves.len() as f64 - 1.0) / 2.0) * margin * 0.12;
        let at = |x: f64| x + aside;
        chart.draw_series(LineSeries::new(
            curve.points.iter().map(|(x, i)| (at(*x), i.estimate)),
            color.stroke_width(2),
        ))?;
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
    Ok(())
}

/// Returns the color of a place in the legend.
fn color(style: usize) -> RGBColor {
    let [_, red, green, blue] = PALETTE[style % PALETTE.len()].to_be_bytes();
    RGBColor(red, green, blue)
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

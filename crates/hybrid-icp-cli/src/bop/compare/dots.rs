//! Dot plots as SVG, for pages.

use hicp_experiments::html_escaped;
use hicp_picture::{AGAINST, RESULT, fitted};

/// Width of the plot, and the left and right ends of its scale, in pixels.
const WIDTH: u32 = 360;
const SCALE: (f64, f64) = (130.0, 300.0);
/// Size of the font, and the distance of two rows.
const FONT: i32 = 13;
const ROW: u32 = 22;

/// Draws a row with a dot for every name and value, the first in the color of the initial poses.
///
/// The scale is from 0 to `end`, or to the largest value without it.
pub(super) fn dot_plot(
    title: &str,
    rows: &[(&str, f64)],
    end: Option<f64>,
    digits: usize,
) -> String {
    let largest = rows.iter().map(|(_, value)| *value).fold(1e-9, f64::max);
    let (left, right) = SCALE;
    let to_column = (right - left) / end.unwrap_or(largest);
    let height = ROW * (u32::try_from(rows.len()).unwrap_or(0) + 1);
    let mut svg = format!(
        "<svg viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" font-size=\"{FONT}\" font-family=\"sans-serif\">\n\
         <text y=\"15\" font-weight=\"bold\">{title}</text>\n"
    );
    for (place, (name, value)) in (1..).zip(rows) {
        let middle = ROW * place + ROW / 2;
        let text = middle + 4;
        let name = html_escaped(&fitted(name, FONT, 120));
        let [r, g, b] = if place == 1 { AGAINST } else { RESULT }.color;
        let dot = left + to_column * value;
        svg += &format!(
            "<text y=\"{text}\">{name}</text>\
             <path d=\"M{left} {middle}H{right}\" stroke=\"#ccc\"/>\
             <circle cx=\"{dot:.1}\" cy=\"{middle}\" r=\"5\" fill=\"rgb({r},{g},{b})\"/>\
             <text x=\"{WIDTH}\" y=\"{text}\" text-anchor=\"end\">{value:.digits$}</text>\n"
        );
    }
    svg + "</svg>\n"
}

//! Parameters that several parts have.

use hicp_association::{Length, Stride};

use crate::build::Parameters;
use crate::error::PipelineError;
use crate::range::Range;

/// The tilt of a surface.
pub(super) const TILT: Range = Range::new(0.0, 90.0, "degrees");
/// The meaning of a largest tilt.
pub(super) const EDGE: &str = "a steeper surface is a depth edge";
/// A length whose unit another parameter states.
const OF_UNIT: Range = Range::positive("of `unit`");

/// Reads a length and its unit, each a parameter.
pub(super) fn length(
    p: &mut Parameters<'_>,
    name: &'static str,
    default: f64,
    meaning: &'static str,
) -> Result<Length, PipelineError> {
    let length = p.number(name, OF_UNIT, default, meaning)?;
    let units = [
        ("diameters", Length::Diameters as fn(f64) -> Length),
        ("meters", Length::Meters),
    ];
    let unit = p.word("unit", &units, "unit of the length")?;
    if matches!(unit(0.0), Length::Meters(_)) && !p.has(name) {
        return Err(p.refuse(name, "a length in `unit`".to_owned()));
    }
    Ok(unit(length))
}

/// Reads the spacing of a pixel grid: about so many points, or every so many pixels.
pub(super) fn stride(
    p: &mut Parameters<'_>,
    points: u32,
    meaning: &'static str,
) -> Result<Stride, PipelineError> {
    let points = p.count("points", 1, points, meaning)?;
    let pixels = p.count("pixels", 0, 0, "spacing of the grid instead, if not 0")?;
    if pixels > 0 && p.has("points") {
        return Err(p.refuse("points", "either points or pixels".to_owned()));
    }
    Ok(match pixels {
        0 => Stride::AboutPoints(points),
        _ => Stride::Pixels(pixels),
    })
}

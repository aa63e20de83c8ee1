//! The options of a search, from a file.

use std::time::Duration;

use hicp_icp::{Bound, Rotations, SearchOptions};

use super::error::PipelineError;
use super::reader::Reader;

/// Reads the options of a `hypothesis-search`.
pub(super) fn search_options(part: &Reader<'_>) -> Result<SearchOptions, PipelineError> {
    let bound = Bound {
        translation_meters: part.number("max_translation_meters")?,
        rotation_degrees: part.number("max_rotation_degrees")?,
    };
    let bounded = bound.translation_meters.is_finite() || bound.rotation_degrees.is_finite();
    let seconds = part.number("milliseconds")? / 1000.0;
    Ok(SearchOptions {
        threshold: part.number("threshold")?,
        good_enough: part.number("good_enough")?,
        min_gain: part.number("min_gain")?,
        rotations: match part.word("rotations")? {
            "view-axis" => Rotations::ViewAxis,
            "symmetry" => Rotations::Symmetry,
            _ => Rotations::Even,
        },
        hypotheses: part.count("hypotheses")? as usize,
        refined: part.count("refined")? as usize,
        spacing_degrees: part.number("spacing_degrees")?,
        bound: bounded.then_some(bound),
        // A time too long to be told is no limit.
        time_limit: Duration::try_from_secs_f64(seconds).ok(),
    })
}

//! Checks of an image with its mask and an initial pose.

use std::f64::consts::FRAC_PI_4;
use std::sync::Arc;

use hicp_core::internal::{bounds, median};
use hicp_core::{Model, Observation};

use crate::checks::camera::{touches_border, warning_of_center, was_cropped};
use crate::warning::Warning;

/// Largest factor between the measured depth and that of the initial pose.
const DEPTH_RATIO: f64 = 3.0;

/// Largest number of pixels of the mask, as a multiple of what the model can cover.
const MASK_RATIO: f64 = 10.0;

/// Largest number of pixels of the smallest side of the model's box, as a multiple of the mask's.
///
/// Up to 95 % of the object may be occluded. A unit that is wrong by a factor of 10 gives 100 times
/// as many pixels.
const SLIVER_RATIO: f64 = 20.0;

/// Returns the [`warnings`](crate::warnings) that depend on an image.
///
/// `distance` is z of the object's center in the camera frame, meters. Cost: O(pixels of the mask's
/// box) for the first time, then O(1), and O(vertices) if the mask is small for the object.
#[must_use]
pub fn warnings_of_image(model: &Model, observation: &Observation, distance: f64) -> Vec<Warning> {
    let camera = observation.camera();
    let Inside {
        pixels,
        median_depth,
    } = *Inside::of(observation);
    let is_crop = |warning: &Warning| match (warning, median_depth) {
        (Warning::Center { fault, .. }, Some(depth)) => {
            was_cropped(model, observation, depth, *fault)
        }
        _ => false,
    };
    let center = warning_of_center(camera).filter(|warning| !is_crop(warning));
    let mut warnings = Vec::from_iter(center);
    let no_depth = median_depth.is_none() && pixels > 0;
    warnings.extend(no_depth.then_some(Warning::NoDepth));
    warnings.extend(warning_of_distance(distance, median_depth));
    if !warnings.is_empty() || pixels == 0 {
        return warnings;
    }
    let diameter = model.diameter();
    // The pixels of a square meter at the distance.
    let density = camera.fx() * camera.fy() / distance.powi(2);
    // No silhouette of that diameter is larger than a disc.
    let at_most = FRAC_PI_4 * density * diameter.powi(2);
    if pixels as f64 > MASK_RATIO * at_most.max(1.0) {
        warnings.push(Warning::Mask {
            pixels,
            at_most,
            diameter,
            distance,
        });
    }
    let too_many = SLIVER_RATIO * pixels as f64;
    let widest = 2.0 * model.radius();
    if density * widest.powi(2) > too_many && !touches_border(observation) {
        let at_least = density * smallest_side(model);
        if at_least > too_many {
            warnings.push(Warning::Sliver {
                pixels,
                at_least,
                diameter,
                distance,
            });
        }
    }
    warnings
}

/// Checks the distance of the object at the initial pose against the depth inside the mask.
///
/// `distance` is z of the object's center in the camera frame, `median_depth` the median depth
/// inside the mask, both in meters. Returns [`Warning::BehindCamera`] or [`Warning::Depth`].
///
/// ```
/// use hybrid_icp::{Warning, checks::warning_of_distance};
/// assert_eq!(warning_of_distance(0.5, Some(0.6)), None);
/// assert!(matches!(warning_of_distance(-0.5, None), Some(Warning::BehindCamera { .. })));
/// assert!(matches!(warning_of_distance(5.0, Some(0.6)), Some(Warning::Depth { .. })));
/// ```
#[must_use]
pub fn warning_of_distance(distance: f64, median_depth: Option<f64>) -> Option<Warning> {
    if distance.is_nan() || distance <= 0.0 {
        return Some(Warning::BehindCamera { z: distance });
    }
    let plausible = distance / DEPTH_RATIO..=distance * DEPTH_RATIO;
    let measured = median_depth.filter(|measured| !plausible.contains(measured))?;
    Some(Warning::Depth {
        measured,
        expected: distance,
    })
}

/// Returns the area of the smallest side of the model's box along its axes, m²: 0 for a sheet.
fn smallest_side(model: &Model) -> f64 {
    let [low, high] = bounds(model.mesh().used_points()).unwrap_or_default();
    let mut sides: [f64; 3] = (high.cast::<f64>() - low.cast::<f64>()).into();
    sides.sort_by(f64::total_cmp);
    sides[0] * sides[1]
}

/// Returns the median of the depths measured inside the mask, meters.
///
/// Returns `None` if nothing was measured there. Cost: O(pixels of the mask's box), once per
/// observation.
#[must_use]
pub fn median_depth(observation: &Observation) -> Option<f64> {
    Inside::of(observation).median_depth
}

/// The pixels inside the mask of an observation.
struct Inside {
    /// Number of pixels.
    pixels: usize,
    /// Median of the measured depths, meters.
    median_depth: Option<f64>,
}

impl Inside {
    fn of(observation: &Observation) -> Arc<Self> {
        let (depth, mask) = (observation.depth(), observation.mask());
        observation.derived().get_or_build(0, || {
            let masked = observation.region().pixels();
            let masked = masked.filter(|(u, v)| mask.get(*u, *v) == Some(true));
            let depths: Vec<f32> = masked.filter_map(|(u, v)| depth.get(u, v)).collect();
            let mut measured = Vec::from_iter(depths.iter().copied().filter(|z| *z > 0.0));
            Self {
                pixels: depths.len(),
                median_depth: median(&mut measured, f32::total_cmp).map(f64::from),
            }
        })
    }
}

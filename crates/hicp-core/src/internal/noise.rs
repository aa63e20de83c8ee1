//! The noise of a depth image.

use crate::internal::median;
use crate::sensor::observation::Observation;

/// Returns the standard deviation of the depth noise inside the mask, meters.
///
/// It is computed from the median distance of about 500 pixels from the mean of their neighbors in
/// the row.
pub(crate) fn depth_noise(observation: &Observation) -> f64 {
    let region = observation.region();
    let (depth, mask) = (observation.depth(), observation.mask());
    let step = (region.area() / 512).isqrt().max(1);
    let mut differences: Vec<f32> = Vec::with_capacity(1024);
    for (u, v) in region.grid(step) {
        let at = |u: u32| match (mask.get(u, v), depth.get(u, v)) {
            (Some(true), Some(z)) if z > 0.0 => Some(z),
            _ => None,
        };
        let around = (at(u.wrapping_sub(1)), at(u), at(u + 1));
        if let (Some(left), Some(z), Some(right)) = around {
            differences.push((z - 0.5 * (left + right)).abs());
        }
    }
    let median = median(&mut differences, f32::total_cmp).unwrap_or(0.0);
    // Of independent errors, the distance is larger by √1.5, and the median is 0.6745 of them.
    f64::from(median) / (0.6745 * 1.5_f64.sqrt())
}

//! VSD by the rules of BOP'19: from renders of both poses and the test image.

use hicp_core::{DepthImage, DistanceImage, Isometry3, PinholeCamera, RenderedView};

use crate::errors::vsd::{ScoreError, check_size, visibility_masks, vsd};
use crate::tolerances::N_TOLERANCES;

/// Returns e_VSD(τ) for τ = 5 %, …, 50 % of the diameter with the visibility masks of BOP'19.
///
/// `test` is the measured depth. `estimate` and `truth` are renders of the object at both poses
/// with the camera of the test image. `diameter` and `delta`, the visibility tolerance, are in
/// meters. `delta` is [`VISIBILITY_TOLERANCE_METERS`](crate::VISIBILITY_TOLERANCE_METERS) for all
/// datasets except ITODD, where it is 0.005. If neither render shows a visible pixel, the result is
/// 1 for every τ.
///
/// Cost: O(pixels of the smallest rectangle around both renders), since neither pose can be visible
/// elsewhere.
///
/// # Errors
///
/// [`ScoreError`] if the test image does not have the camera's size, or if the diameter is not
/// finite and positive.
pub fn bop_vsd(
    test: &DepthImage,
    camera: &PinholeCamera,
    estimate: &RenderedView,
    truth: &RenderedView,
    diameter: f64,
    delta: f64,
) -> Result<[f64; N_TOLERANCES], ScoreError> {
    check_size("test image", test.size(), camera.size())?;
    let region = estimate.region().union(&truth.region());
    let region = region.intersection(&camera.region());
    let crop = |depth_at: &dyn Fn(u32, u32) -> f32| -> Result<DistanceImage, ScoreError> {
        let distances = region.pixels().map(|(u, v)| {
            let ratio = camera.distance_per_depth(f64::from(u), f64::from(v));
            f64::from(depth_at(u, v)) * ratio
        });
        let (width, height) = (region.u_max - region.u_min, region.v_max - region.v_min);
        Ok(DistanceImage::new(width, height, distances.collect())?)
    };
    let test = crop(&|u, v| test.get(u, v).unwrap_or(0.0))?;
    let estimate = crop(&|u, v| estimate.depth_at(u, v))?;
    let truth = crop(&|u, v| truth.depth_at(u, v))?;
    let (visible_estimate, visible_truth) = visibility_masks(&test, &estimate, &truth, delta)?;
    vsd(
        &estimate,
        &visible_estimate,
        &truth,
        &visible_truth,
        diameter,
    )
}

/// Returns whether spheres around the object's origin at two poses overlap in the image.
///
/// The spheres have the object's diameter, in meters. If they do not overlap, BOP sets every e_VSD
/// to 1 without rendering. If a pose is not in front of the camera, returns `false`.
#[must_use]
pub fn spheres_overlap(estimate: &Isometry3<f64>, truth: &Isometry3<f64>, diameter: f64) -> bool {
    let (a, b) = (&estimate.translation.vector, &truth.translation.vector);
    if !(a.z > 0.0 && b.z > 0.0) {
        return false;
    }
    let between = (a.xy() / a.z - b.xy() / b.z).norm();
    between < 0.5 * diameter * (1.0 / a.z + 1.0 / b.z)
}

//! Distances between model points at two poses.

use hicp_core::{Isometry3, Point3};

/// Returns ADD: the mean distance between corresponding model points at two poses, metres. 0 without points.
///
/// ADD = mean |T_est x − T_gt x| (facts of BOP). Cost: O(points).
#[must_use]
pub fn add(estimate: &Isometry3<f64>, truth: &Isometry3<f64>, points: &[Point3<f32>]) -> f64 {
    if points.is_empty() {
        return 0.0;
    }
    let sum: f64 = points
        .iter()
        .map(|p| {
            let p = p.cast::<f64>();
            (estimate * p - truth * p).norm()
        })
        .sum();
    sum / points.len() as f64
}

/// Returns ADI: the mean distance from a model point at the true pose to the *closest* model point at the estimate, metres.
///
/// ADI = mean over x of min over y |T_est y − T_gt x|; 0 without points. Never above ADD, and blind to symmetries.
/// Cost: O(points²), about a second for 30,000 points.
#[must_use]
pub fn adi(estimate: &Isometry3<f64>, truth: &Isometry3<f64>, points: &[Point3<f32>]) -> f64 {
    if points.is_empty() {
        return 0.0;
    }
    // Both sets relative to the estimate's frame, so that only one of them has to be moved.
    let estimate_from_truth = estimate.inverse() * truth;
    let sum: f64 = points
        .iter()
        .map(|x| {
            let x = (estimate_from_truth * x.cast::<f64>()).cast::<f32>();
            let nearest = points
                .iter()
                .map(|y| (x - y).norm_squared())
                .fold(f32::INFINITY, f32::min);
            f64::from(nearest).sqrt()
        })
        .sum();
    sum / points.len() as f64
}

//! Visible Surface Discrepancy, and the errors of invalid inputs.

use hicp_core::{Context, DistanceImage, Isometry3, Mask, Problem, RenderedView};
use thiserror::Error;

use crate::score::Score;
use crate::tolerances::{AgreementCounts, N_TOLERANCES, mean};

/// The reason why inputs have no score.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum ScoreError {
    /// The sizes of images differ.
    #[error("{what} is {}x{}, expected {}x{}", found.0, found.1, expected.0, expected.1)]
    Size {
        /// Name of the image.
        what: &'static str,
        /// The width and height found.
        found: (u32, u32),
        /// The width and height of the other images.
        expected: (u32, u32),
    },
    /// A diameter is not finite and positive.
    #[error("diameter is {value}, expected a finite number above 0")]
    Diameter {
        /// The value found.
        value: f64,
    },
    /// An image is invalid.
    #[error(transparent)]
    Image(#[from] hicp_core::ImageError),
}

/// Returns an error if a side does not have the expected size.
pub(crate) fn check_size(
    what: &'static str,
    found: (u32, u32),
    expected: (u32, u32),
) -> Result<(), ScoreError> {
    match found == expected {
        true => Ok(()),
        false => Err(ScoreError::Size {
            what,
            found,
            expected,
        }),
    }
}

/// Returns e_VSD(τ) of Eq. 1 for τ = 5 %, …, 50 % of the diameter.
///
/// The inputs are distance maps and visibility masks. A pixel of the union of the masks costs 0 if
/// it is in both and the distances differ by strictly less than τ, otherwise 1. e is the mean cost.
/// An empty union gives 1. Distances and diameter may have any common unit. The result does not
/// change if the two sides are swapped. Cost: O(pixels).
///
/// # Errors
///
/// [`ScoreError`] if the images differ in size, or if the diameter is not finite and positive.
pub fn vsd(
    estimate: &DistanceImage,
    estimate_mask: &Mask,
    truth: &DistanceImage,
    truth_mask: &Mask,
    diameter: f64,
) -> Result<[f64; N_TOLERANCES], ScoreError> {
    if !(diameter.is_finite() && diameter > 0.0) {
        return Err(ScoreError::Diameter { value: diameter });
    }
    let expected = estimate.size();
    check_size("mask of the estimate", estimate_mask.size(), expected)?;
    check_size("true distance image", truth.size(), expected)?;
    check_size("true mask", truth_mask.size(), expected)?;
    let mut counts = AgreementCounts::new(diameter);
    let mut union = 0;
    let estimates = estimate.pixels().iter().zip(estimate_mask.pixels());
    let truths = truth.pixels().iter().zip(truth_mask.pixels());
    for ((d_estimate, in_estimate), (d_truth, in_truth)) in estimates.zip(truths) {
        if *in_estimate || *in_truth {
            union += 1;
        }
        if *in_estimate && *in_truth {
            counts.add((d_estimate - d_truth).abs());
        }
    }
    Ok(counts.errors(union))
}

/// Returns BOP'19's visibility masks (V_est, V_gt) from distances.
///
/// The inputs are the distances of the test image and of the two renders, in one unit, where 0
/// means that nothing is visible. V_gt contains the pixels where the true surface is at most δ
/// behind the measured one, or where nothing was measured. V_est is computed likewise, and also
/// contains the pixels of V_gt where the estimate is visible.
///
/// # Errors
///
/// [`ScoreError`] if the images differ in size.
pub fn visibility_masks(
    test: &DistanceImage,
    estimate: &DistanceImage,
    truth: &DistanceImage,
    delta: f64,
) -> Result<(Mask, Mask), ScoreError> {
    let expected = test.size();
    check_size("estimated distance image", estimate.size(), expected)?;
    check_size("true distance image", truth.size(), expected)?;
    let visible =
        |model: f64, test: f64| model > 0.0 && (test == 0.0 || in_front(model, test, delta));
    let mut truth_mask = Vec::with_capacity(test.pixels().len());
    let mut estimate_mask = Vec::with_capacity(test.pixels().len());
    let renders = estimate.pixels().iter().zip(truth.pixels());
    for (d_test, (d_estimate, d_truth)) in test.pixels().iter().zip(renders) {
        let v_truth = visible(*d_truth, *d_test);
        truth_mask.push(v_truth);
        estimate_mask.push(visible(*d_estimate, *d_test) || (v_truth && *d_estimate > 0.0));
    }
    let (width, height) = expected;
    // The vectors were filled from images of this size, so this does not fail.
    Ok((
        Mask::new(width, height, estimate_mask)?,
        Mask::new(width, height, truth_mask)?,
    ))
}

/// Compares in single precision, like the reference, to decide ties in the same way.
#[allow(clippy::cast_possible_truncation)]
fn in_front(model: f64, test: f64, delta: f64) -> bool {
    f64::from(model as f32 - test as f32) <= delta
}

/// Mean VSD against a known true pose, over τ = 5 %…50 % of the diameter.
///
/// It is the evaluation metric of §VI-A.2. Both poses are rendered. The visibility masks are the
/// silhouettes, as for an object that nothing occludes. If neither pose shows anything, the score
/// is 1. Cost: two renders (one if the cache holds the true pose) and O(rendered pixels).
#[derive(Clone, Debug)]
pub struct Vsd {
    truth: Isometry3<f64>,
    scratch: RenderedView,
}

impl Vsd {
    /// Creates the score from a true pose, `camera_from_object`.
    #[must_use]
    pub fn new(truth: Isometry3<f64>) -> Self {
        Self {
            truth,
            scratch: RenderedView::default(),
        }
    }

    /// The true pose, `camera_from_object`.
    #[must_use]
    pub fn truth(&self) -> &Isometry3<f64> {
        &self.truth
    }

    /// Returns e(τ) for every tolerance at the pose `camera_from_object`.
    pub fn errors(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
    ) -> [f64; N_TOLERANCES] {
        let problem = context.problem;
        let Some((model, observation)) = problem.sides() else {
            return [1.0; N_TOLERANCES];
        };
        let camera = observation.camera();
        // The cache returns one view at a time, so copy that of the true pose.
        if let Some(truth) = context.view(&self.truth) {
            self.scratch.copy_from(truth);
        }
        let truth = &self.scratch;
        let Some(estimate) = context.view(camera_from_object) else {
            return [1.0; N_TOLERANCES];
        };
        let mut union = truth.n_rendered() as u64;
        let mut counts = AgreementCounts::new(model.diameter());
        let region = estimate.region();
        let rows = estimate.depth().chunks_exact(region.width().max(1));
        for (v, row) in (region.v_min..region.v_max).zip(rows) {
            for (u, &z) in (region.u_min..region.u_max).zip(row) {
                if z <= 0.0 {
                    continue;
                }
                let z_true = truth.depth_at(u, v);
                if z_true > 0.0 {
                    let difference = (f64::from(z) - f64::from(z_true)).abs();
                    let ratio = camera.distance_per_depth(f64::from(u), f64::from(v));
                    counts.add(difference * ratio);
                } else {
                    union += 1;
                }
            }
        }
        counts.errors(union)
    }
}

impl Score for Vsd {
    fn score(&mut self, context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> f64 {
        mean(&self.errors(context, camera_from_object))
    }

    fn name(&self) -> &'static str {
        "vsd"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        problem.without_mesh_or_image(self.name())
    }
}

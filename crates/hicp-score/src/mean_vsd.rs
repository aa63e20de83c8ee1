//! The mean VSD estimate.

use hicp_core::internal::vectorized;
use hicp_core::{Context, Isometry3};

use crate::agreement::{Agreement, Row};
use crate::occlusion::Occlusion;
use crate::score::Score;
use crate::tolerances::{N_TOLERANCES, errors, mean};

/// The mean VSD estimate (MVE) of §IV-A: VSD against the measured distances and the mask.
///
/// It is the mean over τ = 5 %…50 % of the diameter. It is 0 if the render of the pose equals the
/// image, and 1 if nothing agrees or nothing is visible. It does not need ground truth, so it
/// scores a pose against the live image and serves as a measure of uncertainty.
///
/// Masked pixels without depth count in neither mask. They contain no evidence about the pose, and
/// would raise the score of every image with holes. An empty union is 1.
///
/// Cost: one render (shared with other components that use this pose) and O(rendered pixels).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MeanVsd {
    /// The rendered pixels outside the mask that count against the pose.
    pub occlusion: Occlusion,
}

// Deviation: masked pixels without depth count in neither mask; the paper's images have none.
impl MeanVsd {
    /// Creates the definition of §IV-A: every rendered pixel counts.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            occlusion: Occlusion::Counted,
        }
    }

    /// Creates the score for masks that miss a part of the object.
    ///
    /// It uses [`Occlusion::Lenient`] with BOP's tolerance.
    #[must_use]
    pub fn lenient() -> Self {
        Self {
            occlusion: Occlusion::LENIENT,
        }
    }

    /// Returns e(τ) for every tolerance at the pose `camera_from_object`.
    pub fn errors(
        &self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
    ) -> [f64; N_TOLERANCES] {
        let problem = context.problem;
        let (Some((model, observation)), Some(view)) =
            (problem.sides(), context.view(camera_from_object))
        else {
            return [1.0; N_TOLERANCES];
        };
        let (camera, depth, mask) = (
            observation.camera(),
            observation.depth().pixels(),
            observation.mask().pixels(),
        );
        let image_width = observation.depth().width() as usize;
        let region = view.region();
        let rendered = view.depth().chunks_exact(region.width().max(1));
        let inverse_fy = 1.0 / camera.fy();
        let rows = (region.v_min..region.v_max)
            .zip(rendered)
            .map(|(v, rendered)| {
                let start = v as usize * image_width + region.u_min as usize;
                let columns = start..start + rendered.len();
                Row {
                    rendered,
                    observed: &depth[columns.clone()],
                    masked: &mask[columns],
                    u: region.u_min,
                    y: (f64::from(v) - camera.cy()) * inverse_fy,
                }
            });
        let found = vectorized(Agreement {
            rows,
            cx: camera.cx(),
            inverse_fx: 1.0 / camera.fx(),
            diameter: model.diameter(),
            hidden_beyond: self.occlusion.least_distance_behind(),
        });
        errors(
            found.correct,
            observation.n_measured() as u64 + found.outside,
        )
    }
}

impl Score for MeanVsd {
    fn score(&mut self, context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> f64 {
        mean(&self.errors(context, camera_from_object))
    }

    fn name(&self) -> &'static str {
        "mve"
    }
}

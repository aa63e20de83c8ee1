//! The mean VSD estimate.

use hicp_core::internal::vectorized;
use hicp_core::{Context, Isometry3};

use crate::agreement::{Agreement, Row};
use crate::score::Score;
use crate::tolerances::{N_TOLERANCES, errors, mean};

/// The mean VSD estimate (MVE) of §IV-A: VSD with the measured distances and the segmentation mask in the place of the true ones.
///
/// The mean over τ = 5 %…50 % of the diameter; 0 for a pose whose render is the image, 1 when nothing agrees or nothing is
/// seen. It needs no ground truth: it is the score of a pose against the live image, and an uncertainty proxy.
///
/// Masked pixels without depth count in neither mask; they say nothing about the pose, and would put a floor under the
/// score of every image with holes. An empty union is 1.
///
/// Cost: one render (shared with whoever else looks at this pose) and O(rendered pixels).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeanVsd {
    /// When set, rendered pixels outside the mask that something observed hides by more than this many metres are not
    /// counted against the pose (BOP's δ is 0.015). `None` is the paper's definition: everything rendered counts.
    ///
    /// Below 0 it is lenient with the mask: what was observed may also lie that far *behind* the rendered surface, as it does where
    /// the mask has missed a part of the object. Outside the mask only what the camera sees through by more than that, or did
    /// not measure, counts against the pose then.
    pub occlusion_tolerance: Option<f64>,
}

/// BOP's visibility tolerance δ, metres, for every dataset but ITODD.
pub const VISIBILITY_TOLERANCE_METERS: f64 = 0.015;

// Deviation: masked pixels without depth count in neither mask; the paper's images have none.
impl MeanVsd {
    /// The definition of §IV-A: everything rendered counts.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            occlusion_tolerance: None,
        }
    }

    /// Lenient with masks that miss a part of the object: BOP's tolerance, below 0.
    #[must_use]
    pub fn lenient() -> Self {
        Self {
            occlusion_tolerance: Some(-VISIBILITY_TOLERANCE_METERS),
        }
    }

    /// Returns e(τ) for every tolerance.
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
            occlusion_tolerance: self.occlusion_tolerance.unwrap_or(f64::INFINITY),
        });
        errors(
            found.correct,
            observation.n_measured() as u64 + found.outside,
        )
    }
}

impl Default for MeanVsd {
    /// Occlusion is recognised with BOP's tolerance.
    fn default() -> Self {
        Self {
            occlusion_tolerance: Some(VISIBILITY_TOLERANCE_METERS),
        }
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

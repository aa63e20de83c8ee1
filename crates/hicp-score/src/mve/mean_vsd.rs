//! The mean VSD estimate.

use hicp_core::internal::vectorized;
use hicp_core::{Context, Isometry3, Observation, Problem, RenderedView};

use crate::judgment::grid::Grid;
use crate::judgment::insides::inside_share;
use crate::mve::agreement::{Agreement, Found, Row, Weights};
use crate::mve::mask_trust::MaskTrust;
use crate::mve::occlusion::Occlusion;
use crate::mve::trust_map::TrustMap;
use crate::score::Score;
use crate::tolerances::{N_TOLERANCES, errors, mean};

/// The mean VSD estimate (MVE) of §IV-A: VSD against the measured distances and the mask.
///
/// It is the mean over τ = 5 %…50 % of the diameter. It is 0 if the render of the pose equals the
/// image, and 1 if nothing agrees or nothing is visible. It does not need ground truth, so it
/// scores a pose against the live image and serves as a measure of uncertainty.
///
/// The default does not count rendered pixels outside the mask that a nearer surface hides
/// ([`Occlusion::Tolerated`]). [`MeanVsd::paper`] is the definition of §IV-A, which counts them.
/// [`MeanVsd::imperfect_mask`] suits the masks of detectors.
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
    /// The trust in the mask.
    ///
    /// With [`MaskTrust::Imperfect`], `occlusion` has no effect.
    pub mask: MaskTrust,
}

/// Share of the pixels from which on those behind a measured surface are examined.
const LEAST_NEARER: f64 = 0.02;

// Deviation: masked pixels without depth: §IV-A.2 does not mention them, and the paper's images
// have none. Here they count in neither mask, because they are no evidence about the pose.
impl MeanVsd {
    /// Creates the definition of §IV-A: every rendered pixel counts.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            occlusion: Occlusion::Counted,
            ..Self::default()
        }
    }

    /// Creates the score for masks that miss a part of the object.
    ///
    /// It uses [`Occlusion::Lenient`] with BOP's tolerance.
    #[must_use]
    pub fn lenient() -> Self {
        Self {
            occlusion: Occlusion::LENIENT,
            ..Self::default()
        }
    }

    /// Creates the score for the masks of detectors ([`MaskTrust::Imperfect`]).
    #[must_use]
    pub fn imperfect_mask() -> Self {
        Self {
            mask: MaskTrust::Imperfect,
            ..Self::default()
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
        let compared = Compared {
            observation,
            view,
            diameter: model.diameter(),
        };
        match self.mask {
            MaskTrust::Exact => {
                let rows = compared.rows().map(|(_, row)| row);
                let found = compared.count(rows, self.occlusion.least_distance_behind());
                let union = observation.n_measured() as u64 + found.outside;
                errors(found.correct, union)
            }
            MaskTrust::Imperfect => {
                compared.imperfect(&TrustMap::of(observation, model.diameter()))
            }
        }
    }
}

/// A render and an observation.
struct Compared<'a> {
    observation: &'a Observation,
    view: &'a RenderedView,
    diameter: f64,
}

impl Compared<'_> {
    /// Returns the rows of the rendered region with their indices and the mask as it is.
    fn rows(&self) -> impl Iterator<Item = (u32, Row<'_, &[bool]>)> {
        let (camera, region) = (self.observation.camera(), self.view.region());
        let depth = self.observation.depth().pixels();
        let mask = self.observation.mask().pixels();
        let image_width = camera.width() as usize;
        let inverse_fy = 1.0 / camera.fy();
        let rendered = self.view.depth().chunks_exact(region.width().max(1));
        (region.v_min..region.v_max)
            .zip(rendered)
            .map(move |(v, rendered)| {
                let start = v as usize * image_width + region.u_min as usize;
                let columns = start..start + rendered.len();
                let row = Row {
                    rendered,
                    observed: &depth[columns.clone()],
                    mask: &mask[columns],
                    u: region.u_min,
                    y: (f64::from(v) - camera.cy()) * inverse_fy,
                };
                (v, row)
            })
    }

    /// Counts the pixels of some rows.
    fn count<'b, W: Weights + 'b>(
        &self,
        rows: impl Iterator<Item = Row<'b, W>>,
        hidden_beyond: f64,
    ) -> Found {
        let camera = self.observation.camera();
        vectorized(Agreement {
            rows,
            cx: camera.cx(),
            inverse_fx: 1.0 / camera.fx(),
            diameter: self.diameter,
            hidden_beyond,
        })
    }

    /// Returns e(τ) with an imperfect mask.
    fn imperfect(&self, trust: &TrustMap) -> [f64; N_TOLERANCES] {
        if trust.total() == 0 {
            return [1.0; N_TOLERANCES];
        }
        let rows = self.rows().flat_map(|(v, row)| {
            let parts = trust.parts(v, row.u, row.rendered.len());
            parts.map(move |(columns, weights)| row.part(columns, weights))
        });
        let found = self.count(rows, trust.seen_through_meters());
        // A pixel behind a measured surface counts if the object reaches into that surface.
        let share = if found.nearer as f64 > LEAST_NEARER * (found.covered + found.nearer) as f64 {
            let mut grid = Grid::new(self.diameter);
            grid.compare(self.observation, self.view);
            inside_share(&mut grid)
        } else {
            0.0
        };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // A share of a count.
        let inside = (found.nearer as f64 * share) as u64;
        let union = trust.total() + found.outside + inside + trust.uncovered(self.view);
        errors(found.correct, union)
    }
}

impl Score for MeanVsd {
    fn score(&mut self, context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> f64 {
        mean(&self.errors(context, camera_from_object))
    }

    fn name(&self) -> &'static str {
        "mve"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        problem.without_mesh_or_image(self.name())
    }
}

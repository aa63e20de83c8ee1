//! The probability that a pose is wrong, as a score.

use hicp_core::{Context, Isometry3, Problem};

use crate::judgment::confidence::Confidence;
use crate::mve::mean_vsd::MeanVsd;
use crate::score::Score;

/// Scores a pose by the probability that it is wrong: 1 minus its [`Confidence`], as if no other
/// pose looked alike.
///
/// It accounts for noise, hidden parts and imperfect masks, which raise the MVE of right poses. Use
/// it to decide whether a pose is good enough. It is not smooth, and most wrong poses have a score
/// near 1, so it neither ranks hypotheses nor guides a descent. Cost: as [`MeanVsd`], and about 40
/// µs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Doubt;

impl Score for Doubt {
    fn score(&mut self, context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> f64 {
        let mve = MeanVsd::default().score(context, camera_from_object);
        let (_, confidence) = Confidence::at(context, camera_from_object, mve, 0.0);
        1.0 - confidence.probability
    }

    fn name(&self) -> &'static str {
        "doubt"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        problem.without_mesh_or_image(self.name())
    }
}

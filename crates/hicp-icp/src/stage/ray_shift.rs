//! The baseline that moves an object along its viewing ray.

use hicp_core::internal::median;
use hicp_core::{Isometry3, Problem, Translation3};

use crate::outcome::{Outcome, Termination};
use crate::session::Session;
use crate::stage::stage_trait::Stage;

/// Moves the model along the ray to its center by the median difference between measured and
/// rendered depth.
///
/// It is the first thing that practitioners try, so comparisons include it. It keeps the rotation.
/// Pixels of the mask that the model covers count. Without any, the initial pose is kept.
///
/// Cost: two renders and O(rendered pixels).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RayShift {
    /// Measured minus rendered depth of the common pixels, meters.
    differences: Vec<f64>,
}

/// Number of renders, each followed by a shift.
const PASSES: usize = 2;

impl Stage for RayShift {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        if let Some(part) = problem.without_mesh_or_image(self.name()) {
            return Outcome::kept(init, Termination::Unsupported(part));
        }
        let mut outcome = Outcome::kept(init, Termination::NoPairs);
        let Some((model, observation)) = problem.sides() else {
            return outcome;
        };
        for _ in 0..PASSES {
            let pose = outcome.camera_from_object;
            let mut context = session.workspace.context(problem);
            let Some(view) = context.view(&pose) else {
                break;
            };
            let region = view.region().intersection(&observation.region());
            let (depth, mask) = (observation.depth(), observation.mask());
            self.differences.clear();
            self.differences
                .extend(region.pixels().filter_map(|(u, v)| {
                    let rendered = view.depth_at(u, v);
                    let measured = depth.get(u, v).filter(|_| mask.get(u, v) == Some(true));
                    let measured = measured.filter(|z| *z > 0.0 && rendered > 0.0);
                    measured.map(|z| f64::from(z) - f64::from(rendered))
                }));
            let center = (pose * model.center()).coords;
            let middle = median(&mut self.differences, f64::total_cmp);
            let Some(middle) = middle.filter(|_| center.z > 0.0) else {
                break;
            };
            let shift = Translation3::from(center * (middle / center.z));
            outcome = Outcome::refined(shift * pose, Termination::Converged);
        }
        outcome
    }

    fn name(&self) -> &'static str {
        "ray-shift"
    }
}

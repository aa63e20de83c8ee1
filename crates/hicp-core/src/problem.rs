//! What is registered to what, and what components may ask for.

use nalgebra::Isometry3;

use crate::model::Model;
use crate::observation::Observation;
use crate::render::{RenderCache, RenderedView};

/// The two sides of a registration: the model (source, moves) and the observation (target, stands still).
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// The object.
    pub model: &'a Model,
    /// The segmented depth image.
    pub observation: &'a Observation,
}

impl<'a> Problem<'a> {
    /// Pairs a model with an observation.
    #[must_use]
    pub fn new(model: &'a Model, observation: &'a Observation) -> Self {
        Self { model, observation }
    }
}

/// What a component sees while it works: the problem, and the render cache of the run.
///
/// Selections, associations, scores and switchers get one. Copy `context.problem` out before borrowing a view, then both
/// are at hand:
///
/// ```
/// use hicp_core::{Context, Isometry3};
/// fn visible_pixels(context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> usize {
///     context.view(camera_from_object).n_rendered()
/// }
/// ```
#[derive(Debug)]
pub struct Context<'a> {
    /// The model and the observation.
    pub problem: Problem<'a>,
    renders: &'a mut RenderCache,
}

impl<'a> Context<'a> {
    /// Puts a problem and a render cache together.
    #[must_use]
    pub fn new(problem: Problem<'a>, renders: &'a mut RenderCache) -> Self {
        Self { problem, renders }
    }

    /// Returns the model rendered at a pose in the observation's camera; rendered at most once per pose while it is remembered.
    pub fn view(&mut self, camera_from_object: &Isometry3<f64>) -> &RenderedView {
        self.renders.view(
            self.problem.model,
            self.problem.observation.camera(),
            camera_from_object,
        )
    }
}

//! The two sides of a registration, and the context that components receive.

use nalgebra::Isometry3;

use crate::object::model::Model;
use crate::render::{RenderCache, RenderedView};
use crate::sensor::observation::Observation;

/// The two sides of a registration: the model (source, moves) and the observation (target, stands
/// still).
///
/// Either side may be absent. [`Problem::default`] has neither and serves pairs that come from
/// elsewhere. If a component needs a side that is absent, it returns no pairs, no points or no
/// agreement; it never guesses. The sides are methods, so that later kinds of source and target
/// (point clouds, color) do not change this type.
#[derive(Clone, Copy, Debug, Default)]
pub struct Problem<'a> {
    model: Option<&'a Model>,
    observation: Option<&'a Observation>,
}

impl<'a> Problem<'a> {
    /// Combines a model with an observation.
    #[must_use]
    pub fn new(model: &'a Model, observation: &'a Observation) -> Self {
        Self {
            model: Some(model),
            observation: Some(observation),
        }
    }

    /// Returns the object, if the source is a model.
    #[must_use]
    #[inline]
    pub fn model(&self) -> Option<&'a Model> {
        self.model
    }

    /// Returns the segmented depth image, if the target is one.
    #[must_use]
    #[inline]
    pub fn observation(&self) -> Option<&'a Observation> {
        self.observation
    }

    /// Returns both sides, if the problem is a model and a depth image.
    #[must_use]
    #[inline]
    pub fn sides(&self) -> Option<(&'a Model, &'a Observation)> {
        Some((self.model?, self.observation?))
    }
}

/// One iteration of a stage, as filters, metrics and stop rules receive it.
///
/// Components are pure: equal iterations and equal pairs give equal results, whatever ran before.
/// If a stage returns to an earlier pose after a rejected one, it passes that pose's iteration
/// again.
///
/// [`Iteration::default`] is the first iteration of a stage that starts at the identity, without a
/// problem. It serves pairs that come from elsewhere.
#[derive(Clone, Copy, Debug, Default)]
#[non_exhaustive]
pub struct Iteration<'a> {
    /// Index within the stage, from 0.
    pub index: usize,
    /// The initial pose of the stage: `camera_from_object`.
    pub init: Isometry3<f64>,
    /// The model and the observation.
    pub problem: Problem<'a>,
}

impl<'a> Iteration<'a> {
    /// Creates the iteration `index` of a stage that started from `init`.
    #[must_use]
    pub fn new(index: usize, init: &Isometry3<f64>, problem: Problem<'a>) -> Self {
        Self {
            index,
            init: *init,
            problem,
        }
    }
}

/// The problem and the render cache of the run.
///
/// Selections, associations, scores and switchers receive it.
///
/// Copy `context.problem` before borrowing a view to use both:
///
/// ```
/// use hicp_core::{Context, Isometry3};
/// fn visible_pixels(context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> usize {
///     context.view(camera_from_object).map_or(0, |view| view.n_rendered())
/// }
/// ```
#[derive(Debug)]
pub struct Context<'a> {
    /// The model and the observation.
    pub problem: Problem<'a>,
    renders: &'a mut RenderCache,
}

impl<'a> Context<'a> {
    /// Combines a problem and a render cache.
    #[must_use]
    pub fn new(problem: Problem<'a>, renders: &'a mut RenderCache) -> Self {
        Self { problem, renders }
    }

    /// Returns the model rendered at a pose, `camera_from_object`, in the observation's camera.
    ///
    /// If the cache holds the pose, nothing is rendered. Returns `None` if the problem has no model
    /// or no depth image.
    pub fn view(&mut self, camera_from_object: &Isometry3<f64>) -> Option<&RenderedView> {
        let (model, observation) = self.problem.sides()?;
        let camera = observation.camera();
        Some(self.renders.view(model, camera, camera_from_object))
    }
}

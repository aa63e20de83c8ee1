//! The two sides of a registration, and the context that components receive.

use nalgebra::Isometry3;

use crate::model::Model;
use crate::observation::Observation;
use crate::render::{RenderCache, RenderedView};

/// The two sides of a registration: the model (source, moves) and the observation (target, stands still).
///
/// Either side may be absent: [`Problem::default`] has neither and serves pairs that come from elsewhere. A component
/// that needs a side does without pairs, points or agreement where it is absent; it never guesses. The sides are
/// methods, so that later kinds of source and target (point clouds, color) do not change this type.
#[derive(Clone, Copy, Debug, Default)]
pub struct Problem<'a> {
    model: Option<&'a Model>,
    observation: Option<&'a Observation>,
}

impl<'a> Problem<'a> {
    /// Pairs a model with an observation.
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

/// One iteration of a stage, as filters, metrics and stop rules see it.
///
/// Components are pure: equal iterations and equal pairs give equal results, whichever iteration came before. A stage
/// that returns to an earlier pose after a rejected one passes that pose's iteration again.
///
/// [`Iteration::default`] is the first iteration of a stage that starts at the identity, without a problem: for pairs
/// that come from elsewhere.
#[derive(Clone, Copy, Debug, Default)]
#[non_exhaustive]
pub struct Iteration<'a> {
    /// Index within the stage, from 0.
    pub index: usize,
    /// The pose that the stage started from: `camera_from_object`.
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

/// The problem and the render cache of the run: what selections, associations, scores and switchers receive.
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

    /// Returns the model rendered at a pose in the observation's camera.
    ///
    /// Renders at most once per pose while the cache holds it. Returns `None` if the problem has no model to render or no
    /// camera to render it for.
    pub fn view(&mut self, camera_from_object: &Isometry3<f64>) -> Option<&RenderedView> {
        let (model, observation) = self.problem.sides()?;
        let camera = observation.camera();
        Some(self.renders.view(model, camera, camera_from_object))
    }
}

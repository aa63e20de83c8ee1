//! The two sides of a registration, and the context that components receive.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3};

use crate::cloud::Cloud;
use crate::derived::Derived;
use crate::object::mesh::TriMesh;
use crate::object::model::Model;
use crate::render::{RenderCache, RenderedView};
use crate::sensor::observation::Observation;
use crate::surfel::Surfel;

/// The side of a registration that moves.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Source<'a> {
    /// A mesh with its samples, in the object frame.
    Model(&'a Model),
    /// A point cloud, in its own frame.
    Cloud(&'a Cloud),
}

impl<'a> Source<'a> {
    /// The samples of a model, or the points of a cloud.
    #[must_use]
    pub fn surfels(&self) -> &'a [Surfel] {
        match self {
            Self::Model(model) => model.samples(),
            Self::Cloud(cloud) => cloud.surfels(),
        }
    }

    /// The diameter of the model or the cloud, meters.
    #[must_use]
    pub fn diameter(&self) -> f64 {
        match self {
            Self::Model(model) => model.diameter(),
            Self::Cloud(cloud) => cloud.diameter(),
        }
    }

    /// The center of the model's bounding box, or the mean of a cloud's points, meters.
    #[must_use]
    pub fn center(&self) -> Point3<f64> {
        match self {
            Self::Model(model) => model.center(),
            Self::Cloud(cloud) => cloud.center(),
        }
    }

    /// Values derived from the model or the cloud.
    #[must_use]
    pub fn derived(&self) -> &'a Derived {
        match self {
            Self::Model(model) => model.derived(),
            Self::Cloud(cloud) => cloud.derived(),
        }
    }
}

/// The side of a registration that stands still.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Target<'a> {
    /// A segmented depth image.
    Observation(&'a Observation),
    /// A point cloud.
    Cloud(&'a Cloud),
}

impl<'a> Target<'a> {
    /// Number of surfels.
    #[must_use]
    pub fn n_surfels(&self) -> usize {
        match self {
            Self::Observation(observation) => observation.n_surfels(),
            Self::Cloud(cloud) => cloud.surfels().len(),
        }
    }

    /// Returns the surfels on a pixel grid, or every `stride`²-th point of a cloud, with their
    /// indices.
    ///
    /// Both are 1/`stride`² of all. A stride of 0 counts as 1.
    #[must_use]
    pub fn surfels(&self, stride: u32) -> Vec<(u32, Surfel)> {
        match self {
            Self::Observation(observation) => observation
                .surfels(stride)
                .map(|(index, surfel)| (index, *surfel))
                .collect(),
            Self::Cloud(cloud) => {
                let step = (stride.max(1) as usize).saturating_pow(2);
                (0..)
                    .zip(cloud.surfels().iter().copied())
                    .step_by(step)
                    .collect()
            }
        }
    }

    /// Values derived from the observation or the cloud.
    #[must_use]
    pub fn derived(&self) -> &'a Derived {
        match self {
            Self::Observation(observation) => observation.derived(),
            Self::Cloud(cloud) => cloud.derived(),
        }
    }
}

macro_rules! from {
    ($($side:ident::$kind:ident),+) => {$(
        impl<'a> From<&'a $kind> for $side<'a> {
            fn from(side: &'a $kind) -> Self {
                Self::$kind(side)
            }
        }

        impl<'a> From<&'a Arc<$kind>> for $side<'a> {
            fn from(side: &'a Arc<$kind>) -> Self {
                Self::$kind(side)
            }
        }
    )+};
}
from!(
    Source::Model,
    Source::Cloud,
    Target::Observation,
    Target::Cloud
);

/// The two sides of a registration: the source, which moves, and the target, which stands still.
///
/// The source is a model or a cloud, and the target an observation or a cloud. A pose takes
/// coordinates of the source to those of the target. Names call it `camera_from_object`, after the
/// paper; between two clouds, it is `target_from_source`.
///
/// Either side may be absent. [`Problem::default`] has neither and serves pairs that come from
/// elsewhere. If a component needs a side or an image that is absent, it returns no pairs, no
/// points or no agreement; it never guesses. Components that can work on some problems only name
/// themselves in their method `unsupported`, and stages end with that name before they run.
#[derive(Clone, Copy, Debug, Default)]
pub struct Problem<'a> {
    source: Option<Source<'a>>,
    target: Option<Target<'a>>,
}

impl<'a> Problem<'a> {
    /// Combines a model or a cloud with an observation or a cloud.
    #[must_use]
    pub fn new(source: impl Into<Source<'a>>, target: impl Into<Target<'a>>) -> Self {
        Self {
            source: Some(source.into()),
            target: Some(target.into()),
        }
    }

    /// Returns the side that moves.
    #[must_use]
    #[inline]
    pub fn source(&self) -> Option<Source<'a>> {
        self.source
    }

    /// Returns the side that stands still.
    #[must_use]
    #[inline]
    pub fn target(&self) -> Option<Target<'a>> {
        self.target
    }

    /// Returns the object, if the source is a model.
    #[must_use]
    #[inline]
    pub fn model(&self) -> Option<&'a Model> {
        match self.source? {
            Source::Model(model) => Some(model),
            Source::Cloud(_) => None,
        }
    }

    /// Returns the segmented depth image, if the target is one.
    #[must_use]
    #[inline]
    pub fn observation(&self) -> Option<&'a Observation> {
        match self.target? {
            Target::Observation(observation) => Some(observation),
            Target::Cloud(_) => None,
        }
    }

    /// Returns both sides, if the problem is a model and a depth image.
    #[must_use]
    #[inline]
    pub fn sides(&self) -> Option<(&'a Model, &'a Observation)> {
        Some((self.model()?, self.observation()?))
    }

    /// Returns the mesh that is rendered, or `None` if the source is not a model.
    ///
    /// It is that of [`Model::drawn`]. If both the image and the mesh have colors, it is the mesh
    /// itself, because a simplified mesh has no colors.
    #[must_use]
    #[inline]
    pub fn drawn(&self) -> Option<&'a TriMesh> {
        let model = self.model()?;
        let colored = self
            .observation()
            .is_some_and(|seen| seen.color().is_some());
        if colored && model.mesh().color().is_some() {
            return Some(model.mesh());
        }
        Some(model.drawn())
    }

    /// Returns `part`, the name of a component that needs a depth image, if the target is a cloud.
    ///
    /// Components return it from their method `unsupported`. Returns `None` without a target.
    #[must_use]
    pub fn without_image(&self, part: &'static str) -> Option<&'static str> {
        matches!(self.target, Some(Target::Cloud(_))).then_some(part)
    }

    /// Returns `part`, the name of a component that needs a mesh and an image, if a side is a
    /// cloud.
    ///
    /// Components return it from their method `unsupported`. Returns `None` without sides.
    #[must_use]
    pub fn without_mesh_or_image(&self, part: &'static str) -> Option<&'static str> {
        let mesh = !matches!(self.source, Some(Source::Cloud(_)));
        self.without_image(part).or((!mesh).then_some(part))
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
    /// The source and the target.
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
/// A view borrows the context, so copy `context.problem` first to use both:
///
/// ```
/// use hicp_core::{Context, Isometry3};
/// /// Returns the rendered share of the measured pixels.
/// fn coverage(context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> Option<f64> {
///     let (_, observation) = context.problem.sides()?;
///     let view = context.view(camera_from_object)?;
///     Some(view.n_rendered() as f64 / observation.n_measured().max(1) as f64)
/// }
/// ```
#[derive(Debug)]
pub struct Context<'a> {
    /// The source and the target.
    pub problem: Problem<'a>,
    renders: &'a mut RenderCache,
    cascade_init: Option<Isometry3<f64>>,
}

impl<'a> Context<'a> {
    /// Combines a problem and a render cache.
    #[must_use]
    pub fn new(problem: Problem<'a>, renders: &'a mut RenderCache) -> Self {
        Self {
            problem,
            renders,
            cascade_init: None,
        }
    }

    /// Sets the initial pose of the cascade that runs the stage, `camera_from_object`.
    #[must_use]
    pub fn in_cascade(mut self, init: Option<Isometry3<f64>>) -> Self {
        self.cascade_init = init;
        self
    }

    /// The initial pose of the cascade that runs the stage, `camera_from_object`, if one does.
    #[must_use]
    pub fn cascade_init(&self) -> Option<&Isometry3<f64>> {
        self.cascade_init.as_ref()
    }

    /// Returns the model rendered at a pose, `camera_from_object`, in the observation's camera.
    ///
    /// Its triangles are those of [`Problem::drawn`]. If the cache holds the pose, nothing is
    /// rendered. Returns `None` if the problem has no model or no depth image.
    pub fn view(&mut self, camera_from_object: &Isometry3<f64>) -> Option<&RenderedView> {
        let (model, observation) = self.problem.sides()?;
        let camera = observation.camera();
        let mesh = self.problem.drawn()?;
        Some(
            self.renders
                .view_of(model, mesh, camera, camera_from_object),
        )
    }
}

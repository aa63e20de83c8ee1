//! The scratch memory and the observer that a run borrows.

use hicp_core::{
    Context, Correspondences, Isometry3, Model, PinholeCamera, Problem, RenderCache, RenderedView,
    Renderer, Surfel,
};

use crate::alternative::Alternative;
use crate::observer::Observer;

/// The scratch memory and the render cache of one thread.
///
/// Create one per thread and reuse it: a warm run allocates nothing.
#[derive(Debug)]
pub struct Workspace {
    pub(crate) renders: RenderCache,
    pub(crate) source: Vec<Surfel>,
    pub(crate) pairs: Correspondences,
    /// Names of filters and stop rules, for the observer.
    pub(crate) names: Vec<&'static str>,
    pub(crate) alternatives: Vec<Alternative>,
}

impl Workspace {
    /// Creates a workspace around a renderer.
    pub fn new(renderer: impl Renderer + Send + 'static) -> Self {
        Self {
            renders: RenderCache::new(renderer),
            source: Vec::new(),
            pairs: Correspondences::new(),
            names: Vec::new(),
            alternatives: Vec::new(),
        }
    }

    /// Returns a problem as components receive it, with this workspace's render cache.
    pub fn context<'a>(&'a mut self, problem: &Problem<'a>) -> Context<'a> {
        Context::new(*problem, &mut self.renders)
    }

    /// Returns a model rendered at a pose, for a camera without an observation.
    ///
    /// The render is in the cache that runs use. It draws [`Model::drawn`]; a run that compares
    /// colors draws the whole mesh.
    pub fn view(
        &mut self,
        model: &Model,
        camera: &PinholeCamera,
        camera_from_object: &Isometry3<f64>,
    ) -> &RenderedView {
        self.renders.view(model, camera, camera_from_object)
    }

    /// The pairs at the pose that the last [`Icp`](crate::Icp) returned.
    ///
    /// If its last candidate was rejected, the pairs are those of the pose accepted before. The
    /// list is empty if there were no pairs at the initial pose. It does not change if the stage
    /// could not run ([`Termination::Unsupported`](crate::Termination::Unsupported)).
    #[must_use]
    pub fn pairs(&self) -> &Correspondences {
        &self.pairs
    }

    /// The distinct other poses that the last search or choice by color found, best first.
    ///
    /// A [`HypothesisSearch`](crate::HypothesisSearch) replaces the list. A
    /// [`ColorChoice`](crate::ColorChoice) adds poses, and moves those that color does not tell
    /// apart to the front. Other stages do not change it, so clear it before a run without a
    /// search.
    #[must_use]
    pub fn alternatives(&self) -> &[Alternative] {
        &self.alternatives
    }

    /// The same list, to clear it before a run or to write it in a custom search.
    pub fn alternatives_mut(&mut self) -> &mut Vec<Alternative> {
        &mut self.alternatives
    }

    /// Number of renders so far.
    #[must_use]
    pub fn renders(&self) -> u64 {
        self.renders.renders()
    }
}

/// The workspace and the observer of one run; `&mut ()` observes nothing.
pub struct Session<'a> {
    /// Scratch memory.
    pub workspace: &'a mut Workspace,
    /// The receiver of events.
    pub observer: &'a mut dyn Observer,
    /// The initial pose of the cascade that is running, `camera_from_object`. A cascade sets it for
    /// its stages.
    pub cascade_init: Option<Isometry3<f64>>,
    /// `true` within a search, whose stages only refine.
    pub(crate) searching: bool,
}

impl<'a> Session<'a> {
    /// Combines a workspace and an observer.
    pub fn new(workspace: &'a mut Workspace, observer: &'a mut dyn Observer) -> Self {
        Self {
            workspace,
            observer,
            cascade_init: None,
            searching: false,
        }
    }

    /// Returns a problem as components receive it, with the initial pose of the running cascade.
    pub fn context<'b>(&'b mut self, problem: &Problem<'b>) -> Context<'b> {
        self.workspace
            .context(problem)
            .in_cascade(self.cascade_init)
    }
}

impl std::fmt::Debug for Session<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Session")
            .field("workspace", &self.workspace)
            .finish_non_exhaustive()
    }
}

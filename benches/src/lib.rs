//! Scenes that the benches measure. The seeds are fixed, so that every run measures the same work.

pub mod fused;
pub mod instances;
pub mod peer;
pub mod work;

use hicp_sim::{Household, perturb_by_mean, rng};
use hicp_tests::Scene;
use hybrid_icp::association::PointSelection;
use hybrid_icp::core::{Isometry3, Problem, Surfel};
use hybrid_icp::icp::Workspace;
use hybrid_icp::raster::Rasterizer;

/// A scene and a start at the paper's mean initialization error.
#[derive(Debug)]
pub struct Case {
    /// Name of the object.
    pub name: &'static str,
    /// The scene.
    pub scene: Scene,
    /// The initial pose.
    pub init: Isometry3<f64>,
}

/// Creates the case of an object, with 0.5 % depth noise.
#[must_use]
pub fn case(object: Household) -> Case {
    let mut rng = rng(42);
    let scene = hicp_tests::scene(object, 0.5, &mut rng);
    let init = perturb_by_mean(&mut rng, &scene.truth);
    Case {
        name: object.name(),
        scene,
        init,
    }
}

/// Objects that the benches measure: a body with a handle, a thin one, and a flat box.
pub const OBJECTS: [Household; 3] = [Household::Mug, Household::Hammer, Household::Carton];

/// Returns the points that a selection selects, and a workspace with their render.
#[must_use]
pub fn selected(
    scene: &Scene,
    init: &Isometry3<f64>,
    selection: &mut dyn PointSelection,
) -> (Vec<Surfel>, Workspace) {
    let mut workspace = Workspace::new(Rasterizer::default());
    let problem = Problem::new(&scene.model, &scene.observation);
    let mut source = Vec::new();
    selection.select(&mut workspace.context(&problem), init, &mut source);
    (source, workspace)
}

/// Fills a workspace's render cache with poses that no run requests.
///
/// The next run then finds no render of an earlier run.
pub fn forget_renders(workspace: &mut Workspace, problem: &Problem<'_>, init: &Isometry3<f64>) {
    for step in 1..=8 {
        let elsewhere = Isometry3::translation(0.001 * f64::from(step), 0.0, 0.0) * init;
        let _ = workspace.context(problem).view(&elsewhere);
    }
}

//! The test inputs of components: two small scenes, and difficult variants of them.

use std::sync::{Arc, OnceLock};

use hicp_sim::{Household, RelativeGaussian, object_pose, perturb, rng};
use hybrid_icp::core::{
    Context, Isometry3, Mask, Model, Observation, PinholeCamera, Problem, Translation3,
    UnitQuaternion, Vector3,
};
use hybrid_icp::icp::Workspace;
use hybrid_icp::raster::{Rasterizer, render_depth_image};

/// A model, a small depth image of it, and its true pose.
#[derive(Debug)]
pub struct Scene {
    /// Name of the object.
    pub name: &'static str,
    /// The object.
    pub model: Model,
    /// The image of 160×120 pixels, with depth noise of 0.5 %.
    pub observation: Observation,
    /// An observation of the same camera that contains nothing.
    pub nothing: Observation,
    /// The same image with a mask of a single pixel.
    pub one_pixel: Observation,
    /// The true pose (`camera_from_object`), meters.
    pub truth: Isometry3<f64>,
    /// A pose with an error of 4 mm and 4°.
    pub near: Isometry3<f64>,
    /// A pose with an error of 3 cm and 30°.
    pub far: Isometry3<f64>,
}

impl Scene {
    /// Returns the scene as a problem.
    #[must_use]
    pub fn problem(&self) -> Problem<'_> {
        Problem::new(&self.model, &self.observation)
    }

    fn new(name: &'static str, object: Household, seed: u64) -> Self {
        let mut rng = rng(seed);
        let model = object.model().expect("the objects that ship are valid");
        let camera = PinholeCamera::new(143.1, 143.4, 81.3, 60.5, 160, 120).expect("valid");
        let truth = object_pose(&mut rng, &model.center(), 0.35..0.45, 0.02);
        let clean = render_depth_image(model.mesh(), &camera, &truth);
        let seen: Vec<bool> = clean.pixels().iter().map(|z| *z > 0.0).collect();
        let depth = RelativeGaussian { percent: 0.5 }.apply(&mut rng, &clean);
        let depth = Arc::new(depth);
        let middle = seen.iter().position(|s| *s).unwrap_or(0);
        let one = (0..seen.len()).map(|i| i == middle).collect();
        let observe = |mask: Vec<bool>| {
            let mask = Mask::new(160, 120, mask).expect("sizes agree");
            Observation::new(Arc::clone(&depth), mask, camera).expect("sizes agree")
        };
        Self {
            name,
            nothing: observe(vec![false; seen.len()]),
            one_pixel: observe(one),
            observation: observe(seen),
            near: perturb(&mut rng, &truth, 0.004, 4.0_f64.to_radians()),
            far: perturb(&mut rng, &truth, 0.03, 30.0_f64.to_radians()),
            truth,
            model,
        }
    }
}

/// Returns the scenes of the kit: a mug (thin walls, a handle) and a carton (planes).
///
/// They are built once and are deterministic.
#[must_use]
pub fn scenes() -> &'static [Scene] {
    static SCENES: OnceLock<Vec<Scene>> = OnceLock::new();
    SCENES.get_or_init(|| {
        vec![
            Scene::new("mug", Household::Mug, 11),
            Scene::new("carton", Household::Carton, 23),
        ]
    })
}

/// Returns a workspace with the rasterizer.
pub(crate) fn workspace() -> Workspace {
    Workspace::new(Rasterizer::default())
}

/// Calls `run` with the view of a pose in the cache.
///
/// Returns its result and the number of renders that it added.
pub(crate) fn at_rendered_pose<R>(
    problem: &Problem<'_>,
    pose: &Isometry3<f64>,
    run: impl FnOnce(&mut Context<'_>) -> R,
) -> (R, u64) {
    let mut workspace = workspace();
    workspace.context(problem).view(pose);
    let before = workspace.renders();
    let result = run(&mut workspace.context(problem));
    (result, workspace.renders() - before)
}

/// A problem and a pose, with a label for messages.
pub(crate) struct Case {
    pub(crate) label: String,
    pub(crate) problem: Problem<'static>,
    pub(crate) pose: Isometry3<f64>,
}

/// Returns every scene at good, bad and impossible poses, and with almost empty observations.
pub(crate) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for scene in scenes() {
        for (what, pose) in poses(scene) {
            cases.push(Case {
                label: format!("the {} at {what}", scene.name),
                problem: scene.problem(),
                pose,
            });
        }
        for (what, observation) in [
            ("an empty mask", &scene.nothing),
            ("a mask of one pixel", &scene.one_pixel),
        ] {
            cases.push(Case {
                label: format!("the {} seen through {what}", scene.name),
                problem: Problem::new(&scene.model, observation),
                pose: scene.near,
            });
        }
    }
    cases
}

fn poses(scene: &Scene) -> [(&'static str, Isometry3<f64>); 10] {
    let moved = |x, y, z| Isometry3::from_parts(Translation3::new(x, y, z), scene.truth.rotation);
    let turned = Vector3::new(f64::NAN, 0.0, 0.0);
    let turned = Isometry3::from_parts(scene.truth.translation, UnitQuaternion::new(turned));
    let [x, y, z] = scene.truth.translation.vector.into();
    [
        ("the true pose", scene.truth),
        ("a pose nearly right", scene.near),
        ("a pose far off", scene.far),
        ("a pose behind the camera", moved(-x, -y, -z)),
        ("a pose outside the image", moved(x + 5.0, y, z)),
        ("a pose around the camera", moved(0.0, 0.0, 0.0)),
        ("a distance beyond the range of f32", moved(x, y, 1e300)),
        ("a translation of NaN", moved(x, f64::NAN, z)),
        ("an infinite translation", moved(x, y, f64::INFINITY)),
        ("a rotation of NaN", turned),
    ]
}

/// Returns the model and the observation of a case.
pub(crate) fn sides<'a>(problem: &Problem<'a>) -> (&'a Model, &'a Observation) {
    let Some(sides) = problem.sides() else {
        unreachable!("every case of the kit has a model and an observation");
    };
    sides
}

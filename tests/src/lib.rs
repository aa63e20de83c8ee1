//! Scenes, starts, data and a counting allocator, shared by the cross-crate tests and the benches.

pub mod allocations;
pub mod fuzz;
pub mod mugs;
pub mod nees;
pub mod painted;
pub mod starts;
pub mod tabletop;
pub mod ycbv;

use std::sync::Arc;

use hicp_sim::{Household, RelativeGaussian, SimRng, object_pose, perturb};
use hybrid_icp::core::{
    DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, Problem, Symmetries, se3,
};
use hybrid_icp::icp::{Observer, Outcome, Session, Stage, Workspace};
use hybrid_icp::raster::{Rasterizer, render_depth_image};
use hybrid_icp::score::ModelPoints;

use crate::tabletop::Tabletop;

/// The ten objects of the starts and of the figures quoted from them.
pub const OBJECTS: [Household; 10] = [
    Household::Mug,
    Household::Bottle,
    Household::Bowl,
    Household::Carton,
    Household::Bracket,
    Household::Hammer,
    Household::Plate,
    Household::Iron,
    Household::Car,
    Household::Pan,
];

/// A model in a depth image, with its true pose.
#[derive(Debug)]
pub struct Scene {
    /// The object.
    pub model: Model,
    /// The image.
    pub observation: Observation,
    /// The true pose, camera from object.
    pub truth: Isometry3<f64>,
}

impl Scene {
    /// Creates the observation again, without its search trees.
    pub fn observe_again(&self) -> Observation {
        let observation = &self.observation;
        Observation::new(
            Arc::clone(observation.shared_depth()),
            observation.mask().clone(),
            *observation.camera(),
        )
        .expect("sizes agree")
    }

    /// Returns the problem of finding the object in its view.
    pub fn problem(&self) -> Problem<'_> {
        Problem::new(&self.model, &self.observation)
    }

    /// Runs a stage in a new workspace.
    pub fn run(
        &self,
        stage: &mut dyn Stage,
        init: &Isometry3<f64>,
        observer: &mut dyn Observer,
    ) -> Outcome {
        let mut workspace = Workspace::new(Rasterizer::default());
        let mut session = Session::new(&mut workspace, observer);
        stage.run(&self.problem(), init, &mut session)
    }

    /// Returns the same view with an upright, flat bar in front of the object.
    ///
    /// The bar covers a `share` of the mask's width around its middle, and is `meters` nearer than
    /// the nearest point of the object.
    ///
    /// If `masked`, the mask includes the bar, as detectors do with hands and grippers.
    pub fn behind_a_bar(&self, share: f64, meters: f32, masked: bool) -> Observation {
        let camera = *self.observation.camera();
        let (width, height) = (camera.width(), camera.height());
        let mask = self.observation.mask();
        let region = mask.bounding_region();
        let half = region.width() as f64 * share / 2.0;
        let middle = f64::from(region.u_min + region.u_max) / 2.0;
        let on_bar = |u: u32, v: u32| region.contains(u, v) && (f64::from(u) - middle).abs() < half;
        let depth = self.observation.depth().pixels();
        let nearest = depth
            .iter()
            .copied()
            .filter(|z| *z > 0.0)
            .fold(f32::INFINITY, f32::min);
        let depth = camera.region().pixels().zip(depth);
        let depth = depth.map(|((u, v), z)| if on_bar(u, v) { nearest - meters } else { *z });
        let depth = DepthImage::collect(width, height, depth).expect("sizes agree");
        let mask = Mask::in_region(width, height, &region, |u, v| {
            mask.get(u, v) == Some(true) && (masked || !on_bar(u, v))
        });
        Observation::new(depth, mask, camera).expect("sizes agree")
    }
}

/// Sorts the values and returns the median, or NaN without values.
///
/// The median of an even number of values is the mean of the two middle ones.
pub fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => values[middle],
        _ => f64::midpoint(values[middle - 1], values[middle]),
    }
}

/// Returns the mean of the values, or NaN without values.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Returns the household objects that a word on the command line selects.
///
/// # Errors
///
/// If the word is neither `tuning` nor `test`.
pub fn household(word: &str) -> Result<[Household; 10], String> {
    match word {
        "tuning" => Ok(Household::TUNING),
        "test" => Ok(Household::TEST),
        other => Err(format!("{other}: expected tuning or test")),
    }
}

/// Prepares the pose errors of every object, in the order of [`Tabletop::objects`].
pub fn points_of(scenes: &Tabletop) -> Vec<ModelPoints> {
    let objects = scenes.objects.iter();
    objects.map(|(_, model)| ModelPoints::new(model)).collect()
}

/// Returns the camera of the synthetic scenes: 640×480 pixels, 60° wide.
pub fn camera() -> PinholeCamera {
    PinholeCamera::new(572.4, 573.6, 325.3, 242.0, 640, 480).expect("a valid camera")
}

/// Renders a model into a depth image of the whole camera, with the mask of its pixels.
pub fn render(model: &Model, camera: &PinholeCamera, pose: &Isometry3<f64>) -> (DepthImage, Mask) {
    let depth = render_depth_image(model.mesh(), camera, pose);
    let mask = Mask::measured(&depth);
    (depth, mask)
}

/// Creates a scene: the object at a random pose, 0.3 to 0.6 m away, with relative depth noise.
pub fn scene(object: Household, noise_percent: f64, rng: &mut SimRng) -> Scene {
    let model = object.model().expect("the objects that ship are valid");
    let camera = camera();
    let nearest = model.diameter().max(0.3);
    let truth = object_pose(rng, &model.center(), nearest..0.6, 0.02);
    let (depth, mask) = render(&model, &camera, &truth);
    let depth = RelativeGaussian {
        percent: noise_percent,
    }
    .apply(rng, &depth);
    Scene {
        observation: Observation::new(depth, mask, camera).expect("sizes agree"),
        model,
        truth,
    }
}

/// Creates a [`scene`], and an initial pose that is off by a distance (meters) and an angle
/// (radians).
pub fn perturbed_scene(
    object: Household,
    noise_percent: f64,
    rng: &mut SimRng,
    (meters, radians): (f64, f64),
) -> (Scene, Isometry3<f64>) {
    let scene = scene(object, noise_percent, rng);
    let init = perturb(rng, &scene.truth, meters, radians);
    (scene, init)
}

/// Returns the rotation (radians) and translation (meters) error, up to the declared symmetries.
///
/// Around a continuous symmetry axis, only the direction of the axis counts.
pub fn symmetric_pose_distance(
    pose: &Isometry3<f64>,
    truth: &Isometry3<f64>,
    symmetries: &Symmetries,
) -> (f64, f64) {
    if let Some(axis) = symmetries.continuous.first() {
        let (a, b) = (
            pose.rotation * axis.direction().into_inner(),
            truth.rotation * axis.direction().into_inner(),
        );
        let distance = (pose * axis.offset() - truth * axis.offset()).norm();
        return (a.cross(&b).norm().atan2(a.dot(&b)), distance);
    }
    symmetries
        .motions()
        .iter()
        .map(|motion| se3::pose_distance(pose, &(truth * motion)))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .expect("the identity is among the motions")
}

/// Runs the Rust blocks of the README and the book.
#[cfg(doctest)]
mod book {
    macro_rules! pages {
        ($($name:ident: $path:literal),+) => {
            $(
                #[doc = include_str!(concat!("../../", $path))]
                struct $name;
            )+
        };
    }
    pages!(
        Readme: "README.md",
        Problem: "docs/book/problem.md",
        FirstRefinement: "docs/book/first-refinement.md",
        HowIcpWorks: "docs/book/how-icp-works.md",
        WhyItSwitches: "docs/book/why-it-switches.md",
        BuildYourOwn: "docs/book/build-your-own.md",
        Trust: "docs/book/trust.md",
        Sequences: "docs/book/sequences.md",
        FromWhatYouHave: "docs/from-what-you-have.md",
        Presets: "docs/presets.md"
    );
}

//! The paper's starts (6.2 mm, 9.5° off) on synthetic objects, and a pipeline's results on them.

use hicp_sim::{perturb_by_mean, rng};
use hybrid_icp::core::Isometry3;
use hybrid_icp::icp::{Session, Stage, Verdict, Workspace};
use hybrid_icp::pipeline::PipelineFile;
use hybrid_icp::raster::Rasterizer;

use crate::{OBJECTS, Scene, median, scene, symmetric_pose_distance};

/// A scene and an initial pose.
#[derive(Debug)]
pub struct Start {
    /// The scene.
    pub scene: Scene,
    /// The initial pose.
    pub init: Isometry3<f64>,
}

/// Creates the starts of the `synthetic_starts` example: `per_object` for each of the ten objects.
pub fn starts(per_object: usize, noise_percent: f64) -> Vec<Start> {
    let objects = (0..).zip(OBJECTS);
    objects
        .flat_map(|(seed, object)| {
            let mut rng = rng(seed);
            (0..per_object)
                .map(move |_| {
                    let scene = scene(object, noise_percent, &mut rng);
                    let init = perturb_by_mean(&mut rng, &scene.truth);
                    Start { scene, init }
                })
                .collect::<Vec<_>>()
        })
        .collect()
}

/// The results of a pipeline on a set of starts.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Median rotation error, degrees, up to the symmetries.
    pub degrees: f64,
    /// Ninetieth percentile of the rotation error, degrees.
    pub degrees_p90: f64,
    /// Median translation error, millimeters.
    pub millimeters: f64,
    /// Median of [`hybrid_icp::icp::Outcome::iterations`], including the first and rejected
    /// evaluations.
    pub iterations: f64,
    /// Share of the starts whose initial pose was kept.
    pub kept: f64,
}

impl Row {
    /// Checks that the median errors are below those of another row, multiplied by a factor.
    ///
    /// # Panics
    ///
    /// If one is not.
    #[track_caller]
    pub fn assert_below(&self, factor: f64, other: &Row) {
        let below =
            self.degrees < factor * other.degrees && self.millimeters < factor * other.millimeters;
        assert!(below, "{self:?}\n{other:?}");
    }
}

/// Runs a pipeline from every start.
///
/// # Panics
///
/// If the text is not a pipeline.
pub fn measure(pipeline: &str, starts: &[Start]) -> Row {
    let file = PipelineFile::parse(pipeline, "row").unwrap_or_else(|e| panic!("{e}"));
    let mut stage = file.build().unwrap_or_else(|e| panic!("{e}\n{pipeline}"));
    measure_stage(&mut stage, starts)
}

/// Runs a stage from every start.
pub fn measure_stage(stage: &mut dyn Stage, starts: &[Start]) -> Row {
    let mut workspace = Workspace::new(Rasterizer::default());
    let (mut degrees, mut millimeters, mut iterations) = (Vec::new(), Vec::new(), Vec::new());
    let mut kept = 0.0;
    for Start { scene, init } in starts {
        let problem = scene.problem();
        let outcome = stage.run(&problem, init, &mut Session::new(&mut workspace, &mut ()));
        let (angle, distance) = symmetric_pose_distance(
            &outcome.camera_from_object,
            &scene.truth,
            scene.model.symmetries(),
        );
        degrees.push(angle.to_degrees());
        millimeters.push(distance * 1e3);
        iterations.push(outcome.iterations as f64);
        kept += f64::from(u8::from(outcome.verdict != Verdict::Refined));
    }
    Row {
        degrees: median(&mut degrees),
        degrees_p90: degrees[degrees.len() * 9 / 10],
        millimeters: median(&mut millimeters),
        iterations: median(&mut iterations),
        kept: kept / starts.len() as f64,
    }
}

/// Returns a stage of the visible surface with a given association and metric (TOML).
///
/// The stage ends if the next increment moves the object by less than 0.1 mm and 0.01°, or after 50
/// evaluations. It has no filter and no divergence rule.
pub fn plain_icp(association: &str, metric: &str) -> String {
    format!(
        "type = \"icp\"\nselection = \"visible-surface\"\nassociation = {association}\nmetric = {metric}\n\
         stop = [{{ type = \"motion\", translation_meters = 1e-4, rotation_degrees = 0.01 }}, {{ type = \"iteration-limit\", iterations = 50 }}]\n"
    )
}

/// Nearest neighbors among all masked pixels (TOML).
pub const NEAREST_OF_ALL: &str = "{ type = \"nearest-neighbor\", pixels = 1 }";

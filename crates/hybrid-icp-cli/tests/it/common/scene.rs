//! A scene in files, and its parts.

use std::ffi::{OsStr, OsString};
use std::ops::Deref;

use hicp_io::LengthUnit;
use hicp_sim::{Household, perturb, rng};
use hybrid_icp::core::{
    Isometry3, Mask, PinholeCamera, Point3, TriMesh, Vector3, sample_surface, se3,
};
use hybrid_icp::raster::render_depth_image;
use serde_json::{Value, json};

use super::folder::{Folder, Run, run};

pub(crate) fn camera() -> PinholeCamera {
    PinholeCamera::new(400.0, 402.0, 161.5, 118.0, 320, 240).unwrap()
}

/// Returns a pose that shows the car from the side.
pub(crate) fn truth() -> Isometry3<f64> {
    Isometry3::new(
        Vector3::new(0.012, -0.008, 0.5),
        Vector3::new(2.1, 0.7, -0.4),
    )
}

/// Returns a pose that is off by 6.2 mm and 9.5 degrees.
pub(crate) fn off(pose: &Isometry3<f64>, seed: u64) -> Isometry3<f64> {
    perturb(&mut rng(seed), pose, 0.0062, 9.5_f64.to_radians())
}

pub(crate) fn car() -> TriMesh {
    Household::Car.solid().to_mesh().unwrap()
}

/// Writes 3,000 points of the car as `a.ply`, and 4,000 others, moved, as `b.pcd`.
///
/// Both are PLY files: readers recognize the content, not the name.
pub(crate) fn write_clouds(folder: &Folder, motion: &Isometry3<f64>) {
    for (name, count, pose) in [
        ("a.ply", 3000, &Isometry3::identity()),
        ("b.pcd", 4000, motion),
    ] {
        let surfels = sample_surface(&car(), count);
        let moved = surfels
            .iter()
            .map(|s| (pose * s.point.cast::<f64>()).cast());
        let points: Vec<Point3<f32>> = moved.collect();
        hicp_io::write_point_cloud_ply(folder.path(name), &points, None).unwrap();
    }
}

pub(crate) fn pose_json(pose: &Isometry3<f64>) -> Value {
    let (rotation, translation) = hicp_io::pose_to_bop(pose);
    json!({"cam_R_m2c": rotation, "cam_t_m2c": translation})
}

/// Returns the pose in a JSON object.
pub(crate) fn pose_of(value: &Value) -> Isometry3<f64> {
    let numbers = |key: &str| -> Vec<f64> {
        let items = value[key].as_array().unwrap();
        items.iter().map(|n| n.as_f64().unwrap()).collect()
    };
    hicp_io::pose_from_bop(
        &numbers("cam_R_m2c").try_into().unwrap(),
        &numbers("cam_t_m2c").try_into().unwrap(),
    )
    .unwrap()
}

/// Asserts that a pose is much nearer to the truth than the initial one.
#[track_caller]
pub(crate) fn assert_improved(pose: &Isometry3<f64>, truth: &Isometry3<f64>) {
    let (angle, distance) = se3::pose_distance(pose, truth);
    let degrees = angle.to_degrees();
    assert!(
        degrees < 3.0 && distance < 0.003,
        "{degrees} deg, {distance} m"
    );
}

/// A scene in the files that `refine` reads, and the arguments that refine it.
pub(crate) struct Scene {
    pub(crate) folder: Folder,
    pub(crate) arguments: Vec<(&'static str, OsString)>,
}

impl Scene {
    /// Creates a car seen without noise, with a pose that is off by 6.2 mm and 9.5 degrees.
    pub(crate) fn new() -> Self {
        let scene = Self {
            folder: Folder::new(),
            arguments: [
                ("--model", "mesh.ply"),
                ("--model-unit", "m"),
                ("--depth", "depth.png"),
                ("--depth-scale", "0.1"),
                ("--mask", "mask.png"),
                ("--camera", "camera.json"),
                ("--init", "init.json"),
                ("--output", "out.json"),
            ]
            .map(|(option, value)| (option, value.into()))
            .to_vec(),
        };
        let mesh = car();
        let depth = render_depth_image(&mesh, &camera(), &truth());
        hicp_io::write_ply(scene.path("mesh.ply"), &mesh, LengthUnit::Meters).unwrap();
        hicp_io::write_depth_png(scene.path("depth.png"), &depth, 0.1).unwrap();
        hicp_io::write_mask_png(scene.path("mask.png"), &Mask::measured(&depth)).unwrap();
        scene.write("camera.json", FLAT_CAMERA);
        scene.write("init.json", pose_json(&off(&truth(), 5)).to_string());
        scene
    }

    /// Sets or replaces an option.
    pub(crate) fn with(mut self, option: &'static str, value: impl Into<OsString>) -> Self {
        self = self.without(option);
        self.arguments.push((option, value.into()));
        self
    }

    pub(crate) fn without(mut self, option: &str) -> Self {
        self.arguments.retain(|(name, _)| *name != option);
        self
    }

    /// Returns the arguments as words.
    pub(crate) fn words(&self) -> impl Iterator<Item = &OsStr> {
        let pairs = self.arguments.iter();
        pairs.flat_map(|(option, value)| [OsStr::new(*option), value.as_os_str()])
    }

    /// Runs a command with the arguments.
    #[track_caller]
    pub(crate) fn run_command(&self, command: &str) -> Run {
        let command = std::iter::once(OsStr::new(command));
        run(self.root(), command.chain(self.words()))
    }

    #[track_caller]
    pub(crate) fn run(&self) -> Run {
        self.run_command("refine")
    }

    /// Runs the program, asserts that it succeeds, and returns the result.
    #[track_caller]
    pub(crate) fn result(&self) -> Value {
        self.run().exits(0);
        self.json("out.json")
    }
}

impl Deref for Scene {
    type Target = Folder;

    fn deref(&self) -> &Folder {
        &self.folder
    }
}

pub(crate) const FLAT_CAMERA: &str =
    r#"{"fx": 400, "fy": 402, "cx": 161.5, "cy": 118, "width": 320, "height": 240}"#;
pub(crate) const BOP_CAMERA: &str =
    r#"{"cam_K": [400, 0, 161.5, 0, 402, 118, 0, 0, 1], "depth_scale": 0.1}"#;

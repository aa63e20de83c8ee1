//! A row of a result file.

use std::fmt;

use hicp_core::Isometry3;

use crate::pose::pose_to_bop;

/// The columns of a result file in the order of writing, and the expected content of their cells.
pub(super) const COLUMNS: [(&str, &str); 7] = [
    ("scene_id", "an integer from 0 to 4294967295"),
    ("im_id", "an integer from 0 to 4294967295"),
    ("obj_id", "an integer from 0 to 4294967295"),
    ("score", "a finite number"),
    ("R", "9 finite numbers separated by spaces"),
    ("t", "3 finite numbers separated by spaces"),
    ("time", "a finite number of seconds, -1 if unknown"),
];

/// One estimate: an object in an image, and its pose in the camera frame.
///
/// The row stores the numbers of the pose as they are in the file. A row with an unchanged pose is
/// therefore written back exactly, although its rotation may be orthogonal only up to rounding.
#[derive(Clone, Debug, PartialEq)]
pub struct ResultRow {
    /// Id of the scene.
    pub scene_id: u32,
    /// Id of the image.
    pub im_id: u32,
    /// Id of the object.
    pub obj_id: u32,
    /// Confidence; higher is better.
    pub score: f64,
    /// Time spent on all estimates of the image in seconds, if known.
    pub time_s: Option<f64>,
    pub(super) rotation: [f64; 9],
    pub(super) translation_mm: [f64; 3],
    pub(super) camera_from_object: Isometry3<f64>,
}

impl ResultRow {
    /// Creates a row with score 1 and unknown time. The pose is in meters.
    #[must_use]
    pub fn new(scene_id: u32, im_id: u32, obj_id: u32, camera_from_object: Isometry3<f64>) -> Self {
        let (rotation, translation_mm) = pose_to_bop(&camera_from_object);
        Self {
            scene_id,
            im_id,
            obj_id,
            score: 1.0,
            time_s: None,
            rotation,
            translation_mm,
            camera_from_object,
        }
    }

    /// Returns the header line of a result file, without a line ending.
    #[must_use]
    pub fn header() -> String {
        COLUMNS.map(|(name, _)| name).join(",")
    }

    /// Returns the estimated pose, meters. Its rotation is the one nearest to the numbers of the
    /// file.
    #[must_use]
    pub fn camera_from_object(&self) -> Isometry3<f64> {
        self.camera_from_object
    }

    /// Replaces the estimated pose, meters.
    pub fn set_camera_from_object(&mut self, camera_from_object: Isometry3<f64>) {
        (self.rotation, self.translation_mm) = pose_to_bop(&camera_from_object);
        self.camera_from_object = camera_from_object;
    }

    /// Returns the rotation as it is written to the file, row-major.
    #[must_use]
    pub fn rotation(&self) -> &[f64; 9] {
        &self.rotation
    }

    /// Returns the translation as it is written to the file, millimeters.
    #[must_use]
    pub fn translation_mm(&self) -> &[f64; 3] {
        &self.translation_mm
    }
}

/// Formats the row as a line of a result file, without a line ending.
impl fmt::Display for ResultRow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let join = |numbers: &[f64]| {
            let numbers: Vec<String> = numbers.iter().map(f64::to_string).collect();
            numbers.join(" ")
        };
        let (rotation, translation) = (join(&self.rotation), join(&self.translation_mm));
        let (scene, image, object, score) = (self.scene_id, self.im_id, self.obj_id, self.score);
        let time = self.time_s.unwrap_or(-1.0);
        write!(
            f,
            "{scene},{image},{object},{score},{rotation},{translation},{time}"
        )
    }
}

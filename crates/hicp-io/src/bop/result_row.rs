//! A row of a result file.

use std::fmt;

use hicp_core::Isometry3;

use crate::pose::pose_to_bop;

/// The columns of a result file, in the order in which they are written, and what their cells must hold.
pub(super) const COLUMNS: [(&str, &str); 7] = [
    ("scene_id", "an integer from 0 to 4294967295"),
    ("im_id", "an integer from 0 to 4294967295"),
    ("obj_id", "an integer from 0 to 4294967295"),
    ("score", "a finite number"),
    ("R", "9 finite numbers separated by spaces"),
    ("t", "3 finite numbers separated by spaces"),
    ("time", "a finite number of seconds, -1 if unknown"),
];

/// One estimate: an object in an image, and where it is.
///
/// The numbers of the pose are kept as they stood in the file, so that a row whose pose is not replaced is written back
/// with the same numbers, although its rotation may be orthogonal only up to rounding.
#[derive(Clone, Debug, PartialEq)]
pub struct ResultRow {
    /// The scene.
    pub scene_id: u32,
    /// The image.
    pub im_id: u32,
    /// The object.
    pub obj_id: u32,
    /// Confidence; higher is better.
    pub score: f64,
    /// Seconds spent on all estimates of the image, where known.
    pub time_s: Option<f64>,
    pub(super) rotation: [f64; 9],
    pub(super) translation_mm: [f64; 3],
    pub(super) camera_from_object: Isometry3<f64>,
}

impl ResultRow {
    /// Creates a row with score 1 and unknown time; the pose is in meters.
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

    /// Returns the first line of a result file, without its end.
    #[must_use]
    pub fn header() -> String {
        COLUMNS.map(|(name, _)| name).join(",")
    }

    /// The estimate, meters; its rotation is the one nearest to the file's numbers.
    #[must_use]
    pub fn camera_from_object(&self) -> Isometry3<f64> {
        self.camera_from_object
    }

    /// Replaces the estimate; meters.
    pub fn set_camera_from_object(&mut self, camera_from_object: Isometry3<f64>) {
        (self.rotation, self.translation_mm) = pose_to_bop(&camera_from_object);
        self.camera_from_object = camera_from_object;
    }

    /// The rotation as it is written, row-major.
    #[must_use]
    pub fn rotation(&self) -> &[f64; 9] {
        &self.rotation
    }

    /// The translation as it is written, millimeters.
    #[must_use]
    pub fn translation_mm(&self) -> &[f64; 3] {
        &self.translation_mm
    }
}

/// The row's line in a result file, without its end.
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

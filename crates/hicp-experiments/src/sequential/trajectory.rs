//! The camera's path, and the initial pose (§VI-C.1).

use hicp_core::{Isometry3, Model, Translation3, Vector3};
use hicp_sim::{CaseMaker, Start, VsdBins, object_pose, stream, unit_vector};
use rand::RngExt;

use super::config::{PathDirection, TrajectoryConfig};

/// A straight path toward the object, and an initial pose in a bin of the initial VSD.
///
/// The camera does not rotate.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Trajectory {
    /// The true and the initial pose in the first camera frame, with the original model.
    pub(crate) start: Start,
    /// Direction of the camera's motion, a unit vector in its frame.
    pub(crate) direction: Vector3<f64>,
}

impl Trajectory {
    /// Draws the trajectory of an index. Its bin is the index modulo the number of bins.
    ///
    /// Like the single-image studies, it tries several starts around one path before it draws
    /// another path.
    pub(crate) fn draw(
        config: &TrajectoryConfig,
        scorer: &mut CaseMaker,
        model: &Model,
        object: &str,
        index: u64,
    ) -> Result<Self, String> {
        let bins = VsdBins {
            count: config.bins,
            max_translation_meters: config.max_translation_m,
            ..VsdBins::default()
        };
        #[allow(clippy::cast_possible_truncation)] // Below the number of bins.
        let bin = (index % bins.count as u64) as usize;
        let mut paths = stream(config.seed, &[object, "trajectory"], index);
        let mut inits = stream(config.seed, &[object, "trajectory init"], index);
        let distance = config.start_distance_m;
        let mut direction = Vector3::z();
        let found = scorer.start_in_bin(model, &bins, bin, &mut inits, || {
            let (center, distances) = (model.center(), distance..distance);
            let truth = object_pose(&mut paths, &center, distances, config.axis_offset_m);
            direction = match config.path {
                PathDirection::OpticalAxis => Vector3::z(),
                PathDirection::Target { offset_m } => {
                    let aside = unit_vector(&mut paths) * (offset_m * paths.random::<f64>());
                    ((truth * model.center()).coords + aside).normalize()
                }
            };
            truth
        });
        let start = found.ok_or_else(|| {
            format!(
                "no start of {object} in bin {bin} of {}, expected one within {} tries around each of {} poses",
                bins.count, bins.tries_per_pose, bins.max_poses
            )
        })?;
        Ok(Self { start, direction })
    }

    /// Returns the motion of the camera over a distance: the next camera frame from the previous
    /// one.
    pub(crate) fn motion(&self, meters: f64) -> Isometry3<f64> {
        let moved = Translation3::from(-self.direction * meters);
        Isometry3::from_parts(moved, hicp_core::UnitQuaternion::identity())
    }
}

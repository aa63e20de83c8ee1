//! A hand that passes in front of an object.

use hicp_core::{Isometry3, Point3, Translation3, TriMesh, UnitQuaternion, Vector3};

use crate::SimRng;
use crate::clutter::within;
use crate::error::SimError;
use crate::objects::Solid;

/// Distance of the hand from the camera, relative to that of the object.
const NEARER: f64 = 0.5;
/// Half the width of the palm of an unscaled hand, meters.
const HALF_PALM: f64 = 0.045;
/// Time in which the hand comes in front of the object, and in which it leaves, seconds.
const MOVE_SECONDS: f64 = 0.3;
/// Length of the path to the place in front of the object, in widths of the palm.
const REACH: f64 = 2.5;
/// Distance at which a passing hand misses the object's center, in half widths of the palm.
const MISS: std::ops::Range<f64> = 0.3..1.0;

/// The passage of a hand in front of an object.
#[derive(Clone, Debug)]
pub(crate) struct Passage {
    pub(crate) mesh: TriMesh,
    /// Half the width of the palm, meters.
    half_palm: f64,
    /// Direction in the image from which the arm comes, radians.
    from: f64,
    /// Seconds at which the hand is, and is no longer, in front of the object.
    still: (f64, f64),
    /// Distance at which the palm misses the object's center, across its direction, meters.
    miss: f64,
}

impl Passage {
    /// Draws a passage that hides a sphere of a radius, meters, between two times.
    pub(crate) fn covering(
        rng: &mut SimRng,
        radius: f64,
        still: (f64, f64),
    ) -> Result<Self, SimError> {
        let half_palm = 1.3 * NEARER * radius;
        let size = half_palm / HALF_PALM;
        Ok(Self {
            mesh: hand().scaled(&Vector3::repeat(size)).to_mesh()?,
            half_palm,
            from: within(rng, &(0.0..std::f64::consts::TAU)),
            still,
            miss: 0.0,
        })
    }

    /// Draws a passage that hides a part of the object at a time.
    pub(crate) fn partial(rng: &mut SimRng, radius: f64, at: f64) -> Result<Self, SimError> {
        let covering = Self::covering(rng, 0.6 * radius, (at, at))?;
        Ok(Self {
            miss: covering.half_palm * within(rng, &MISS),
            ..covering
        })
    }

    /// Returns the pose of the hand in the camera frame, if it is near the object.
    pub(crate) fn pose(&self, object: &Point3<f64>, seconds: f64) -> Option<Isometry3<f64>> {
        let away = (self.still.0 - seconds)
            .max(seconds - self.still.1)
            .max(0.0)
            / MOVE_SECONDS;
        if away > 1.0 {
            return None;
        }
        let arm = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), self.from);
        let back = 2.0 * REACH * self.half_palm * away;
        let offset = arm * Vector3::new(self.miss, -back, 0.0);
        let at = object.coords * NEARER + offset;
        Some(Isometry3::from_parts(Translation3::from(at), arm))
    }
}

/// Returns a hand with its palm at the origin, the fingers along y and the arm along -y.
fn hand() -> Solid {
    let (palm, arm) = (
        Vector3::new(0.09, 0.09, 0.03),
        Vector3::new(0.07, 0.35, 0.06),
    );
    let finger = Solid::cuboid(Vector3::new(0.018, 0.08, 0.018), 1);
    let at = Isometry3::translation;
    [-0.033, -0.011, 0.011, 0.033].iter().fold(
        Solid::cuboid(palm, 1).with(&Solid::cuboid(arm, 1), &at(0.0, -0.2, 0.0)),
        |hand, x| hand.with(&finger, &at(*x, 0.08, 0.0)),
    )
}

//! Stop rules on the motion of the object.

use hicp_core::{Isometry3, Iteration, Point3, Problem, Translation3, se3};

use crate::outcome::Termination;
use crate::stop::stop_rule::{Judgment, Progress, StopRule};

/// Returns the rotation angle, degrees, and the distance of the object's center, meters, between
/// two poses.
///
/// The origin of the object's frame may be far from the object, where a small rotation moves it a
/// long way. Without a source, the origin counts as the center.
pub(crate) fn object_motion(
    problem: &Problem<'_>,
    a: &Isometry3<f64>,
    b: &Isometry3<f64>,
) -> (f64, f64) {
    let center = problem
        .source()
        .map_or_else(Point3::origin, |source| source.center());
    let at_center = Translation3::from(center);
    let (angle, distance) = se3::pose_distance(&(a * at_center), &(b * at_center));
    (angle.to_degrees(), distance)
}

/// Ends a stage as converged if the next increment would hardly move the object.
///
/// The displacement of the object's center *and* the rotation angle must be below their limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmallMotion {
    /// Largest displacement of the object's center, meters.
    pub translation_meters: f64,
    /// Largest rotation angle, degrees.
    pub rotation_degrees: f64,
}

impl Default for SmallMotion {
    /// A tenth of a millimeter and a hundredth of a degree.
    fn default() -> Self {
        Self {
            translation_meters: 1e-4,
            rotation_degrees: 0.01,
        }
    }
}

impl StopRule for SmallMotion {
    fn check(&mut self, iteration: &Iteration<'_>, progress: &Progress<'_>) -> Judgment {
        let pose = progress.camera_from_object;
        let next = progress.increment * pose;
        let (degrees, meters) = object_motion(&iteration.problem, &next, pose);
        let still = meters < self.translation_meters && degrees < self.rotation_degrees;
        Judgment::accept_if(still, Termination::Converged)
    }

    fn name(&self) -> &'static str {
        "motion"
    }
}

/// Rejects a pose that is too far from the stage's initial pose.
///
/// A wrong match must not move a good detection away. The distance is that of the object's center.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    /// Largest distance, meters.
    pub translation_meters: f64,
    /// Largest angle, degrees.
    pub rotation_degrees: f64,
}

impl Default for Bound {
    /// Ten centimeters and 45°.
    fn default() -> Self {
        Self {
            translation_meters: 0.1,
            rotation_degrees: 45.0,
        }
    }
}

impl Bound {
    /// Returns whether a pose of the problem's source lies within the bound around an initial pose.
    #[must_use]
    pub fn contains(
        &self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        pose: &Isometry3<f64>,
    ) -> bool {
        let (degrees, meters) = object_motion(problem, pose, init);
        meters <= self.translation_meters && degrees <= self.rotation_degrees
    }
}

impl StopRule for Bound {
    fn check(&mut self, iteration: &Iteration<'_>, progress: &Progress<'_>) -> Judgment {
        let pose = progress.camera_from_object;
        if self.contains(&iteration.problem, &iteration.init, pose) {
            Judgment::Continue
        } else {
            Judgment::Reject(Termination::OutOfBounds)
        }
    }

    fn name(&self) -> &'static str {
        "bound"
    }
}

/// Ends a stage whose pose returns to that of two or three iterations before.
///
/// Correspondences then flip back and forth. The stage ends with [`Termination::Oscillating`] and
/// accepts the last evaluated pose. The distance is that of the object's center.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Oscillation {
    /// Distance within which two poses are equal, meters.
    pub translation_meters: f64,
    /// Angle within which two poses are equal, degrees.
    pub rotation_degrees: f64,
    /// The last poses, newest first.
    recent: [Option<Isometry3<f64>>; 3],
}

impl Oscillation {
    /// Creates the rule from a distance in meters and an angle in degrees.
    #[must_use]
    pub fn new(translation_meters: f64, rotation_degrees: f64) -> Self {
        Self {
            translation_meters,
            rotation_degrees,
            recent: [None; 3],
        }
    }

    fn same(&self, problem: &Problem<'_>, a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
        let (degrees, meters) = object_motion(problem, a, b);
        meters <= self.translation_meters && degrees <= self.rotation_degrees
    }
}

impl Default for Oscillation {
    /// A hundredth of a millimeter and a thousandth of a degree.
    fn default() -> Self {
        Self::new(1e-5, 1e-3)
    }
}

impl StopRule for Oscillation {
    fn start(&mut self) {
        self.recent = [None; 3];
    }

    fn check(&mut self, iteration: &Iteration<'_>, progress: &Progress<'_>) -> Judgment {
        let pose = progress.camera_from_object;
        let same = |other: &Isometry3<f64>| self.same(&iteration.problem, other, pose);
        let [last, older @ ..] = &self.recent;
        // A pose that does not move has converged and does not oscillate.
        let moved = last.is_some_and(|last| !same(&last));
        let returned = older.iter().flatten().any(same);
        self.recent.rotate_right(1);
        self.recent[0] = Some(*pose);
        Judgment::accept_if(moved && returned, Termination::Oscillating)
    }

    fn name(&self) -> &'static str {
        "oscillation"
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::Evaluation;
    use hicp_core::{Cloud, UnitQuaternion, Vector3};

    fn at(x: f64) -> Isometry3<f64> {
        Isometry3::translation(x, 0.0, 0.5)
    }

    fn check(
        rule: &mut dyn StopRule,
        pose: &Isometry3<f64>,
        increment: &Isometry3<f64>,
    ) -> Judgment {
        check_in(&Problem::default(), rule, pose, increment)
    }

    fn check_in(
        problem: &Problem<'_>,
        rule: &mut dyn StopRule,
        pose: &Isometry3<f64>,
        increment: &Isometry3<f64>,
    ) -> Judgment {
        let current = Evaluation {
            n_pairs: 10,
            mean_loss: 1.0,
        };
        let iteration = Iteration::new(0, &at(0.0), *problem);
        rule.check(
            &iteration,
            &Progress {
                current,
                first: current,
                previous: None,
                camera_from_object: pose,
                increment,
                pairs: &hicp_core::Correspondences::new(),
            },
        )
    }

    #[test]
    fn small_motion_needs_a_small_distance_and_a_small_angle() {
        let mut rule = SmallMotion::default();
        let turn = Isometry3::rotation(Vector3::z() * 1e-3);
        let judge = |rule: &mut SmallMotion, increment| check(rule, &at(0.0), &increment);
        assert_ne!(
            judge(&mut rule, Isometry3::translation(0.9e-4, 0.0, 0.0)),
            Judgment::Continue
        );
        assert_eq!(
            judge(&mut rule, Isometry3::translation(1.1e-4, 0.0, 0.0)),
            Judgment::Continue
        );
        assert_eq!(judge(&mut rule, turn), Judgment::Continue);
        // The angle counts by itself: a rotation around the object's origin does not move that
        // origin.
        let about =
            Isometry3::translation(0.0, 0.0, 0.5) * turn * Isometry3::translation(0.0, 0.0, -0.5);
        assert_eq!(judge(&mut rule, about), Judgment::Continue);
    }

    /// Fails if lengths are compared with squares of lengths, or cosines with angles.
    #[test]
    fn limits_are_meters_and_degrees_not_squares_or_cosines() {
        let origin = Isometry3::identity();
        let turn = |degrees: f64| Isometry3::rotation(Vector3::y() * degrees.to_radians());
        let shift = |meters: f64| Isometry3::translation(0.0, meters, 0.0);
        for (meters, degrees) in [(1e-4, 0.01), (0.02, 3.0), (0.5, 170.0)] {
            let mut motion = SmallMotion {
                translation_meters: meters,
                rotation_degrees: degrees,
            };
            let mut bound = Bound {
                translation_meters: meters,
                rotation_degrees: degrees,
            };
            let mut oscillation = Oscillation::new(meters, degrees);
            for (by, small) in [(0.999, true), (1.001, false)] {
                for moved in [shift(meters * by), turn(degrees * by)] {
                    assert_eq!(
                        check(&mut motion, &origin, &moved) != Judgment::Continue,
                        small
                    );
                    // The initial pose is `at(0.0)`.
                    let pose = at(0.0) * moved;
                    assert_eq!(
                        check(&mut bound, &pose, &origin) == Judgment::Continue,
                        small
                    );
                    // At the origin, far away, and back near the origin.
                    oscillation.start();
                    assert_eq!(
                        check(&mut oscillation, &origin, &origin),
                        Judgment::Continue
                    );
                    assert_eq!(
                        check(&mut oscillation, &at(10.0), &origin),
                        Judgment::Continue
                    );
                    assert_eq!(
                        check(&mut oscillation, &moved, &origin) != Judgment::Continue,
                        small
                    );
                }
            }
        }
    }

    /// The object is 1 km from the origin of its frame, which the rotation moves by 9 mm.
    #[test]
    fn distances_are_those_of_the_center() {
        let center = Point3::new(600.0, 0.0, 800.0);
        let cloud = Cloud::without_normals([center.cast()]);
        let problem = Problem::new(&cloud, &cloud);
        let (pose, turn) = (at(0.0), Vector3::y() * f64::to_radians(5e-4));
        let turned = pose * Isometry3::rotation_wrt_point(UnitQuaternion::new(turn), center);
        let increment = turned * pose.inverse();
        let check = |rule: &mut dyn StopRule, pose: &Isometry3<f64>| {
            check_in(&problem, rule, pose, &increment)
        };
        let mut motion = SmallMotion::default();
        assert_ne!(check(&mut motion, &pose), Judgment::Continue);
        let mut bound = Bound {
            translation_meters: 1e-6,
            ..Bound::default()
        };
        assert_eq!(check(&mut bound, &turned), Judgment::Continue);
        let mut oscillation = Oscillation::default();
        assert_eq!(check(&mut oscillation, &pose), Judgment::Continue);
        assert_eq!(check(&mut oscillation, &at(0.1)), Judgment::Continue);
        assert_ne!(check(&mut oscillation, &turned), Judgment::Continue);
    }

    #[test]
    fn bounds_reject_poses_outside() {
        let mut rule = Bound::default();
        let still = Isometry3::identity();
        assert_eq!(check(&mut rule, &at(0.1), &still), Judgment::Continue);
        let verdict = check(&mut rule, &at(0.101), &still);
        assert_eq!(verdict, Judgment::Reject(Termination::OutOfBounds));
    }

    #[test]
    fn returning_poses_oscillate_and_resting_poses_do_not() {
        let still = Isometry3::identity();
        let run = |rule: &mut Oscillation, poses: &[f64]| {
            rule.start();
            poses
                .iter()
                .map(|x| check(rule, &at(*x), &still) != Judgment::Continue)
                .collect::<Vec<_>>()
        };
        let mut rule = Oscillation::default();
        let to_and_fro = [false, false, true];
        assert_eq!(run(&mut rule, &[0.0, 0.01, 0.0]), to_and_fro);
        assert_eq!(
            run(&mut rule, &[0.0, 0.01, 0.02, 0.0]),
            [false, false, false, true]
        );
        assert_eq!(run(&mut rule, &[0.0, 0.0, 0.0]), [false; 3]);
        // A new run does not remember the last one.
        assert_eq!(run(&mut rule, &[0.0, 0.01, 0.0]), to_and_fro);
    }
}

//! The motion of an object: a filter that predicts its pose and knows how uncertain it is.

use hicp_core::internal::small::{blocks, eigen6, inverse6};
use hicp_core::{Isometry3, Matrix3, Matrix6, Point3, UnitVector3, Vector6, so3};

use crate::extent::{Extent, difference, moved, squares};

/// Largest speed (m/s and rad/s) and time constant (seconds).
const MAX: f64 = 1e3;
/// Smallest time constant, seconds.
const MIN_SECONDS: f64 = 1e-3;
/// Largest distance of the pose from a measured one, in standard deviations of the measurement.
const MAX_DEVIATIONS: f64 = 4.0;

/// A filter over the pose and the velocity of an object, in the camera frame.
///
/// Translation is that of the object's center, so that a rotation of the object does not move it.
/// Velocities decay with a time constant and have random accelerations (an Ornstein–Uhlenbeck
/// process): the object is predicted to move on at constant velocity for a short time, and to come
/// to rest in a long one. All vectors are [translation; rotation], meters and radians.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    /// Center of the object in its own frame, meters.
    center: Point3<f64>,
    /// Standard deviations of the velocity in the long run, squared.
    speeds: Vector6<f64>,
    /// The time in which a velocity decays, seconds.
    memory: f64,
    pose: Isometry3<f64>,
    velocity: Vector6<f64>,
    /// Covariance of the pose, of pose and velocity, and of the velocity.
    of_pose: Matrix6<f64>,
    of_both: Matrix6<f64>,
    of_velocity: Matrix6<f64>,
}

impl Motion {
    /// Creates the filter at a pose known up to `deviations` (meters, radians).
    pub(super) fn new(
        center: Point3<f64>,
        pose: &Isometry3<f64>,
        deviations: [f64; 2],
        speeds: [f64; 2],
        memory: f64,
    ) -> Self {
        let usable = |x: f64| {
            if x.is_finite() {
                x.clamp(0.0, MAX)
            } else {
                MAX
            }
        };
        let speeds = squares(speeds.map(usable));
        Self {
            center,
            speeds,
            memory: usable(memory).max(MIN_SECONDS),
            pose: *pose,
            velocity: Vector6::zeros(),
            of_pose: Matrix6::from_diagonal(&squares(deviations)),
            of_both: Matrix6::zeros(),
            of_velocity: Matrix6::from_diagonal(&speeds),
        }
    }

    /// Returns the pose, `camera_from_object`.
    pub(super) fn pose(&self) -> &Isometry3<f64> {
        &self.pose
    }

    /// Returns the velocity of the center and the angular velocity, m/s and rad/s.
    pub(super) fn velocity(&self) -> &Vector6<f64> {
        &self.velocity
    }

    /// Returns the center of the object in the camera frame, meters.
    pub(super) fn center(&self) -> Point3<f64> {
        self.pose * self.center
    }

    /// Returns the covariance of the pose.
    pub(super) fn covariance(&self) -> &Matrix6<f64> {
        &self.of_pose
    }

    /// Returns the standard deviation of the least determined displacement of an object, meters.
    pub(super) fn deviation(&self, extent: &Extent) -> f64 {
        extent.deviation(&self.pose, &self.of_pose)
    }

    /// Returns the axis of the least certain displacement and a point on it, if it is a rotation.
    ///
    /// Objects with declared axes of symmetry have none.
    pub(super) fn open_axis(&self, extent: &Extent) -> Option<(UnitVector3<f64>, Point3<f64>)> {
        let scale = extent.scale(&self.pose);
        let eigen = eigen6(&(scale * self.of_pose * scale.transpose()))?;
        let least = eigen.eigenvectors.column(eigen.eigenvalues.imax());
        if least.fixed_rows::<3>(3).norm() < 0.7 {
            return None;
        }
        let step = inverse6(&scale)? * least;
        let (shift, turn) = (step.fixed_rows::<3>(0), step.fixed_rows::<3>(3));
        let point = self.center() + turn.cross(&shift) / turn.norm_squared();
        Some((UnitVector3::new_normalize(turn.into_owned()), point))
    }

    /// Moves the pose by a time in seconds.
    pub(super) fn predict(&mut self, seconds: f64) {
        let share = seconds / self.memory;
        let decay = (-share).exp();
        let reach = self.memory * (1.0 - decay);
        self.apply(&(self.velocity * reach));
        self.velocity *= decay;
        let noise = |factor: f64| Matrix6::from_diagonal(&(self.speeds * factor));
        let squared = self.memory * self.memory;
        self.of_pose += (self.of_both + self.of_both.transpose()) * reach
            + self.of_velocity * (reach * reach)
            + noise(squared * (2.0 * share - 3.0 + 4.0 * decay - decay * decay));
        self.of_both = (self.of_both + self.of_velocity * reach) * decay
            + noise(self.memory * (1.0 - decay).powi(2));
        self.of_velocity = self.of_velocity * (decay * decay) + noise(1.0 - decay * decay);
    }

    /// Combines the prediction with a measured pose of a covariance.
    ///
    /// Returns `true` if the measurement does not contradict the result.
    pub(super) fn update(&mut self, measured: &Isometry3<f64>, covariance: &Matrix6<f64>) -> bool {
        let away = difference(measured, &self.pose, &self.center);
        // The same directions of the object, at the predicted pose.
        let back = rotation(&-away);
        let Some(inverse) = inverse6(&(self.of_pose + back * covariance * back.transpose())) else {
            return false;
        };
        let (of_pose, of_velocity) = (self.of_pose * inverse, self.of_both.transpose() * inverse);
        self.velocity += of_velocity * away;
        self.of_velocity -= of_velocity * self.of_both;
        self.of_both -= of_pose * self.of_both;
        self.of_pose -= of_pose * self.of_pose;
        self.apply(&(of_pose * away));
        for covariance in [&mut self.of_pose, &mut self.of_velocity] {
            *covariance = (*covariance + covariance.transpose()) * 0.5;
        }
        let left = difference(measured, &self.pose, &self.center);
        inverse6(covariance).is_some_and(|information| {
            left.dot(&(information * left)) <= MAX_DEVIATIONS * MAX_DEVIATIONS
        })
    }

    /// Moves the center and rotates the object around it, and with it its uncertain directions.
    ///
    /// An example is the axis of a mug whose handle is hidden. If the covariances did not rotate
    /// with it, a tilt of the axis would count as a rotation around it.
    fn apply(&mut self, step: &Vector6<f64>) {
        self.pose = moved(&self.pose, &self.center, step);
        let turn = rotation(step);
        for covariance in [&mut self.of_pose, &mut self.of_both, &mut self.of_velocity] {
            *covariance = turn * *covariance * turn.transpose();
        }
    }
}

/// Returns the map from uncertain displacements before a rotation to those after it.
///
/// Those of the center stay.
fn rotation(step: &Vector6<f64>) -> Matrix6<f64> {
    let turn = so3::exp(&step.fixed_rows::<3>(3).into_owned()).to_rotation_matrix();
    blocks(&Matrix3::identity(), &Matrix3::zeros(), turn.matrix())
}

#[cfg(test)]
mod tests {
    use hicp_core::internal::small::join;
    use hicp_core::{Translation3, UnitQuaternion, Vector3};

    use super::*;

    fn motion() -> Motion {
        let center = Point3::new(0.1, 0.0, 0.05);
        let pose = Isometry3::translation(0.0, 0.1, 0.8);
        Motion::new(center, &pose, [0.02, 0.2], [0.3, 1.5], 0.5)
    }

    #[test]
    fn constant_velocities_are_predicted_after_a_few_measurements() {
        let (mut motion, seconds) = (motion(), 1.0 / 30.0);
        let (center, start) = (motion.center, motion.pose);
        let precise = Matrix6::identity() * 1e-8;
        let truth = |frame: i32| {
            let time = f64::from(frame) * seconds;
            let rotation = so3::exp(&(Vector3::new(0.5, -1.0, 0.3) * time)) * start.rotation;
            let at = start * center + Vector3::new(0.2, -0.1, 0.1) * time;
            let shift = at - rotation * center;
            Isometry3::from_parts(Translation3::from(shift), rotation)
        };
        for frame in 1..30 {
            motion.predict(seconds);
            let off = difference(&truth(frame), motion.pose(), &center);
            if frame > 10 {
                // The decay of the velocity costs 3 % of a frame's motion.
                assert!(off.norm() < 0.003, "{frame}: {off}");
            }
            motion.update(&truth(frame), &precise);
        }
    }

    #[test]
    fn predictions_add_up_and_become_less_certain() {
        let (mut once, mut often) = (motion(), motion());
        once.velocity = Vector6::new(0.1, 0.0, 0.2, 0.0, 0.0, 0.4);
        often.velocity = once.velocity;
        let before = once.of_pose.trace();
        once.predict(0.3);
        for _ in 0..30 {
            often.predict(0.01);
        }
        assert!(difference(once.pose(), often.pose(), &once.center).norm() < 1e-9);
        assert!((once.of_pose - often.of_pose).norm() < 1e-9);
        assert!((once.of_velocity - often.of_velocity).norm() < 1e-9);
        assert!(once.of_pose.trace() > before);
    }

    /// An example is the axis of a mug whose handle is hidden.
    #[test]
    fn an_unknown_rotation_stays_unknown_while_its_axis_turns() {
        let seconds = 1.0 / 30.0;
        // The deviation around the axis after 2 s, and the rotation around it that noise adds.
        let track = |speed: f64, noise: f64| {
            let mut motion = motion();
            let (start, center) = (motion.pose, motion.center);
            let (mut axis, mut turned) = (Vector3::z(), UnitQuaternion::identity());
            for frame in 1..60 {
                let time = f64::from(frame);
                turned = so3::exp(&(Vector3::x() * (speed * time * seconds)));
                let [x, y] = [3.0 * time, 4.0 * time].map(|phase| noise * phase.sin());
                axis = turned * Vector3::new(x, y, 1.0).normalize();
                motion.predict(seconds);
                // The registration finds the axis, and keeps the angle around it.
                let tilt = UnitQuaternion::rotation_between(&(motion.pose * Vector3::z()), &axis);
                let rotation = tilt.unwrap() * motion.pose.rotation;
                let shift = start * center - rotation * center;
                let measured = Isometry3::from_parts(Translation3::from(shift), rotation);
                let unknown = join(&Vector3::zeros(), &axis);
                let covariance = Matrix6::identity() * 2.5e-5 + unknown * unknown.transpose();
                motion.update(&measured, &covariance);
            }
            let axis = join(&Vector3::zeros(), &axis);
            let variance = axis.dot(&(motion.covariance() * axis));
            let off = so3::log(&(turned.inverse() * motion.pose.rotation));
            (variance.sqrt(), off.z)
        };
        let (still, _) = track(0.0, 0.0);
        for (speed, noise) in [(0.0, 0.01), (1.5, 0.0), (1.5, 0.01), (3.0, 0.01)] {
            let (deviation, off) = track(speed, noise);
            assert!((deviation / still - 1.0).abs() < 0.01 && off.abs() < 0.01);
        }
    }
}

//! Smooth random motions of an object.

use hicp_core::{Isometry3, Point3, Translation3, Vector3, so3};

use crate::SimRng;
use crate::clutter::within;
use crate::error::{SimError, check_range};
use crate::sampling::{rotation, unit_vector};

/// Periods of the waves, seconds.
const PERIODS: std::ops::Range<f64> = 2.0..4.0;
/// Highest speed of a motion, as a share of the limit.
const PEAK: std::ops::Range<f64> = 0.5..1.0;
/// Number of waves per motion.
const WAVES: usize = 2;

/// The limits of a smooth random motion.
///
/// The velocity and the angular velocity are each a sum of two waves with periods of 2 to 4 s. The
/// highest speed of a motion is drawn between half of the limit and the limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trajectory {
    /// Largest speed of the object's center, m/s.
    pub meters_per_second: f64,
    /// Largest angular speed, degrees per second.
    pub degrees_per_second: f64,
    /// Number of poses per second.
    pub frames_per_second: f64,
}

impl Default for Trajectory {
    /// Returns 0.3 m/s, 90°/s and 30 poses per second.
    fn default() -> Self {
        Self {
            meters_per_second: 0.3,
            degrees_per_second: 90.0,
            frames_per_second: 30.0,
        }
    }
}

impl Trajectory {
    /// Draws a motion of `frames` poses (`camera_from_object`) from a random orientation.
    ///
    /// `center` is the object's center in its own frame. Its mean in the camera frame is `mean`,
    /// and at the default speed it stays within 0.3 m of it.
    ///
    /// # Errors
    ///
    /// [`SimError::Parameter`] if a speed or a rate is out of its range.
    pub fn draw(
        &self,
        rng: &mut SimRng,
        center: &Point3<f64>,
        mean: &Point3<f64>,
        frames: usize,
    ) -> Result<Vec<Isometry3<f64>>, SimError> {
        check_range("speed in m/s", self.meters_per_second, 0.0..=100.0)?;
        check_range("speed in degrees/s", self.degrees_per_second, 0.0..=1e4)?;
        check_range("frames per second", self.frames_per_second, 0.1..=1e4)?;
        let (seconds, mut turned) = (1.0 / self.frames_per_second, rotation(rng));
        let shifts = velocities(rng, frames, seconds, self.meters_per_second);
        let turns = velocities(rng, frames, seconds, self.degrees_per_second.to_radians());
        let mut away = Vector3::zeros();
        let path: Vec<Vector3<f64>> = shifts
            .into_iter()
            .map(|velocity| {
                let here = away;
                away += velocity * seconds;
                here
            })
            .collect();
        let first = mean.coords - path.iter().sum::<Vector3<f64>>() / frames.max(1) as f64;
        let poses = path.into_iter().zip(turns).map(|(away, turn)| {
            let shift = first + away - turned * center.coords;
            let pose = Isometry3::from_parts(Translation3::from(shift), turned);
            turned = so3::exp(&(turn * seconds)) * turned;
            pose
        });
        Ok(poses.collect())
    }
}

/// Draws velocities between successive frames, with a highest speed of half of `limit` to `limit`.
fn velocities(rng: &mut SimRng, frames: usize, seconds: f64, limit: f64) -> Vec<Vector3<f64>> {
    let peak = limit * within(rng, &PEAK);
    let waves = [(); WAVES].map(|()| {
        let (period, phase) = (within(rng, &PERIODS), within(rng, &(0.0..1.0)));
        (unit_vector(rng), period, phase)
    });
    let at = |frame: usize| {
        let time = (frame as f64 + 0.5) * seconds;
        let waves = waves.iter().map(|(direction, period, phase)| {
            direction * (std::f64::consts::TAU * (time / period + phase)).sin()
        });
        waves.sum::<Vector3<f64>>()
    };
    let raw: Vec<Vector3<f64>> = (0..frames).map(at).collect();
    let fastest = raw.iter().map(Vector3::norm).fold(1e-9, f64::max);
    raw.into_iter().map(|v| v * (peak / fastest)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng;

    #[test]
    fn the_highest_speeds_are_between_half_of_the_limits_and_the_limits() {
        let limits = Trajectory::default();
        let (center, mean) = (Point3::new(0.1, 0.0, 0.2), Point3::new(0.0, 0.1, 0.7));
        for seed in 0..20 {
            let poses = limits.draw(&mut rng(seed), &center, &mean, 120).unwrap();
            assert_eq!(poses.len(), 120);
            let sum: Vector3<f64> = poses.iter().map(|pose| (pose * center).coords).sum();
            assert!((sum / 120.0 - mean.coords).norm() < 1e-12);
            let (mut speed, mut turning, mut away) = (0.0_f64, 0.0_f64, 0.0_f64);
            for pair in poses.windows(2) {
                let (a, b) = (pair[0] * center, pair[1] * center);
                speed = speed.max((b - a).norm() * 30.0);
                turning = turning.max(pair[0].rotation.angle_to(&pair[1].rotation) * 30.0);
                away = away.max((b - mean).norm());
            }
            assert!((0.14..0.3 + 1e-9).contains(&speed), "{speed}");
            assert!(
                (44.0..90.0 + 1e-6).contains(&turning.to_degrees()),
                "{turning}"
            );
            assert!(away < 0.3, "{away}");
        }
    }
}

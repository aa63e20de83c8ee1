//! Image sequences of a moving object, with hands that pass in front.

use hicp_core::{Isometry3, Model, PinholeCamera, Point3};
use rand::RngExt;

use crate::SimRng;
use crate::clutter::{Clutter, ClutterView, compose, looking_at_center, within};
use crate::error::{SimError, check_range};
use crate::hand::Passage;
use crate::sensor::DepthSensor;
use crate::trajectory::Trajectory;

/// Distance of the camera from the center of the table, meters.
const TABLE_METERS: f64 = 1.5;
/// Elevation of the camera above the table, degrees.
const ELEVATION_DEGREES: std::ops::Range<f64> = 40.0..65.0;
/// Mean distance of the object, meters.
const MEAN_METERS: std::ops::Range<f64> = 0.6..0.8;
/// Largest mean of the object's x and y, meters.
const MEAN_ASIDE_METERS: f64 = 0.08;
/// Part of a sequence before and after the object is hidden, seconds.
const SEEN_SECONDS: f64 = 0.5;

/// The hand in a [`MovingScene`].
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Hand {
    /// No hand.
    #[default]
    Absent,
    /// A hand passes in front of the object and hides a part of it at a time.
    Passing,
    /// A hand hides the whole object for a time in this range, seconds.
    ///
    /// It comes and leaves within 0.3 s each. The object continues to move behind it.
    Covering(std::ops::Range<f64>),
}

/// The parameters of a [`MovingScene`].
#[derive(Clone, Debug, PartialEq)]
pub struct MovingConfig {
    /// The motion of the object.
    pub trajectory: Trajectory,
    /// Number of images.
    pub frames: usize,
    /// Number of objects that stand on the table, behind the moving one.
    ///
    /// Those of the same model as the moving one are left out.
    pub standing: usize,
    /// The hand.
    pub hand: Hand,
}

impl Default for MovingConfig {
    /// Returns 60 frames with three standing objects and no hand.
    fn default() -> Self {
        Self {
            trajectory: Trajectory::default(),
            frames: 60,
            standing: 3,
            hand: Hand::Absent,
        }
    }
}

/// An object that moves above a table with other objects, seen by a camera that stands still.
///
/// ```
/// use hicp_core::PinholeCamera;
/// use hicp_sim::{DepthSensor, Household, MovingConfig, MovingScene, rng};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let models = [Household::Mug.model()?, Household::Book.model()?];
/// let scene = MovingScene::draw(&mut rng(1), &models, 0, &MovingConfig::default())?;
/// let camera = PinholeCamera::new(285.0, 285.0, 159.5, 119.5, 320, 240)?;
/// let view = scene.view(&mut rng(2), 30, &models, &camera, &DepthSensor::default())?;
/// // The moving object is the first.
/// assert_eq!(view.instances[0].model, 0);
/// assert_eq!(view.instances[0].visible, view.instances[0].silhouette);
/// # Ok(()) }
/// ```
#[derive(Clone, Debug)]
pub struct MovingScene {
    /// Poses of the moving object in the camera frame, one per image.
    pub poses: Vec<Isometry3<f64>>,
    /// Index of its model.
    pub model: usize,
    /// The images in which a covering hand hides it; empty without one.
    pub hidden: std::ops::Range<usize>,
    clutter: Option<Clutter>,
    camera_from_world: Isometry3<f64>,
    center: Point3<f64>,
    seconds_per_frame: f64,
    hand: Option<Passage>,
}

impl MovingScene {
    /// Draws a scene in which the object `models[model]` moves. The others are of `models`, too.
    ///
    /// # Errors
    ///
    /// [`SimError::Parameter`] if a parameter is out of its range, or if the sequence is too short
    /// for the hand.
    pub fn draw(
        rng: &mut SimRng,
        models: &[Model],
        model: usize,
        config: &MovingConfig,
    ) -> Result<Self, SimError> {
        let last = models.len() as f64 - 1.0;
        check_range("index of the moving model", model as f64, 0.0..=last)?;
        check_range("number of frames", config.frames as f64, 1.0..=1e6)?;
        let mut clutter = match config.standing {
            0 => None,
            count => Some(Clutter::draw(rng, models, count)?),
        };
        // Nothing could tell a twin from an object that was hidden.
        if let Some(clutter) = &mut clutter {
            clutter.objects.retain(|object| object.model != model);
        }
        let elevation = within(rng, &ELEVATION_DEGREES).to_radians();
        let azimuth = within(rng, &(0.0..std::f64::consts::TAU));
        let mut aside = || MEAN_ASIDE_METERS * (2.0 * rng.random::<f64>() - 1.0);
        let mean = Point3::new(aside(), aside(), within(rng, &MEAN_METERS));
        let (center, radius) = (models[model].center(), models[model].radius());
        let poses = config.trajectory.draw(rng, &center, &mean, config.frames)?;
        let seconds_per_frame = 1.0 / config.trajectory.frames_per_second;
        let seconds = config.frames as f64 * seconds_per_frame;
        let mut hidden = (0.0, 0.0);
        let hand = match &config.hand {
            Hand::Absent => None,
            Hand::Passing => {
                let at = within(rng, &(0.25 * seconds..0.75 * seconds));
                Some(Passage::partial(rng, radius, at)?)
            }
            Hand::Covering(range) => {
                let time = within(rng, range);
                let free = seconds - time - 2.0 * SEEN_SECONDS;
                check_range("seconds before and after the hand", free, 0.0..=1e6)?;
                let from = SEEN_SECONDS + within(rng, &(0.0..free));
                hidden = (from, from + time);
                Some(Passage::covering(rng, radius, hidden)?)
            }
        };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // Not negative, below the number of frames.
        let [from, to] = [hidden.0, hidden.1].map(|t| (t / seconds_per_frame).ceil() as usize);
        Ok(Self {
            poses,
            model,
            hidden: from..to,
            clutter,
            camera_from_world: looking_at_center(elevation, azimuth, TABLE_METERS),
            center,
            seconds_per_frame,
            hand,
        })
    }

    /// Observes the scene at a frame. The first instance is the moving object.
    ///
    /// `models` must be those from which the scene was drawn. Cost: one render per object, and the
    /// cost of the sensor.
    ///
    /// # Errors
    ///
    /// [`SimError::Parameter`] if there is no such frame; as for [`DepthSensor::measure`].
    pub fn view(
        &self,
        rng: &mut SimRng,
        frame: usize,
        models: &[Model],
        camera: &PinholeCamera,
        sensor: &DepthSensor,
    ) -> Result<ClutterView, SimError> {
        let last = self.poses.len() as f64 - 1.0;
        check_range("frame", frame as f64, 0.0..=last)?;
        let pose = self.poses[frame];
        let standing = self.clutter.iter().flat_map(|clutter| &clutter.objects);
        let standing = standing.map(|o| (o.model, self.camera_from_world * o.world_from_object));
        let hand = self.hand.as_ref().and_then(|hand| {
            let seconds = frame as f64 * self.seconds_per_frame;
            let at = hand.pose(&(pose * self.center), seconds)?;
            Some((&hand.mesh, at))
        });
        let objects = std::iter::once((self.model, pose)).chain(standing);
        compose(
            rng,
            self.camera_from_world,
            objects,
            hand,
            models,
            camera,
            sensor,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Household, stream};

    fn share(view: &ClutterView) -> f64 {
        let count = |mask: &hicp_core::Mask| mask.n_set() as f64;
        let moving = &view.instances[0];
        count(&moving.visible) / count(&moving.silhouette)
    }

    #[test]
    fn hands_hide_a_part_or_the_whole_object_for_the_stated_time() {
        let models = [Household::Mug, Household::Pan, Household::Knife].map(|o| o.model().unwrap());
        let camera = PinholeCamera::new(285.0, 285.0, 159.5, 119.5, 320, 240).unwrap();
        let look = |hand: &Hand, index| {
            let mut rng = stream(1, &["moving"], index as u64);
            let config = MovingConfig {
                frames: 150,
                hand: hand.clone(),
                ..MovingConfig::default()
            };
            let scene = MovingScene::draw(&mut rng, &models, index, &config).unwrap();
            let shares = (0..150).step_by(3).map(|frame| {
                let sensor = DepthSensor::default();
                share(
                    &scene
                        .view(&mut rng, frame, &models, &camera, &sensor)
                        .unwrap(),
                )
            });
            (shares.collect::<Vec<_>>(), scene.hidden)
        };
        for index in 0..3 {
            let (shares, hidden) = look(&Hand::Absent, index);
            assert!(shares.iter().all(|s| *s == 1.0) && hidden.is_empty());
            let (shares, _) = look(&Hand::Passing, index);
            let least = shares.iter().copied().fold(1.0, f64::min);
            assert!((0.0..0.95).contains(&least), "{least}");
            let (shares, hidden) = look(&Hand::Covering(1.0..3.0), index);
            assert!((29..=91).contains(&hidden.len()), "{hidden:?}");
            for (frame, share) in (0..).step_by(3).zip(shares) {
                if hidden.contains(&frame) {
                    assert!(share < 1e-3, "{frame}: {share}");
                }
                // The hand comes and leaves within 9 frames.
                if frame + 10 < hidden.start || frame > hidden.end + 10 {
                    assert!(share == 1.0, "{frame}: {share}");
                }
            }
        }
    }

    #[test]
    fn sequences_that_are_too_short_for_the_hand_are_refused() {
        let models = [Household::Mug.model().unwrap()];
        let config = MovingConfig {
            hand: Hand::Covering(3.0..4.0),
            ..MovingConfig::default()
        };
        let error = MovingScene::draw(&mut crate::rng(1), &models, 0, &config).unwrap_err();
        assert!(error.to_string().contains("before and after"), "{error}");
    }
}

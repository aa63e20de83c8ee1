//! Tracking of a moving object from image to image.

mod finder;
mod found;
mod matcher;
mod motion;
mod region;
mod rejections;
mod segments;
mod tracked;

use std::sync::Arc;

use hicp_core::internal::check_size;
use hicp_core::{DepthImage, Isometry3, Mask, Matrix6, Model, PinholeCamera, Vector3, se3};
use hicp_score::Evidence;

use self::finder::{CERTAIN, CLEARLY};
use self::found::Found;
use self::matcher::Matcher;
use self::motion::Motion;
pub use self::tracked::{TrackError, TrackState, Tracked, TrackerConfig};

/// Standard deviation of the pose at the start, in radii of the object and in radians.
const START_RADII: f64 = 0.2;
/// Standard deviation of a pose that was searched, until the image determines it.
const SEARCHED_RADII: f64 = 0.3;
/// Largest deviation of a pose with the state [`TrackState::Tracking`], in diameters.
const SURE_DIAMETERS: f64 = 0.05;
/// Time for which a pose that was searched has to be seen before it counts as right, seconds.
const TRIAL_SECONDS: f64 = 1.0;
/// Rise of the unexplained share of the pixels at which other rotations are tried.
const APPEARED: f64 = 0.03;
/// Largest deviation of a prediction near which a registration need not be sure, in diameters.
const NEAR_DIAMETERS: f64 = 0.4;

/// Follows a moving object from depth image to depth image, without masks.
///
/// A motion filter predicts the pose at constant velocity. The object is registered in the pixels
/// around its predicted silhouette whose depth is near the predicted one, so it may lie in a hand
/// or on a table, and neither the camera nor the object has to stand still. The filter combines
/// both. It also determines the directions in which the pose is uncertain, for example the rotation
/// of a mug whose handle is hidden. If the combined pose is far from the registered one, for
/// example because a time is wrong, the filter starts again from the registered one, at rest.
///
/// The [`Evidence`] at the pose decides about the state. A hidden pixel is never evidence for a
/// pose: an object that is hidden entirely is lost after [`TrackerConfig::coast_seconds`]. The
/// tracker then searches for it where it was last seen, and among surfaces of about its size, in a
/// region that grows with time. A pose that was found is [`TrackState::Doubtful`] until the next
/// image confirms it, unless it is nearly certain. It also stays doubtful while another pose that
/// looks like it is as likely.
///
/// Cost of a step while tracking: about that of `hybrid`, including the observation. A step that
/// searches for the object takes some tens of milliseconds, and rarely up to 0.4 s. Use one tracker
/// per object and thread.
///
/// ```
/// use hicp_sim::{DepthSensor, Household, MovingConfig, MovingScene, rng};
/// use hybrid_icp::core::PinholeCamera;
/// use hybrid_icp::{TrackState, Tracker, TrackerConfig};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let mug = Household::Mug.model()?;
/// let camera = PinholeCamera::new(285.0, 285.0, 159.5, 119.5, 320, 240)?;
/// let config = MovingConfig { frames: 5, standing: 0, ..MovingConfig::default() };
/// let scene = MovingScene::draw(&mut rng(1), &[mug.clone()], 0, &config)?;
///
/// let mut tracker = Tracker::new(mug.clone(), camera, TrackerConfig::default());
/// tracker.start(&scene.poses[0]);
/// for frame in 0..5 {
///     let view = scene.view(&mut rng(2), frame, &[mug.clone()], &camera, &DepthSensor::default())?;
///     let tracked = tracker.step(view.depth, 1.0 / 30.0, None)?;
///     assert_eq!(tracked.state, TrackState::Tracking);
/// }
/// # Ok(()) }
/// ```
pub struct Tracker {
    matcher: Matcher,
    config: TrackerConfig,
    motion: Option<Motion>,
    /// The last pose at which the image showed the object, except those of an unconfirmed trial.
    last: Isometry3<f64>,
    /// The last pose that a search found, until images have shown the object there for some time.
    trial: Option<Trial>,
    state: TrackState,
    /// Time since the image last showed the object, seconds.
    unseen: f64,
    /// `true` if another pose explains the image as well.
    ambiguous: bool,
    /// Unexplained share of the pixels around the object when other rotations were tried, or the
    /// smallest one since.
    unexplained: f64,
}

impl Tracker {
    /// Creates a tracker of an object in the images of a camera.
    #[must_use]
    pub fn new(model: impl Into<Arc<Model>>, camera: PinholeCamera, config: TrackerConfig) -> Self {
        Self {
            matcher: Matcher::new(model.into(), camera),
            config,
            motion: None,
            last: Isometry3::identity(),
            trial: None,
            state: TrackState::Lost,
            unseen: 0.0,
            ambiguous: false,
            unexplained: 0.0,
        }
    }

    /// Starts from a rough pose (`camera_from_object`, meters) in the next image.
    ///
    /// After a pose that is not finite, the object is [`TrackState::Lost`] until the next start.
    pub fn start(&mut self, camera_from_object: &Isometry3<f64>) {
        let motion = self.at_rest(camera_from_object, START_RADII);
        self.matcher.forget();
        self.motion = Some(motion).filter(|_| se3::is_finite(camera_from_object));
        self.last = *camera_from_object;
        self.trial = None;
        self.state = TrackState::Doubtful;
        self.unseen = 0.0;
        self.ambiguous = false;
        self.unexplained = 0.0;
    }

    /// Replaces the camera, for images of different sizes or intrinsic parameters.
    ///
    /// Poses stay in the camera frame.
    pub fn set_camera(&mut self, camera: PinholeCamera) {
        self.matcher.camera = camera;
    }

    /// Tracks the object in the next image.
    ///
    /// `seconds` is the time since the previous image, also if images in between are missing. It is
    /// 0 for an image of the same instant. The object is lost after a sum of these times, so a
    /// clock that stands still hides a loss.
    ///
    /// A mask is not needed; if there is one, only its pixels are used. It may be passed for some
    /// images only, for example to find a lost object by a segmentation.
    ///
    /// Before [`Tracker::start`], the result is the identity with the state [`TrackState::Lost`].
    /// Deterministic.
    ///
    /// # Errors
    ///
    /// [`TrackError`] if the sizes of the image, the mask and the camera differ, or if the time is
    /// negative or not finite. The tracker then stays as it was.
    pub fn step(
        &mut self,
        depth: impl Into<Arc<DepthImage>>,
        seconds: f64,
        mask: Option<&Mask>,
    ) -> Result<Tracked, TrackError> {
        self.track(&depth.into(), seconds, mask)
    }

    fn track(
        &mut self,
        depth: &Arc<DepthImage>,
        seconds: f64,
        mask: Option<&Mask>,
    ) -> Result<Tracked, TrackError> {
        if !(seconds.is_finite() && seconds >= 0.0) {
            return Err(TrackError::Seconds { found: seconds });
        }
        let camera = self.matcher.camera.size();
        check_size("depth image", depth.size(), "camera", camera)?;
        if let Some(mask) = mask {
            check_size("mask", mask.size(), "camera", camera)?;
        }
        let Some(mut motion) = self.motion else {
            return Ok(Tracked {
                camera_from_object: Isometry3::identity(),
                state: TrackState::Lost,
                confidence: 0.0,
                meters_per_second: Vector3::zeros(),
                radians_per_second: Vector3::zeros(),
                evidence: Evidence::default(),
                deviation_meters: f64::INFINITY,
            });
        };
        motion.predict(seconds);
        if let Some(trial) = &mut self.trial {
            trial.without.predict(seconds);
        }
        let diameter = self.matcher.extent.diameter;
        let (lost, mut found) = (self.state == TrackState::Lost, None);
        let near = motion.deviation(&self.matcher.extent) < NEAR_DIAMETERS * diameter;
        if near || !lost {
            found = self.matcher.follow(depth, mask, &motion)?;
            // Far away, another surface may look like the object.
            found = found.filter(|(found, _)| near || found.is_sure());
        }
        let shown = |f: &Found| f.explains() || f.may_be_held();
        let counts = |f: &Found| if lost { f.stands_alone() } else { shown(f) };
        let mut measured = found.filter(|(found, _)| counts(found));
        if let Some(measured) = &measured
            && !motion.update(&measured.0.pose, &measured.1)
        {
            // The evidence is that of the measured pose, so return no other one.
            motion = self.at(measured);
        }
        let mut returned = false;
        if lost && measured.is_none() {
            // The object may be where it was last seen, for example on a table.
            let at_rest = self.at_rest(&self.last, START_RADII);
            measured = self.matcher.follow(depth, mask, &at_rest)?;
            measured = measured.filter(|(found, _)| found.is_sure());
            if let Some(measured) = &measured {
                (motion, found, returned) = (self.at(measured), Some(*measured), true);
            }
        }
        let found = found.map(|(found, _)| found);
        let mut seen = measured.map(|(found, _)| found);
        if let Some(found) = seen.filter(|_| self.ambiguous) {
            let (better, ambiguous) = self.matcher.settle(depth, mask, found, None)?;
            if better.0.pose != found.pose {
                (motion, seen) = (self.at(&better), Some(better.0));
            }
            self.ambiguous = ambiguous;
        }
        let unsure = motion.deviation(&self.matcher.extent) > 2.0 * SURE_DIAMETERS * diameter;
        if let Some(found) = seen {
            let unexplained = found.unexplained();
            if unsure && !lost && !self.ambiguous && unexplained > self.unexplained + APPEARED {
                // A part may have come into view, such as the handle of a mug.
                if let Some(better) = self.matcher.turn(depth, mask, found, &motion)? {
                    (motion, seen) = (self.at(&better), Some(better.0));
                }
                self.unexplained = unexplained;
            }
            self.unexplained = self.unexplained.min(unexplained).max(0.0);
        }
        // Another surface rarely looks like the object in two images.
        let mut confirmed = match &mut self.trial {
            Some(trial) => {
                trial.confirmed |= seen.is_some_and(|f| f.stands_alone());
                trial.confirmed
            }
            None => true,
        };
        let doubtful = unsure || !confirmed;
        let mut searched = false;
        let search = |f: Found| {
            let enough = f.is_clear() && confirmed;
            !enough && !f.is_hidden() && (doubtful || !shown(&f))
        };
        if (lost && seen.is_none()) || found.is_none_or(search) {
            // A pose that was found may be wrong, and does not bound the search.
            let around = self.trial.map_or(motion, |trial| trial.without);
            let again = self.matcher.find(depth, mask, &around)?;
            let better = |again: &Found| seen.is_none_or(|s| again.merit() > s.merit() + CLEARLY);
            if let Some(again) = again.filter(better) {
                let (again, ambiguous) = self.matcher.settle(depth, mask, again, Some(&around))?;
                (motion, seen) = (self.at(&again), Some(again.0));
                self.ambiguous = ambiguous;
                confirmed = self.matcher.log_odds(&again.0, &around) > CERTAIN;
                self.trial = Some(Trial {
                    without: around,
                    confirmed,
                    seen: 0.0,
                });
                searched = true;
            }
        }
        self.unseen = if seen.is_some() {
            0.0
        } else {
            self.unseen + seconds
        };
        if let Some(found) = seen.filter(|_| confirmed) {
            self.last = found.pose;
        }
        let deviation = motion.deviation(&self.matcher.extent);
        let is_sure = |f: Found| f.is_sure() && deviation < SURE_DIAMETERS * diameter;
        self.state = match seen {
            Some(found) if is_sure(found) && confirmed && !returned && !self.ambiguous => {
                TrackState::Tracking
            }
            Some(_) => TrackState::Doubtful,
            None if !lost && self.unseen <= self.config.coast_seconds => TrackState::Doubtful,
            None => TrackState::Lost,
        };
        match (self.state, &mut self.trial) {
            (TrackState::Lost, Some(trial)) => {
                motion = trial.without;
                self.trial = None;
            }
            (_, Some(trial)) if confirmed && seen.is_some() && !searched => {
                trial.seen += seconds;
                if trial.seen > TRIAL_SECONDS {
                    self.trial = None;
                }
            }
            _ => {}
        }
        self.motion = Some(motion);
        let velocity = motion.velocity();
        Ok(Tracked {
            camera_from_object: *motion.pose(),
            state: self.state,
            confidence: seen.map_or(0.0, |found| found.confidence),
            meters_per_second: velocity.fixed_rows::<3>(0).into_owned(),
            radians_per_second: velocity.fixed_rows::<3>(3).into_owned(),
            evidence: seen.or(found).map(|f| f.evidence).unwrap_or_default(),
            deviation_meters: motion.deviation(&self.matcher.extent),
        })
    }

    /// Returns the filter after a search that found a pose.
    fn at(&self, (found, covariance): &(Found, Matrix6<f64>)) -> Motion {
        let mut motion = self.at_rest(&found.pose, SEARCHED_RADII);
        motion.update(&found.pose, covariance);
        motion
    }

    /// Returns the filter at a pose whose deviation is a number of radii, and radians.
    fn at_rest(&self, pose: &Isometry3<f64>, radii: f64) -> Motion {
        let (config, extent) = (&self.config, &self.matcher.extent);
        let angular = config.degrees_per_second.to_radians();
        Motion::new(
            extent.center,
            pose,
            [radii * extent.radius, radii],
            [config.meters_per_second, angular],
            config.memory_seconds,
        )
    }
}

/// A pose that a search found.
#[derive(Clone, Copy, Debug)]
struct Trial {
    /// The motion without it.
    without: Motion,
    /// `true` if the pose is nearly certain, or another image showed the object there.
    confirmed: bool,
    /// Time for which images have shown the object there since it was confirmed, seconds.
    seen: f64,
}

impl std::fmt::Debug for Tracker {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Tracker")
            .field("config", &self.config)
            .field("motion", &self.motion)
            .field("state", &self.state)
            .finish_non_exhaustive()
    }
}

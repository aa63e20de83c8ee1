//! The search for a lost object, or for its rotation.

use std::f64::consts::TAU;
use std::sync::Arc;

use hicp_core::internal::small::{eigen3, inverse3};
use hicp_core::{
    DepthImage, ImageError, Isometry3, Mask, Matrix6, Observation, Problem, Translation3,
    UnitQuaternion, Vector3,
};
use hicp_score::{MeanVsd, Score};

use super::found::Found;
use super::matcher::{Matcher, ROUGH_ITERATIONS, run};
use super::motion::Motion;
use super::segments::{Segment, Segments, Sphere};
use crate::extent::DIFFERENT_DIAMETERS;

/// Difference in merit by which a pose is clearly better than another one.
pub(super) const CLEARLY: f64 = 0.03;
/// Difference in MVE by which a pose is clearly better than one that looks like it.
const CLEAR_MVE: f64 = 0.01;
/// Difference of the logarithms of two probabilities for the same.
const CLEAR_ODDS: f64 = 2.5;
/// Smallest logarithm of the odds that a found pose is right.
const LIKELY: f64 = 1.5;
/// The same of a pose that needs no second image.
pub(super) const CERTAIN: f64 = 4.0;
/// Number of surfaces that are searched in an image.
const SEGMENTS: usize = 2;
/// Axes of the camera around which a search rotates the predicted pose, and the angle, radians.
const ROTATIONS: [[f64; 3]; 7] = [
    [0.0, 0.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.0, -1.0],
    [0.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.0],
];
const ROTATION: f64 = 0.8;
/// Number of rotations around an open axis.
const TURNS: usize = 24;
/// Distance around the object up to which its parts may lie after such a rotation, in diameters.
const TURNED_DIAMETERS: f64 = 0.3;
/// Smallest angle between the rotations of poses that look alike, degrees.
const SPACING_DEGREES: f64 = 30.0;

impl Matcher {
    /// Searches for the object around its predicted place.
    pub(super) fn find(
        &mut self,
        depth: &Arc<DepthImage>,
        mask: Option<&Mask>,
        motion: &Motion,
    ) -> Result<Option<Found>, ImageError> {
        let (model, camera) = (Arc::clone(&self.model), self.camera);
        let translation = motion.covariance().fixed_view::<3, 3>(0, 0).into_owned();
        let deviation =
            eigen3(&translation).map_or(0.0, |eigen| eigen.eigenvalues.max().max(0.0).sqrt());
        let sphere = Sphere {
            center: motion.center(),
            radius: 3.0 * deviation + model.radius(),
        };
        let size = (model.diameter(), model.mesh().area());
        let segments = Segments::new(depth, &camera, &sphere, size, mask);
        let mut fresh: Vec<Segment> = Vec::new();
        for segment in self.rejected.fresh(&segments.found, model.diameter()) {
            if fresh.len() < SEGMENTS && !fresh.iter().any(|s| segments.are_parts(s, &segment)) {
                fresh.push(segment);
            }
        }
        let mut best: Option<(f64, Found)> = None;
        for segment in fresh {
            let behind = 0.25 * model.diameter() / segment.mean.coords.norm();
            let center = segment.mean.coords * (1.0 + behind);
            let rotation = motion.pose().rotation;
            let shift = center - rotation * model.center().coords;
            let init = Isometry3::from_parts(Translation3::from(shift), rotation);
            let observation =
                Observation::new(Arc::clone(depth), segments.mask(&segment, depth), camera)?;
            let pose = if let Some(near) = self.try_rotations(&observation, &init) {
                near.pose
            } else {
                let (search, workspace) = (&mut self.search, &mut self.workspace);
                run(search, workspace, &model, &observation, &init).camera_from_object
            };
            let observation =
                self.observe(depth, mask, &pose, DIFFERENT_DIAMETERS * model.diameter())?;
            let found = self.register(&observation, &pose);
            let found = found.filter(Found::stands_alone);
            let found = found.map(|found| (self.log_odds(&found, motion), found));
            let Some((odds, found)) = found.filter(|(odds, _)| *odds > LIKELY) else {
                self.rejected.add(&segment, model.diameter());
                continue;
            };
            if best.is_none_or(|(before, _)| before < odds) {
                best = Some((odds, found));
            }
            if found.is_clear() {
                break;
            }
        }
        Ok(best.map(|(_, found)| found))
    }

    /// Returns the best registration from several rotations around the axes of the camera.
    ///
    /// It is cheaper than a search, and often enough after a short time.
    fn try_rotations(&mut self, observation: &Observation, init: &Isometry3<f64>) -> Option<Found> {
        let center = Translation3::from((init * self.model.center()).coords);
        let mut best: Option<Found> = None;
        for axis in ROTATIONS {
            let rotation = UnitQuaternion::from_scaled_axis(Vector3::from(axis) * ROTATION);
            let start = center * rotation * center.inverse() * init;
            let found = self.fit(observation, &start, ROUGH_ITERATIONS);
            best = best
                .into_iter()
                .chain(found)
                .max_by(|a, b| a.merit().total_cmp(&b.merit()));
            if best.is_some_and(|best| best.is_unmistakable()) {
                break;
            }
        }
        best.filter(Found::is_unmistakable)
    }

    /// Compares a pose with those that look like it.
    ///
    /// Returns the most probable pose with its covariance, and whether another one is as probable.
    /// Without a motion, all are equally probable before the image.
    pub(super) fn settle(
        &mut self,
        depth: &Arc<DepthImage>,
        mask: Option<&Mask>,
        found: Found,
        motion: Option<&Motion>,
    ) -> Result<((Found, Matrix6<f64>), bool), ImageError> {
        let model = Arc::clone(&self.model);
        let mut rivals = vec![found];
        let meters = DIFFERENT_DIAMETERS * model.diameter();
        let observation = self.observe(depth, mask, &found.pose, meters)?;
        let problem = Problem::new(&model, &observation);
        let mut context = self.workspace.context(&problem);
        let alike = self
            .look_alikes
            .list(&mut context, &found.pose, SPACING_DEGREES);
        let alike: Vec<_> = alike.iter().map(|(_, pose)| *pose).collect();
        for turned in alike {
            if !self.is_new(&turned, &rivals) {
                continue;
            }
            let observation = self.observe(depth, mask, &turned, meters)?;
            let rival = self.register(&observation, &turned);
            if let Some(rival) = rival.filter(|rival| self.is_new(&rival.pose, &rivals)) {
                rivals.push(rival);
            }
        }
        let odds = |rival: &Found| self.odds(rival, motion);
        rivals.sort_by(|a, b| odds(b).total_cmp(&odds(a)));
        let ambiguous = rivals
            .get(1)
            .is_some_and(|other| odds(&rivals[0]) - odds(other) < CLEAR_ODDS);
        let covariance = self.covariance(&observation, &rivals[0], f64::INFINITY);
        Ok(((rivals[0], covariance), ambiguous))
    }

    /// Rotates a pose around the axis that the motion leaves open.
    ///
    /// Returns a pose that explains the image clearly better, with its covariance.
    pub(super) fn turn(
        &mut self,
        depth: &Arc<DepthImage>,
        mask: Option<&Mask>,
        found: Found,
        motion: &Motion,
    ) -> Result<Option<(Found, Matrix6<f64>)>, ImageError> {
        let Some((axis, point)) = motion.open_axis(&self.extent) else {
            return Ok(None);
        };
        let model = Arc::clone(&self.model);
        let around = self.observe(
            depth,
            mask,
            &found.pose,
            TURNED_DIAMETERS * model.diameter(),
        )?;
        let problem = Problem::new(&model, &around);
        let turned = |index: usize| {
            let angle = TAU * index as f64 / TURNS as f64;
            let place = Translation3::from(point.coords);
            place * UnitQuaternion::from_axis_angle(&axis, angle) * place.inverse() * found.pose
        };
        let mut ranked: Vec<_> = (1..TURNS)
            .map(|index| {
                let pose = turned(index);
                let mut context = self.workspace.context(&problem);
                (self.ranking.score(&mut context, &pose), pose)
            })
            .collect();
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut best: Option<Found> = None;
        for (_, pose) in &ranked[..2] {
            let rival = self.register(&around, pose);
            let rival = rival.filter(|rival| self.is_new(&rival.pose, &[found]));
            if let Some(rival) = rival.filter(|r| best.is_none_or(|best| r.mve < best.mve)) {
                best = Some(rival);
            }
        }
        // Both in the same pixels.
        let mve = MeanVsd::default().score(&mut self.workspace.context(&problem), &found.pose);
        let better = best.filter(|best| best.mve < mve - CLEAR_MVE && best.stands_alone());
        Ok(better.map(|better| (better, self.covariance(&around, &better, f64::INFINITY))))
    }

    /// Returns the logarithm of the odds that a pose is right, given the predicted place.
    ///
    /// Far away, more surfaces look like the object.
    pub(super) fn log_odds(&self, found: &Found, motion: &Motion) -> f64 {
        let covariance = motion.covariance().fixed_view::<3, 3>(0, 0).into_owned();
        let shift = found.pose * self.model.center() - motion.center();
        let inverse = inverse3(&covariance).unwrap_or_default();
        found.log_odds() - 0.5 * shift.dot(&(inverse * shift))
    }

    /// Returns the logarithm of the probability of one of several similar poses, up to a constant.
    fn odds(&self, found: &Found, motion: Option<&Motion>) -> f64 {
        let away = motion.map_or(0.0, |motion| {
            self.extent.distance(&found.pose, motion.pose()) / motion.deviation(&self.extent)
        });
        -CLEAR_ODDS / CLEAR_MVE * found.mve - 0.5 * away * away
    }

    /// Returns whether a pose differs from others.
    fn is_new(&self, pose: &Isometry3<f64>, others: &[Found]) -> bool {
        let mut others = others.iter();
        others.all(|other| self.extent.differ(pose, &other.pose))
    }
}

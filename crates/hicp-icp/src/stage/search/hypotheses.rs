//! Hypotheses of a search: poses with rotations from a set, placed at the observed points.

use std::sync::Arc;

use hicp_core::internal::centroid;
use hicp_core::{
    Isometry3, Model, Observation, Point3, Problem, Sides, Translation3, UnitQuaternion,
    UnitVector3, Vector3, rotation_grid, se3, so3,
};

use crate::stop::motion::Bound;

/// The rotations that a search tries.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Rotations {
    /// An even grid of SO(3); with a bound, the same number of rotations within it.
    #[default]
    Even,
    /// The initial rotation, rotated around the ray to the observed points.
    ViewAxis,
    /// The initial rotation, rotated around the declared symmetries of the object.
    ///
    /// For objects that are nearly symmetric. Without declared symmetries there are none.
    Symmetry,
}

/// Number of surfels of a side that determine the place of a hypothesis. The default of the ranking
/// score, so that both share the sides.
const PLACING_SURFELS: usize = 600;

/// The source of the hypotheses of one search.
pub(crate) struct Hypotheses<'a> {
    problem: Problem<'a>,
    model: &'a Model,
    init: Isometry3<f64>,
    bound: Option<Bound>,
    /// Mean of the observed points, camera frame, meters.
    centroid: Point3<f64>,
    /// Direction from the camera to the centroid.
    ray: Vector3<f64>,
    sides: Arc<Sides>,
}

impl<'a> Hypotheses<'a> {
    /// Returns `None` if nothing was observed or the initial pose is not finite.
    pub(crate) fn new(
        problem: &Problem<'a>,
        init: &Isometry3<f64>,
        bound: Option<Bound>,
    ) -> Option<Self> {
        let (model, observation) = problem.sides()?;
        let centroid = observed_centroid(observation)?;
        let ray = centroid.coords.try_normalize(f64::EPSILON)?;
        se3::is_finite(init).then(|| Self {
            problem: *problem,
            model,
            init: *init,
            bound,
            centroid,
            ray,
            sides: Sides::of(model, PLACING_SURFELS),
        })
    }

    /// Iterates over the neighbors of a pose.
    ///
    /// They are the pose itself, half turns around the axes of the object frame, and quarter turns
    /// around the ray. Each is placed at the observed points, and also with the model's center
    /// where that of the pose is. Those outside of the bound are left out.
    fn neighbors(&self, pose: &Isometry3<f64>) -> impl Iterator<Item = Isometry3<f64>> + use<'_> {
        let (rotation, center) = (pose.rotation, pose * self.model.center());
        let half = std::f64::consts::PI;
        let ray = UnitVector3::new_unchecked(self.ray);
        let about_object = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()]
            .map(|axis| rotation * UnitQuaternion::from_axis_angle(&axis, half));
        let about_ray = [0.5, 1.0, 1.5]
            .map(|turn| UnitQuaternion::from_axis_angle(&ray, turn * half) * rotation);
        std::iter::once(rotation)
            .chain(about_object)
            .chain(about_ray)
            .flat_map(move |rotation| [self.place(&rotation), self.turn(&rotation, &center)])
            .flatten()
    }

    /// Returns the pose with a rotation at which the model's center is at a point.
    ///
    /// Returns `None` if it is outside of the bound.
    fn turn(&self, rotation: &UnitQuaternion<f64>, center: &Point3<f64>) -> Option<Isometry3<f64>> {
        let translation = Translation3::from(center - rotation * self.model.center());
        let pose = Isometry3::from_parts(translation, *rotation);
        let bound = self.bound;
        bound
            .is_none_or(|bound| bound.contains(&self.problem, &self.init, &pose))
            .then_some(pose)
    }

    /// Iterates over the neighbors of the initial and the local pose, and the local pose itself.
    pub(crate) fn around_both<'b>(
        &'b self,
        local: &'b Isometry3<f64>,
    ) -> impl Iterator<Item = Isometry3<f64>> + 'b {
        let neighbors = [&self.init, local].into_iter();
        let neighbors = neighbors.flat_map(|pose| self.neighbors(pose));
        neighbors.chain(std::iter::once(*local))
    }

    /// Iterates over the hypotheses of a set of rotations, with `None` for those outside of the
    /// bound.
    ///
    /// A caller with a time limit reads the clock for those, too.
    pub(crate) fn of(
        &self,
        rotations: Rotations,
        count: usize,
    ) -> impl Iterator<Item = Option<Isometry3<f64>>> + use<'_> {
        let symmetries = self.model.symmetries();
        // In a bounded search, the same number of hypotheses falls into the bound.
        let grid = match (rotations, self.bound) {
            (Rotations::Even, Some(bound)) => enlarged(count, bound.rotation_degrees.to_radians()),
            (Rotations::Symmetry, _) if symmetries.continuous.is_empty() => {
                count.min(symmetries.discrete.len())
            }
            _ => count,
        };
        (0..grid).map(move |index| {
            self.rotation(rotations, index, grid)
                .and_then(|rotation| self.place(&rotation))
        })
    }

    fn rotation(
        &self,
        rotations: Rotations,
        index: usize,
        count: usize,
    ) -> Option<UnitQuaternion<f64>> {
        let initial = self.init.rotation;
        #[allow(clippy::cast_precision_loss)] // Counts far below 2⁵³.
        let turn = |index: usize, count: usize| std::f64::consts::TAU * index as f64 / count as f64;
        match rotations {
            Rotations::Even => Some(rotation_grid(index, count)),
            Rotations::ViewAxis => {
                let ray = UnitVector3::new_unchecked(self.ray);
                Some(UnitQuaternion::from_axis_angle(&ray, turn(index, count)) * initial)
            }
            Rotations::Symmetry => {
                let symmetries = self.model.symmetries();
                let discrete = symmetries.discrete.len();
                if let Some(motion) = symmetries.discrete.get(index) {
                    return Some(initial * motion.rotation);
                }
                let axes = symmetries.continuous.len();
                let axis = symmetries
                    .continuous
                    .get((index - discrete) % axes.max(1))?;
                let steps = (count - discrete).div_ceil(axes);
                let angle = turn((index - discrete) / axes, steps);
                Some(initial * axis.rotation(angle).rotation)
            }
        }
    }

    /// Places a rotation such that the visible centroid is the observed one, within the bound.
    ///
    /// A bound limits the distance of the model's center.
    ///
    /// Returns `None` if the rotation is outside of the bound.
    fn place(&self, rotation: &UnitQuaternion<f64>) -> Option<Isometry3<f64>> {
        // Check the rotation before placing it: most of the grid of a bounded search ends here.
        if let Some(bound) = self.bound {
            let away = rotation * self.init.rotation.inverse();
            if so3::angle(&away).to_degrees() > bound.rotation_degrees {
                return None;
            }
        }
        let seen = self
            .sides
            .toward(&(rotation.inverse() * -self.ray))
            .centroid;
        let mut translation = self.centroid - rotation * seen;
        if let Some(bound) = self.bound {
            let center = rotation * self.model.center().coords;
            let initial = (self.init * self.model.center()).coords;
            let step = translation + center - initial;
            let limit = bound.translation_meters;
            if step.norm() > limit {
                translation = initial + step * (limit / step.norm()) - center;
            }
        }
        Some(Isometry3::from_parts(
            Translation3::from(translation),
            *rotation,
        ))
    }
}

/// Returns the mean of about 1000 of the observed points, in the camera frame.
fn observed_centroid(observation: &Observation) -> Option<Point3<f64>> {
    let stride = (1_u32..)
        .find(|s| observation.n_surfels() <= 1000 * (*s as usize).pow(2))
        .unwrap_or(1);
    let mean = |stride: u32| centroid(observation.surfels(stride).map(|(_, surfel)| surfel));
    mean(stride).or_else(|| mean(1))
}

/// Returns the grid size for which about `count` rotations lie within an angle of any rotation.
///
/// The share of SO(3) within the angle β is (β − sin β) / π.
fn enlarged(count: usize, angle: f64) -> usize {
    let angle = angle.clamp(0.0, std::f64::consts::PI);
    let share = (angle - angle.sin()) / std::f64::consts::PI;
    #[allow(clippy::cast_precision_loss)] // Counts far below 2⁵³.
    let wanted = count as f64 / share.max(1e-9);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // Clamped.
    let wanted = wanted.ceil().clamp(0.0, MAX_GRID) as usize;
    wanted
}

/// The largest grid that is searched for rotations within a bound.
const MAX_GRID: f64 = 100_000.0;

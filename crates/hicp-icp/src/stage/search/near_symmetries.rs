//! Near symmetries: motions that map most of an object's surface onto itself.

use std::ops::Range;
use std::sync::Arc;

use hicp_core::internal::small::eigen3;
use hicp_core::{
    Isometry3, Matrix3, Model, Observation, TriMesh, UnitQuaternion, UnitVector3, Vector3,
    sample_surface,
};

use crate::stage::search::distinct::Distinct;
use crate::stage::search::revolution::axis_of;
use crate::stage::search::self_match::{SAMPLES, SelfMatch, Set};

/// Number of samples that are drawn for a model with too few of its own.
const DRAWN: usize = 1000;
/// Number of rotations around an axis.
const STEPS: usize = 24;
/// Largest distance from the moved surface, as a share of the diameter.
const TOLERANCE: f64 = 0.05;
/// Smallest MSSD of a motion, as a share of the diameter. Half of that of distinct poses, because
/// the two poses also differ by their own errors.
const LEAST_MOTION: f64 = 0.05;
/// Cosines of the angles by which a principal axis is corrected: 2° to 37°.
const TILTED: Range<f64> = 0.8..0.9995;
/// Share of the seen samples that must tell two poses apart.
const TELLING: f64 = 0.03;

/// The motions S, in the object frame, for which the object at `pose` and at `pose · S` look nearly
/// the same.
///
/// They are rotations in steps of 15° around the principal axes, also with the axis flipped. The
/// axis of a mug is that of its body, which the handle would tilt ([`axis_of`]). Each rotation is
/// shifted such that most of the surface lies on itself: the handle also moves the center of the
/// object away from the axis. Then the motion is registered with the surface, because a knob tilts
/// the axes, and a score tells half a turn around a tilted axis from the exact one. Declared
/// symmetries are left out, and so are motions that differ from another one only by these.
///
/// Computed once per model, in some 20 ms.
#[derive(Debug)]
pub(crate) struct NearSymmetries {
    surface: SelfMatch,
    oriented: bool,
    /// The motions, with the samples that are far from the moved surface.
    motions: Vec<(Isometry3<f64>, Set)>,
    /// The axes around which every rotation is one of them.
    spins: Vec<UnitVector3<f64>>,
}

impl NearSymmetries {
    /// Returns the near symmetries of a model.
    pub(crate) fn of(model: &Model) -> Arc<Self> {
        model.derived().get_or_build(0, || Self::find(model))
    }

    /// Returns whether there is none.
    pub(crate) fn is_empty(&self) -> bool {
        self.motions.is_empty()
    }

    /// Iterates over the indices of the motions S for which the image may show the object at
    /// `pose · S` instead.
    ///
    /// Motions are left out if enough of what the image shows of the object at `pose` is not on
    /// the surface at `pose · S`. Cost: one projection per sample.
    pub(crate) fn undecided(
        &self,
        observation: &Observation,
        pose: &Isometry3<f64>,
        diameter: f64,
    ) -> impl Iterator<Item = usize> + '_ {
        let seen = self.seen(observation, pose, 2.0 * TOLERANCE * diameter);
        let enough = (f64::from(count(&seen, &[u64::MAX; SAMPLES / 64])) * TELLING).max(1.0);
        let decided = move |bare: &Set| f64::from(count(&seen, bare)) >= enough;
        let motions = self.motions.iter().enumerate();
        motions.filter_map(move |(index, (_, bare))| (!decided(bare)).then_some(index))
    }

    /// Returns the axes around which every rotation is a near symmetry, object frame.
    pub(crate) fn spins(&self) -> &[UnitVector3<f64>] {
        &self.spins
    }

    /// Returns a motion by its index.
    pub(crate) fn motion(&self, index: usize) -> &Isometry3<f64> {
        &self.motions[index].0
    }

    /// Iterates over all motions.
    pub(crate) fn motions(&self) -> impl Iterator<Item = &Isometry3<f64>> {
        self.motions.iter().map(|(motion, _)| motion)
    }

    /// Returns the samples whose depth was measured.
    fn seen(&self, observation: &Observation, pose: &Isometry3<f64>, tolerance: f64) -> Set {
        let camera = observation.camera();
        let mut seen = Set::default();
        for (index, sample) in self.surface.samples().iter().enumerate() {
            let point = pose * sample.point.cast::<f64>();
            let normal = pose.rotation * sample.normal.cast::<f64>();
            if self.oriented && normal.dot(&point.coords) >= 0.0 {
                continue;
            }
            let Some(pixel) = camera.project(&point) else {
                continue;
            };
            #[allow(clippy::cast_possible_truncation)] // f32 is the precision of images.
            let depth = observation.depth_near(pixel.x as f32, pixel.y as f32);
            if depth.is_some_and(|z| (f64::from(z) - point.z).abs() < tolerance) {
                seen[index / 64] |= 1 << (index % 64);
            }
        }
        seen
    }

    fn find(model: &Model) -> Self {
        #[allow(clippy::cast_possible_truncation)] // f32 is the precision of samples.
        let tolerance = (TOLERANCE * model.diameter()) as f32;
        let few = model.samples().len() < SAMPLES;
        let drawn = few.then(|| sample_surface(model.mesh(), DRAWN));
        let samples = drawn.as_deref().unwrap_or(model.samples());
        let surface = SelfMatch::new(samples, tolerance);
        let mut axes = principal_axes(model.mesh());
        if let Some(axis) = axis_of(samples, model.diameter()) {
            align_axes(&mut axes, &axis);
        }
        let distinct = Distinct::of(model);
        let mut found = Vec::new();
        let (mut spins, mut aligned) = (Vec::new(), 0);
        for (index, rotation) in rotations(&axes).iter().enumerate() {
            let step = index % STEPS;
            if step == 0 {
                aligned = 0;
            }
            let Some(motion) = surface.shifted(rotation) else {
                continue;
            };
            aligned += 1;
            // The rotations without a flip come before those with one.
            if step + 1 == STEPS && aligned == STEPS && (index / STEPS).is_multiple_of(2) {
                let axis = axes.column(index / (2 * STEPS)).into_owned();
                spins.push(UnitVector3::new_normalize(axis));
            }
            insert(&mut found, &distinct, (surface.distance(&motion), motion));
        }
        let mut exact = Vec::new();
        for (distance, motion) in found {
            let registered = surface.registered(&motion);
            let registered = registered.map(|motion| (surface.distance(&motion), motion));
            let better = registered.filter(|(own, _)| *own < distance);
            insert(&mut exact, &distinct, better.unwrap_or((distance, motion)));
        }
        let motions = exact
            .iter()
            .map(|(_, motion)| (*motion, surface.bare(motion)));
        Self {
            motions: motions.collect(),
            surface,
            oriented: model.mesh().is_closed(),
            spins,
        }
    }
}

/// Inserts a motion with its distance from the surface, unless it is a declared symmetry or too
/// near another motion.
///
/// A motion replaces those that are too near if its distance is less than half of theirs. Around
/// the axis of a can, all distances are about the same, and replacing would leave a gap.
fn insert(
    motions: &mut Vec<(f32, Isometry3<f64>)>,
    distinct: &Distinct,
    (distance, motion): (f32, Isometry3<f64>),
) {
    if distinct.mssd(&motion, &Isometry3::identity()) < LEAST_MOTION * distinct.diameter() {
        return;
    }
    let near = |other: &Isometry3<f64>| !distinct.apart(&motion, other);
    let stays = |other: &(f32, _)| other.0 <= 2.0 * distance && near(&other.1);
    if !motions.iter().any(stays) {
        motions.retain(|(_, other)| !near(other));
        motions.push((distance, motion));
    }
}

/// Returns the number of samples in both sets.
fn count(a: &Set, b: &Set) -> u32 {
    a.iter().zip(b).map(|(a, b)| (a & b).count_ones()).sum()
}

/// Returns the principal axes of a surface.
fn principal_axes(mesh: &TriMesh) -> Matrix3<f64> {
    // The moments of the triangles. Those of samples would tilt the axes by some degrees.
    let (mut area, mut first, mut second) = (0.0, Vector3::zeros(), Matrix3::zeros());
    for triangle in 0..mesh.triangles().len() {
        let [a, b, c] = mesh.corners(triangle).map(|p| p.coords.cast::<f64>());
        let (weight, sum) = ((b - a).cross(&(c - a)).norm(), a + b + c);
        area += weight;
        first += sum * (weight / 3.0);
        second += [a, b, c, sum]
            .map(|p| p * p.transpose())
            .iter()
            .sum::<Matrix3<f64>>()
            * (weight / 12.0);
    }
    let mean = first / area;
    let covariance = second / area - mean * mean.transpose();
    eigen3(&covariance).map_or_else(Matrix3::identity, |eigen| eigen.eigenvectors)
}

/// Rotates the axes such that the nearest one is a given axis, if it is tilted a little.
fn align_axes(axes: &mut Matrix3<f64>, axis: &Vector3<f64>) {
    let nearest = (axes.transpose() * axis).iamax();
    let own = axes.column(nearest).into_owned();
    let along = own.dot(axis);
    if TILTED.contains(&along.abs())
        && let Some(turn) = UnitQuaternion::rotation_between(&own, &(axis * along.signum()))
    {
        *axes = turn.to_rotation_matrix() * *axes;
    }
}

/// Returns rotations around the axes, without and with a flip.
fn rotations(axes: &Matrix3<f64>) -> Vec<UnitQuaternion<f64>> {
    let turn = |axis: usize, angle: f64| UnitQuaternion::new(axes.column(axis) * angle);
    let mut rotations = Vec::with_capacity(6 * STEPS);
    for axis in 0..3 {
        for flip in [0.0, std::f64::consts::PI] {
            rotations.extend((0..STEPS).map(|step| {
                let angle = std::f64::consts::TAU * step as f64 / STEPS as f64;
                turn(axis, angle) * turn((axis + 1) % 3, flip)
            }));
        }
    }
    rotations
}

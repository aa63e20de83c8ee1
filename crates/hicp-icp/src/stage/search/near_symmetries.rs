//! Near symmetries: motions that map most of an object's surface onto itself.

use std::ops::Range;
use std::sync::Arc;

use hicp_core::internal::small::eigen3;
use hicp_core::internal::{VectorLoop, bounds, centroid, vectorized};
use hicp_core::{
    Isometry3, Matrix3, Model, Observation, RigidTransform, Surfel, Translation3, TriMesh,
    UnitQuaternion, UnitVector3, Vector3,
};

use crate::stage::search::distinct::Distinct;
use crate::stage::search::revolution::axis_of;

/// Number of surface samples that are compared, at most 256.
const SAMPLES: usize = 256;
/// Number of rotations around an axis.
const STEPS: usize = 24;
/// Share of the samples that must lie on the moved surface.
const LEAST_SHARE: f64 = 0.6;
/// Largest distance from the moved surface, as a share of the diameter.
const TOLERANCE: f64 = 0.05;
/// Smallest MSSD of a motion, as a share of the diameter. Half of that of distinct poses, because
/// the two poses also differ by their own errors.
const LEAST_MOTION: f64 = 0.05;
/// Number of alignments of the moved surface with itself, and the stride of their samples.
const ALIGNMENTS: usize = 3;
const STRIDE: usize = 3;
/// Cosines of the angles by which a principal axis is corrected: 2° to 37°.
const TILTED: Range<f64> = 0.8..0.9995;
/// Share of the seen samples that must tell two poses apart.
const TELLING: f64 = 0.03;

/// A set of samples.
type Set = [u64; SAMPLES / 64];

/// The motions S, in the object frame, for which the object at `pose` and at `pose · S` look nearly
/// the same.
///
/// They are rotations in steps of 15° around the principal axes, also with the axis flipped. The
/// axis of a mug is that of its body, which the handle would tilt ([`axis_of`]). Each rotation is
/// shifted such that most of the surface lies on itself: the handle also moves the center of the
/// object away from the axis. Declared symmetries are left out, and so are motions that differ from
/// another one only by these.
///
/// Computed once per model, in some 10 ms.
#[derive(Debug)]
pub(crate) struct NearSymmetries {
    samples: Vec<Surfel>,
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
        for (index, sample) in self.samples.iter().enumerate() {
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
        let step = model.samples().len().div_ceil(SAMPLES).max(1);
        let samples: Vec<Surfel> = model.samples().iter().step_by(step).copied().collect();
        #[allow(clippy::cast_possible_truncation)] // f32 is the precision of samples.
        let tolerance = (TOLERANCE * model.diameter()) as f32;
        let distinct = Distinct::of(model);
        let mut motions: Vec<(Isometry3<f64>, Set)> = Vec::new();
        let identity = Isometry3::identity();
        let mut axes = principal_axes(model.mesh());
        if let Some(axis) = axis_of(model.samples(), model.diameter()) {
            align_axes(&mut axes, &axis);
        }
        let rotations = rotations(&axes);
        let columns = Columns::new(&samples);
        let (mut spins, mut aligned) = (Vec::new(), 0);
        for (index, rotation) in rotations.iter().enumerate() {
            let step = index % STEPS;
            if step == 0 {
                aligned = 0;
            }
            let Some(motion) = align(&samples, &columns, rotation, tolerance) else {
                continue;
            };
            aligned += 1;
            // The rotations without a flip come before those with one.
            if step + 1 == STEPS && aligned == STEPS && (index / STEPS).is_multiple_of(2) {
                let axis = axes.column(index / (2 * STEPS)).into_owned();
                spins.push(UnitVector3::new_normalize(axis));
            }
            let mut known = motions.iter().map(|(motion, _)| motion);
            let still = distinct.mssd(&motion, &identity) < LEAST_MOTION * model.diameter();
            if still || known.any(|m| !distinct.apart(&motion, m)) {
                continue;
            }
            let back: Isometry3<f32> = motion.inverse().cast();
            let mut bare = Set::default();
            for (index, sample) in samples.iter().enumerate() {
                let point = (back * sample.point).coords;
                if columns.nearest(&point, None, 3.0 * tolerance).is_none() {
                    bare[index / 64] |= 1 << (index % 64);
                }
            }
            motions.push((motion, bare));
        }
        Self {
            samples,
            oriented: model.mesh().is_closed(),
            motions,
            spins,
        }
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

/// Shifts the rotated samples such that most of them lie on the samples.
///
/// Returns `None` if too few do.
fn align(
    samples: &[Surfel],
    columns: &Columns,
    rotation: &UnitQuaternion<f64>,
    tolerance: f32,
) -> Option<Isometry3<f64>> {
    let center = centroid(samples)?;
    let mut shift = (center - rotation * center).cast::<f32>();
    let turn = RigidTransform::new(&Isometry3::from_parts(Translation3::identity(), *rotation));
    for alignment in 0..ALIGNMENTS {
        let (mut sum, mut near) = (Vector3::<f32>::zeros(), 0_usize);
        for sample in samples.iter().step_by(STRIDE) {
            let mut moved = turn.surfel(sample);
            moved.point += shift;
            if let Some(residual) = residual(&moved, (samples, columns), tolerance) {
                sum += residual;
                near += 1;
            }
        }
        let share = (near * STRIDE) as f64 / samples.len().max(1) as f64;
        let last = alignment + 1 == ALIGNMENTS;
        if share < if last { LEAST_SHARE } else { 0.6 * LEAST_SHARE } {
            return None;
        }
        // A shift moves surfaces along their normals by a third of it on average.
        shift += sum * (2.0 / near as f32);
    }
    let shift = shift.cast::<f64>();
    Some(Isometry3::from_parts(shift.into(), *rotation))
}

/// Returns the step from a moved sample to the surface, along the normal.
///
/// Returns `None` if no surface of similar normal is near.
fn residual(
    moved: &Surfel,
    (samples, columns): (&[Surfel], &Columns),
    tolerance: f32,
) -> Option<Vector3<f32>> {
    let nearest = columns.nearest(&moved.point.coords, Some(&moved.normal), 3.0 * tolerance)?;
    let nearest = &samples[nearest];
    // Samples do not lie on samples, so only the distance along the normal counts.
    let along = nearest.normal.dot(&(nearest.point - moved.point));
    (along.abs() < tolerance).then(|| *nearest.normal * along)
}

/// The coordinates of the samples and of their normals, for whole vectors. Those that are missing
/// are infinitely far away.
struct Columns {
    numbers: [[f32; SAMPLES]; 6],
    /// The coordinate by which the samples are sorted.
    axis: usize,
    /// The index of each sample.
    samples: Vec<usize>,
}

impl Columns {
    fn new(samples: &[Surfel]) -> Self {
        let bounds = bounds(samples.iter().map(|sample| sample.point));
        let axis = bounds.map_or(0, |[low, high]| (high - low).imax());
        let mut order: Vec<usize> = (0..samples.len()).collect();
        order.sort_by(|a, b| samples[*a].point[axis].total_cmp(&samples[*b].point[axis]));
        let mut numbers = [[f32::INFINITY; SAMPLES]; 6];
        for (place, index) in order.iter().enumerate() {
            let sample = &samples[*index];
            for axis in 0..3 {
                numbers[axis][place] = sample.point[axis];
                numbers[3 + axis][place] = sample.normal[axis];
            }
        }
        Self {
            numbers,
            axis,
            samples: order,
        }
    }

    /// Returns the nearest sample within a distance, of a similar normal if one is given.
    fn nearest(
        &self,
        point: &Vector3<f32>,
        normal: Option<&Vector3<f32>>,
        radius: f32,
    ) -> Option<usize> {
        // Without a normal, every one is similar.
        let (normal, least) = normal.map_or((Vector3::zeros(), -1.0), |normal| (*normal, 0.5));
        let sorted = &self.numbers[self.axis];
        let [first, end] = [-SLAB, SLAB]
            .map(|slab| sorted.partition_point(|x| *x < point[self.axis] + slab * radius));
        let place = vectorized(Nearest {
            columns: &self.numbers,
            blocks: first / LANES..end.div_ceil(LANES),
            point: *point,
            normal,
            least,
            limit: radius * radius,
        });
        place.map(|place| self.samples[place])
    }
}

/// Half the width of the slab that is searched, in radii. Roundings are far smaller.
const SLAB: f32 = 1.01;

/// Number of samples compared at once.
const LANES: usize = 16;

/// The loop that finds the nearest sample.
struct Nearest<'a> {
    columns: &'a [[f32; SAMPLES]; 6],
    /// The blocks of [`LANES`] samples that are compared.
    blocks: Range<usize>,
    point: Vector3<f32>,
    normal: Vector3<f32>,
    /// The cosine above which normals are similar.
    least: f32,
    /// The square of the largest distance.
    limit: f32,
}

impl VectorLoop for Nearest<'_> {
    type Output = Option<usize>;

    #[inline(always)]
    fn run(self) -> Option<usize> {
        let (point, normal) = (&self.point, &self.normal);
        let (mut least, mut blocks) = ([self.limit; LANES], [0_u32; LANES]);
        for (number, block) in (1..).zip(self.blocks.clone()) {
            let columns = self.columns.each_ref();
            let [x, y, z, nx, ny, nz] = columns.map(|column| &column.as_chunks::<LANES>().0[block]);
            for lane in 0..LANES {
                let (dx, dy, dz) = (x[lane] - point.x, y[lane] - point.y, z[lane] - point.z);
                let along = nx[lane] * normal.x + ny[lane] * normal.y + nz[lane] * normal.z;
                let distance = dx * dx + dy * dy + dz * dz;
                let nearer = (along > self.least) & (distance < least[lane]);
                least[lane] = if nearer { distance } else { least[lane] };
                blocks[lane] = if nearer { number } else { blocks[lane] };
            }
        }
        let lanes = 0..LANES;
        let lane = lanes.reduce(|a, b| if least[b] < least[a] { b } else { a })?;
        let block = (blocks[lane] as usize).checked_sub(1)?;
        Some((self.blocks.start + block) * LANES + lane)
    }
}

//! The match of a surface with itself after a motion.

use std::ops::Range;

use hicp_core::internal::{VectorLoop, bounds, centroid, vectorized};
use hicp_core::{Isometry3, RigidTransform, Surfel, Translation3, UnitQuaternion, Vector3};
use hicp_metric::{Degeneracy, NormalEquations};

/// Largest number of samples that are compared.
pub(crate) const SAMPLES: usize = 256;
/// Share of the samples that must lie on the moved surface.
const LEAST_SHARE: f64 = 0.6;
/// Limits of the distances along the normals at each shift of a rotated surface, in tolerances. A
/// knob moves the center of a box, so the first ones are wide.
const SHIFTS: [f32; 3] = [3.0, 2.0, 1.0];
/// The stride of the samples of a shift.
const STRIDE: usize = 3;
/// Largest distances of the pairs of a registration, iteration by iteration, in tolerances. Later
/// ones leave out what differs, such as a knob on one of two sides.
const REGISTRATION: [f32; 4] = [1.0, 0.5, 0.25, 0.25];
/// The stride of its samples.
const REGISTERED: usize = 2;
/// Information about a direction, relative to the best known one, up to which a registration does
/// not move along it. The dents of a can say something about the rotation around its axis, but too
/// little for an image to show it.
const LEAST_INFORMATION: f64 = 0.02;
/// Rotation by which a registration may change a motion, radians. One that changes it by more
/// slides, such as a mug's handle onto itself.
const MOST_TURNED: f64 = 0.15;

/// A set of samples.
pub(crate) type Set = [u64; SAMPLES / 64];

/// Samples of a surface, to compare with the surface itself after a motion.
#[derive(Debug)]
pub(crate) struct SelfMatch {
    samples: Vec<Surfel>,
    columns: Columns,
    /// Distance up to which a sample lies on the surface, meters.
    tolerance: f32,
}

impl SelfMatch {
    /// Selects at most [`SAMPLES`] of the samples.
    pub(crate) fn new(samples: &[Surfel], tolerance: f32) -> Self {
        let step = samples.len().div_ceil(SAMPLES).max(1);
        let samples: Vec<Surfel> = samples.iter().step_by(step).copied().collect();
        Self {
            columns: Columns::new(&samples),
            samples,
            tolerance,
        }
    }

    pub(crate) fn samples(&self) -> &[Surfel] {
        &self.samples
    }

    /// Returns the rotation with a shift for which most of the surface lies on itself.
    ///
    /// Returns `None` if too little does.
    pub(crate) fn shifted(&self, rotation: &UnitQuaternion<f64>) -> Option<Isometry3<f64>> {
        let center = centroid(&self.samples)?;
        let mut shift = (center - rotation * center).cast::<f32>();
        let turn = RigidTransform::new(&Isometry3::from_parts(Translation3::identity(), *rotation));
        for (number, limit) in (1..).zip(SHIFTS) {
            let (mut sum, mut near) = (Vector3::<f32>::zeros(), 0_usize);
            for sample in self.samples.iter().step_by(STRIDE) {
                let mut moved = turn.surfel(sample);
                moved.point += shift;
                if let Some((normal, along)) = self.residual(&moved, limit * self.tolerance) {
                    sum += normal * along;
                    near += 1;
                }
            }
            let share = (near * STRIDE) as f64 / self.samples.len().max(1) as f64;
            let last = number == SHIFTS.len();
            if share < if last { LEAST_SHARE } else { 0.6 * LEAST_SHARE } {
                return None;
            }
            // A shift moves surfaces along their normals by a third of it on average.
            shift += sum * (2.0 / near as f32);
        }
        let shift = shift.cast::<f64>();
        Some(Isometry3::from_parts(shift.into(), *rotation))
    }

    /// Returns the motion, registered point-to-plane with the surface.
    ///
    /// Returns `None` if it slides away.
    pub(crate) fn registered(&self, motion: &Isometry3<f64>) -> Option<Isometry3<f64>> {
        let center = centroid(&self.samples)?;
        let mut registered = *motion;
        for limit in REGISTRATION {
            let turn = RigidTransform::new(&registered);
            let length = 10.0 * f64::from(self.tolerance);
            let mut system = NormalEquations::new(registered * center, length);
            for sample in self.samples.iter().step_by(REGISTERED) {
                let moved = turn.surfel(sample);
                if let Some((normal, along)) = self.residual(&moved, limit * self.tolerance) {
                    let residual = -f64::from(along);
                    system.add_row(&moved.point.cast(), &normal.cast(), residual, 1.0);
                }
            }
            let system = system.with_policy(Degeneracy::Freeze, LEAST_INFORMATION);
            registered = system.solve()? * registered;
            if registered.rotation.angle_to(&motion.rotation) > MOST_TURNED {
                return None;
            }
        }
        Some(registered)
    }

    /// Returns the mean distance of the moved samples from the surface, meters, each at most the
    /// tolerance.
    pub(crate) fn distance(&self, motion: &Isometry3<f64>) -> f32 {
        let turn = RigidTransform::new(motion);
        let distances = self.samples.iter().map(|sample| {
            let residual = self.residual(&turn.surfel(sample), self.tolerance);
            residual.map_or(self.tolerance, |(_, along)| along.abs())
        });
        distances.sum::<f32>() / self.samples.len().max(1) as f32
    }

    /// Returns the samples that are far from the moved surface.
    pub(crate) fn bare(&self, motion: &Isometry3<f64>) -> Set {
        let back: Isometry3<f32> = motion.inverse().cast();
        let mut bare = Set::default();
        for (index, sample) in self.samples.iter().enumerate() {
            let point = (back * sample.point).coords;
            if self
                .columns
                .nearest(&point, None, 3.0 * self.tolerance)
                .is_none()
            {
                bare[index / 64] |= 1 << (index % 64);
            }
        }
        bare
    }

    /// Returns the normal of the surface near a moved sample, and the distance to it along the
    /// normal.
    ///
    /// Returns `None` if no surface of similar normal is near.
    fn residual(&self, moved: &Surfel, limit: f32) -> Option<(Vector3<f32>, f32)> {
        let (point, normal) = (&moved.point, &moved.normal);
        let reach = 3.0 * self.tolerance;
        let nearest = self.columns.nearest(&point.coords, Some(normal), reach)?;
        let nearest = &self.samples[nearest];
        // Samples do not lie on samples, so only the distance along the normal counts.
        let along = nearest.normal.dot(&(nearest.point - point));
        (along.abs() < limit).then(|| (nearest.normal.into_inner(), along))
    }
}

/// The coordinates of the samples and of their normals, for whole vectors. Those that are missing
/// are infinitely far away.
#[derive(Debug)]
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

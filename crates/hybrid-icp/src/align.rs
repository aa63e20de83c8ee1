//! One call from two point clouds to the pose between them.

use std::str::FromStr;

use hicp_association::{
    AllSamples, MaxDistance, NearestNeighbor, SearchIndex, Stride, estimate_normals,
    voxel_downsample,
};
use hicp_core::internal::small::eigen3;
use hicp_core::internal::{bounds, coordinate_step, named};
use hicp_core::{
    Cloud, Correspondences, Isometry3, Matrix3, Matrix6, Point3, Problem, Source, Surfel, Target,
    UnitVector3, UnknownName, Vector3,
};
use hicp_icp::{
    BoxedStage, Cascade, Icp, IterationLimit, Outcome, Quality, Session, SmallMotion, Stage,
    Termination, Workspace,
};
use hicp_metric::{
    Conditioned, Degeneracy, Generalized, Minimize, NormalEquations, Observability, PointToPlane,
    PointToPoint,
};
use hicp_raster::Rasterizer;
use thiserror::Error;

use crate::checks::COARSE;
use crate::warning::Meters;

/// Share of the source points with a counterpart below which a warning follows.
const LITTLE_OVERLAP: f64 = 0.3;

/// Information of a direction, relative to the best determined one, below which only noise
/// determines it.
const UNDETERMINED: f64 = 0.01;

/// The same for a rotation that stays as it is, as in [`presets::local`](crate::presets::local).
const FROZEN: f64 = 0.005;

/// Ratio of the extents of two clouds without overlap from which a warning follows: less than that
/// of meters to centimeters.
const OTHER_UNIT: f64 = 30.0;

/// Largest distance between adjacent coordinates that never matters, also in a cloud of one point.
const FINE_METERS: f64 = 1e-6;

/// Squared share of a rotation in the open directions from which a warning names it.
const ROTATION: f64 = 0.1;

/// Gates of a registration without a stated one, as shares of the source's diameter.
const GATES: [f32; 2] = [0.1, 0.02];

/// The preparation of points for a registration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CloudOptions {
    /// Edge of the cubic cells in which points are replaced by their mean, meters; `None` keeps all
    /// points ([`voxel_downsample`]).
    pub voxel_meters: Option<f32>,
    /// Number of neighbors from which absent normals are estimated ([`estimate_normals`]).
    ///
    /// 0 leaves them out ([`Cloud::without_normals`]). Use it for sources only:
    /// [`CloudOptions::for_source_of`].
    pub neighbors: usize,
}

impl Default for CloudOptions {
    /// All points, and normals from 20 neighbors.
    fn default() -> Self {
        Self {
            voxel_meters: None,
            neighbors: 20,
        }
    }
}

impl CloudOptions {
    /// Returns these options for the source of a registration.
    ///
    /// If the error does not depend on the normals of the source, they are left out to save time.
    #[must_use]
    pub fn for_source_of(self, registration: Registration) -> Self {
        match registration {
            Registration::Generalized => self,
            Registration::PointToPoint | Registration::PointToPlane => Self {
                neighbors: 0,
                ..self
            },
        }
    }

    /// Creates a cloud from points in meters, with unit normals if there are any.
    ///
    /// Points that are not finite, lie exactly at (0, 0, 0) or whose normal cannot be estimated are
    /// skipped ([`Cloud::n_skipped`]). Sensors write (0, 0, 0) where nothing was measured.
    ///
    /// # Errors
    ///
    /// [`NormalCount`] if there are normals, but not one per point.
    pub fn cloud(
        &self,
        points: &[Point3<f32>],
        normals: Option<&[UnitVector3<f32>]>,
    ) -> Result<Cloud, NormalCount> {
        if let Some(normals) = normals
            && normals.len() != points.len()
        {
            return Err(NormalCount {
                normals: normals.len(),
                points: points.len(),
            });
        }
        let surfel = |(point, normal): (&_, _)| Surfel {
            point: *point,
            normal,
        };
        let nowhere = Point3::from([f32::NAN; 3]);
        let measured = |p: &Point3<f32>| if is_measured(p) { *p } else { nowhere };
        let all: Vec<_> = points.iter().map(measured).collect();
        let (points, normals) = match self.voxel_meters {
            Some(edge) => {
                let n_skipped = all.iter().filter(|p| !is_measured(p)).count();
                let (mut means, mut directions) = voxel_downsample(&all, normals, edge);
                if means.len() < all.len() {
                    // Points that are not finite have no cell, but they count as skipped.
                    means.resize(means.len() + n_skipped, nowhere);
                    let unknown = Vector3::x_axis();
                    if let Some(directions) = &mut directions {
                        directions.resize(means.len(), unknown);
                    }
                }
                (means, directions)
            }
            None => (all, normals.map(<[_]>::to_vec)),
        };
        let Some(normals) = normals else {
            if self.neighbors == 0 {
                return Ok(Cloud::without_normals(points));
            }
            let unknown = UnitVector3::new_unchecked(Vector3::repeat(f32::NAN));
            let normals = estimate_normals(&points, self.neighbors).into_iter();
            let normals = normals.map(|normal| normal.unwrap_or(unknown));
            let cloud = Cloud::new(points.iter().zip(normals).map(surfel));
            return Ok(cloud.with_normals_from(self.neighbors));
        };
        Ok(Cloud::new(points.iter().zip(normals).map(surfel)))
    }
}

/// Returns `true` if a point is finite and not at (0, 0, 0).
fn is_measured(point: &Point3<f32>) -> bool {
    point.iter().all(|x| x.is_finite()) && *point != Point3::origin()
}

/// The number of normals of a cloud differs from that of its points.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("there are {normals} normals for {points} points; expected one normal per point, or none")]
pub struct NormalCount {
    /// Number of normals.
    pub normals: usize,
    /// Number of points.
    pub points: usize,
}

/// The error that a registration of two clouds minimizes, over nearest neighbors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Registration {
    /// [`PointToPoint`], which needs no normals.
    PointToPoint,
    /// [`PointToPlane`], with the normals of the target.
    ///
    /// Rotations that the pairs do not determine stay as they are
    /// ([`Degeneracy::FreezeRotations`]), unless noise makes them look determined.
    #[default]
    PointToPlane,
    /// [`Generalized`] ICP (GICP), plane to plane, with the normals of both.
    Generalized,
}

impl Registration {
    /// All registrations.
    pub const ALL: [Self; 3] = [Self::PointToPoint, Self::PointToPlane, Self::Generalized];

    /// Returns the name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::PointToPoint => "point-to-point",
            Self::PointToPlane => "point-to-plane",
            Self::Generalized => "gicp",
        }
    }

    /// Builds the pipeline: every source point to its nearest target point, at most `max_distance`
    /// meters away, until a step moves less than 0.1 mm and 0.01°, or 100 iterations.
    ///
    /// `None` runs twice, with a tenth and with a fiftieth of the source's diameter: it bridges
    /// large offsets, and then leaves out points without a counterpart.
    #[must_use]
    pub fn build(self, max_distance: Option<f32>) -> BoxedStage {
        match self {
            Self::PointToPoint => stages(PointToPoint, max_distance),
            Self::PointToPlane => {
                let metric = Conditioned {
                    metric: PointToPlane,
                    policy: Degeneracy::FreezeRotations,
                    threshold: FROZEN,
                };
                stages(metric, max_distance)
            }
            // From rough poses, the information of its pairs falls below the limit for a while.
            Self::Generalized => stages(Generalized::default(), max_distance),
        }
    }
}

fn stages<M>(metric: M, max_distance: Option<f32>) -> BoxedStage
where
    M: Minimize + Clone + Send + 'static,
{
    let stage = |filter| Icp {
        selection: AllSamples,
        association: NearestNeighbor::new(Stride::Pixels(1), SearchIndex::BoxTree),
        filter,
        metric: metric.clone(),
        stop: (SmallMotion::default(), IterationLimit(100)),
    };
    match max_distance {
        Some(meters) => Box::new(stage(MaxDistance::meters(meters))),
        None => Box::new(Cascade(
            GATES
                .map(|gate| stage(MaxDistance::diameters(gate)))
                .to_vec(),
        )),
    }
}

impl FromStr for Registration {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        named("registration", name, &Self::ALL, Self::name)
    }
}

/// One of the two clouds of a registration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub enum CloudSide {
    /// The cloud that moves.
    Source,
    /// The cloud that stands still.
    Target,
}

impl std::fmt::Display for CloudSide {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Source => "source",
            Self::Target => "target",
        })
    }
}

/// A reason not to trust the registration of two clouds.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum CloudWarning {
    /// Points were skipped: they are not finite, at (0, 0, 0), or have no normal because their
    /// neighbors lie on a line.
    #[error(
        "{side}: {count} points were skipped: they are not finite, at (0, 0, 0) or determine no normal"
    )]
    PointsSkipped {
        /// The cloud.
        side: CloudSide,
        /// Number of points.
        count: usize,
    },
    /// There were no normals, so they were estimated.
    #[error("{side}: no normals: estimated from {neighbors} neighbors")]
    NormalsEstimated {
        /// The cloud.
        side: CloudSide,
        /// Number of neighbors.
        neighbors: usize,
    },
    /// The normals that the error needs are absent, so the pose cannot be determined.
    #[error("{side}: there are no normals, but the error needs them")]
    NoNormals {
        /// The cloud.
        side: CloudSide,
    },
    /// The points are so far from their origin that `f32` rounds their shape.
    #[error(
        "{side}: coordinates are rounded to steps of {} so far from the origin: subtract an offset first",
        Meters(*step)
    )]
    CoarseCoordinates {
        /// The cloud.
        side: CloudSide,
        /// Distance between adjacent numbers at the largest coordinate, meters.
        step: f64,
    },
    /// A part of the pipeline needs a mesh or a depth image.
    #[error(
        "the part `{part}` of the pipeline needs a mesh and a depth image, not point clouds: the initial pose was kept"
    )]
    Unsupported {
        /// Name of the part.
        part: &'static str,
    },
    /// Few points of the source have a counterpart in the target.
    #[error(
        "{:.0} % of the source points have a counterpart in the target: do not trust the pose",
        fitness * 100.0
    )]
    LittleOverlap {
        /// Share of the source points with a counterpart.
        fitness: f64,
    },
    /// There is little overlap, and one cloud is many times as large as the other.
    ///
    /// An extent is the diagonal of a cloud's bounding box, meters.
    #[error(
        "the extent of the source is {}, and that of the target is {}, a ratio of {:.0}: one of them may be in another unit, expected meters",
        Meters(*source_meters),
        Meters(*target_meters),
        source_meters.max(*target_meters) / source_meters.min(*target_meters)
    )]
    Extents {
        /// Extent of the source.
        source_meters: f64,
        /// Extent of the target.
        target_meters: f64,
    },
    /// A length of the preparation or the pipeline exceeds the extent of a cloud.
    ///
    /// An extent is the diagonal of a cloud's bounding box.
    #[error(
        "{name} is {}, more than the extent of the {side}, {}: expected meters",
        Meters(*meters),
        Meters(*extent_meters)
    )]
    TooLong {
        /// The name of the length.
        name: &'static str,
        /// The length.
        meters: f64,
        /// The cloud.
        side: CloudSide,
        /// Its extent.
        extent_meters: f64,
    },
    /// The surface does not determine all six directions, as on a plane, a sphere or a can.
    ///
    /// Noise makes such a direction look determined. Therefore normals of the source are compared
    /// with those of the target: their noise is independent, so only the surface is common to them.
    #[error(
        "the clouds do not determine {directions} of the 6 directions of the pose{}: do not trust them",
        around(axis.as_ref())
    )]
    Undetermined {
        /// Number of directions, 1 to 6.
        directions: usize,
        /// The axis of the rotations among them, in the frame of the target; `None` if there are
        /// none, or rotations around several axes.
        axis: Option<[f64; 3]>,
    },
}

impl CloudWarning {
    /// Returns [`CloudWarning::TooLong`] if a length in meters exceeds the extent of the points.
    #[must_use]
    pub fn of_length(
        name: &'static str,
        meters: Option<f32>,
        side: CloudSide,
        points: &[Point3<f32>],
    ) -> Option<Self> {
        let meters = f64::from(meters?);
        let [low, high] = bounds(points.iter().copied().filter(is_measured))?;
        let extent_meters = f64::from((high - low).norm());
        (meters > extent_meters).then_some(Self::TooLong {
            name,
            meters,
            side,
            extent_meters,
        })
    }
}

/// Returns the words about an axis of rotation.
fn around(axis: Option<&[f64; 3]>) -> String {
    axis.map_or_else(String::new, |[x, y, z]| {
        format!(
            ", among them the rotation around the axis ({x:.2}, {y:.2}, {z:.2}) of the target frame"
        )
    })
}

/// The pose between two clouds, and how well they fit.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Alignment {
    /// The pose, in its field `camera_from_object`, with the reason why the pipeline ended and the
    /// quality.
    pub outcome: Outcome,
    /// The reasons not to trust the pose, if there are any.
    pub warnings: Vec<CloudWarning>,
}

impl Alignment {
    /// Returns the pose: it takes coordinates of the source to those of the target, meters.
    #[must_use]
    pub fn target_from_source(&self) -> Isometry3<f64> {
        self.outcome.camera_from_object
    }

    /// Returns the share of the source points that have a counterpart, 0 to 1.
    #[must_use]
    pub fn fitness(&self) -> f64 {
        self.outcome.quality.map_or(0.0, |quality| quality.fitness)
    }

    /// Returns the root mean square of the distances of pairs, meters; `None` without pairs.
    #[must_use]
    pub fn rmse(&self) -> Option<f64> {
        self.outcome.quality.map(|quality| quality.point_rmse)
    }

    /// Returns the 6×6 covariance of the pose for ξ = [ρ; φ] (translation first, meters and
    /// radians), a left perturbation in the frame of the target.
    ///
    /// `None` if a direction is not determined ([`CloudWarning::Undetermined`]). It does not
    /// contain wrong pairs, so it is optimistic where the clouds overlap in part.
    #[must_use]
    pub fn covariance(&self) -> Option<Matrix6<f64>> {
        let is_open = |w: &CloudWarning| matches!(w, CloudWarning::Undetermined { .. });
        let quality = self.outcome.quality.as_ref()?;
        (quality.covariance()).filter(|_| !self.warnings.iter().any(is_open))
    }
}

/// Registers two point clouds from an initial pose `target_from_source`, in meters.
///
/// Either side may also be a [`Model`](hicp_core::Model) or an
/// [`Observation`](hicp_core::Observation). The pipeline is a [`Registration`] or any stage. If a
/// part of it needs an image or a mesh that is absent, the outcome keeps the initial pose and names
/// the part. Never fails on data: without overlap, the outcome states that no pairs were found.
///
/// Fitness and RMSE do not prove a pose. A can that is rotated around its axis fits as well as at
/// the truth, and a box on its wrong side can fit better. Start from a rough pose, and read the
/// warnings: [`CloudWarning::Undetermined`] names what the surface leaves open. A wrong pose that
/// the surface does determine has no warning.
///
/// A loop that registers many scans reuses its memory with [`align_in`].
///
/// For a depth image, use [`Refiner`](crate::Refiner): here the fitness of a model also counts the
/// side that the camera cannot see, and a registration can end at a wrong pose without a warning.
///
/// ```
/// use hybrid_icp::core::{Isometry3, Point3};
/// use hybrid_icp::{CloudOptions, Registration, align};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let height = |x: f32, y: f32| 2.0 + 0.1 * (5.0 * x).sin() * (4.0 * y).cos();
/// let scan = |dx: f32| -> Vec<_> {
///     let grid = (0..1600).map(|i| ((i % 40) as f32 * 0.05, (i / 40) as f32 * 0.05));
///     grid.map(|(x, y)| Point3::new(x + dx, y, height(x, y))).collect()
/// };
/// let options = CloudOptions::default();
/// let (source, target) = (options.cloud(&scan(0.0), None)?, options.cloud(&scan(0.03), None)?);
/// let mut pipeline = Registration::PointToPlane.build(None);
/// let found = align(&source, &target, &Isometry3::identity(), &mut pipeline);
/// assert!((found.target_from_source().translation.x - 0.03).abs() < 1e-4);
/// assert!(found.fitness() > 0.9);
/// # Ok(()) }
/// ```
pub fn align<'a>(
    source: impl Into<Source<'a>>,
    target: impl Into<Target<'a>>,
    init: &Isometry3<f64>,
    pipeline: &mut (impl Stage + ?Sized),
) -> Alignment {
    let mut workspace = Workspace::new(Rasterizer::default());
    let mut observer = ();
    let mut session = Session::new(&mut workspace, &mut observer);
    align_in(source, target, init, pipeline, &mut session)
}

/// Registers two point clouds as [`align`] does, with a workspace to reuse and an observer.
pub fn align_in<'a>(
    source: impl Into<Source<'a>>,
    target: impl Into<Target<'a>>,
    init: &Isometry3<f64>,
    pipeline: &mut (impl Stage + ?Sized),
    session: &mut Session<'_>,
) -> Alignment {
    let (source, target) = (source.into(), target.into());
    let outcome = pipeline.run(&Problem::new(source, target), init, session);
    let mut clouds = Vec::new();
    if let Source::Cloud(cloud) = source {
        clouds.push((CloudSide::Source, cloud));
    }
    if let Target::Cloud(cloud) = target {
        clouds.push((CloudSide::Target, cloud));
    }
    let prepared = clouds
        .iter()
        .flat_map(|(side, cloud)| warnings_of(*side, cloud));
    let mut alignment = Alignment {
        outcome,
        warnings: prepared.collect(),
    };
    let fitness = alignment.fitness();
    let other_unit = extents(&clouds).filter(|_| fitness < LITTLE_OVERLAP);
    // With few pairs, normals are not to blame.
    let degenerate = outcome.termination == Termination::Degenerate && outcome.n_pairs() == 0;
    let few = |(_, cloud): &(_, &Cloud)| cloud.surfels().len() < 6;
    let by_pairs = other_unit.is_some() || clouds.iter().any(few);
    let bare = clouds
        .iter()
        .rfind(|(_, cloud)| cloud.normals_from() == Some(0));
    alignment.warnings.extend(other_unit);
    let reason = if let Some(part) = outcome.termination.unsupported_part() {
        Some(CloudWarning::Unsupported { part })
    } else if let Some((side, _)) = bare.filter(|_| degenerate && !by_pairs) {
        Some(CloudWarning::NoNormals { side: *side })
    } else if fitness < LITTLE_OVERLAP {
        Some(CloudWarning::LittleOverlap { fitness })
    } else {
        None
    };
    alignment.warnings.extend(reason);
    let open = (outcome.quality).and_then(|q| undetermined(&q, session.workspace.pairs()));
    alignment.warnings.extend(open);
    alignment
}

/// Returns the warning about directions that the pairs, or the surface that they show, leave open.
fn undetermined(quality: &Quality, pairs: &Correspondences) -> Option<CloudWarning> {
    let of_pairs = quality.observability()?;
    let n_open = |found: &Observability| found.n_degenerate(UNDETERMINED);
    let of_surface = surface(&of_pairs, pairs).filter(|_| n_open(&of_pairs) == 0);
    let found = of_surface.unwrap_or(of_pairs);
    let directions = n_open(&found);
    let rotations = found.directions[..directions].iter().map(|d| {
        let axis: Vector3<f64> = d.fixed_rows::<3>(3).into_owned();
        axis * axis.transpose()
    });
    let rotations = eigen3(&rotations.sum::<Matrix3<f64>>())?;
    let sizes = rotations.eigenvalues.map(|size| size > ROTATION);
    let several = sizes.iter().filter(|large| **large).count() > 1;
    let axis = rotations.eigenvectors.column(rotations.eigenvalues.imax());
    let axis = (sizes.iter().any(|large| *large) && !several).then(|| [axis.x, axis.y, axis.z]);
    (directions > 0).then_some(CloudWarning::Undetermined { directions, axis })
}

/// Returns the motions that the surface determines, without the information of noise.
///
/// Noise of normals adds its square to the JᵀJ of the target. In ½ (JᵀK + KᵀJ), where K has normals
/// that are estimated from the points of the source alone, its mean is zero.
fn surface(of_pairs: &Observability, pairs: &Correspondences) -> Option<Observability> {
    let points: Vec<_> = pairs.as_slice().iter().map(|p| p.source.point).collect();
    let normals = estimate_normals(&points, CloudOptions::default().neighbors);
    let mut common = NormalEquations::new(of_pairs.pivot, of_pairs.length);
    for (pair, normal) in pairs.as_slice().iter().zip(normals) {
        let Some(normal) = normal else { continue };
        let (point, weight) = (pair.source.point.cast::<f64>(), f64::from(pair.weight));
        let target = pair.target.normal.into_inner().cast::<f64>();
        let source = normal.into_inner().cast::<f64>();
        let source = source * source.dot(&target).signum();
        common.add_row(&point, &((target + source) / 2.0), 0.0, weight);
        common.add_row(&point, &((target - source) / 2.0), 0.0, -weight);
    }
    common.observability()
}

/// Returns the warning about two clouds whose extents differ as if their units did.
fn extents(clouds: &[(CloudSide, &Cloud)]) -> Option<CloudWarning> {
    let [(_, source), (_, target)] = clouds else {
        return None;
    };
    let [source_meters, target_meters] = [source, target].map(|cloud| extent(cloud));
    let ratio = source_meters / target_meters;
    let differ = ratio > 0.0 && ratio.is_finite() && ratio.ln().abs() >= OTHER_UNIT.ln();
    differ.then_some(CloudWarning::Extents {
        source_meters,
        target_meters,
    })
}

/// Returns the diagonal of a cloud's bounding box, meters; 0 for no points.
fn extent(cloud: &Cloud) -> f64 {
    let points = cloud.surfels().iter().map(|surfel| surfel.point);
    bounds(points).map_or(0.0, |[low, high]| f64::from((high - low).norm()))
}

/// Returns the warnings about the preparation of a cloud.
fn warnings_of(side: CloudSide, cloud: &Cloud) -> impl Iterator<Item = CloudWarning> {
    let count = cloud.n_skipped();
    let skipped = (count > 0).then_some(CloudWarning::PointsSkipped { side, count });
    let estimated = cloud.normals_from().filter(|neighbors| *neighbors > 0);
    let estimated = estimated.map(|neighbors| CloudWarning::NormalsEstimated { side, neighbors });
    let step = coordinate_step(cloud.surfels().iter().map(|surfel| surfel.point));
    let coarse = step > FINE_METERS && step > COARSE * extent(cloud);
    let coarse = coarse.then_some(CloudWarning::CoarseCoordinates { side, step });
    skipped.into_iter().chain(estimated).chain(coarse)
}

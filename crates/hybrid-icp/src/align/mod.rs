//! One call from two point clouds to the pose between them.

mod settled;
mod warning;

use std::str::FromStr;

use hicp_association::{
    AllSamples, MaxDistance, NearestNeighbor, SearchIndex, Stride, estimate_normals,
    voxel_downsample,
};
use hicp_core::internal::named;
use hicp_core::{
    Cloud, Isometry3, Matrix6, Point3, Problem, Source, Surfel, Target, UnitVector3, UnknownName,
    Vector3,
};
use hicp_icp::{
    BoxedStage, Cascade, Icp, IterationLimit, Outcome, Session, Stage, Termination, Workspace,
};
use hicp_metric::{Conditioned, Degeneracy, Generalized, Minimize, PointToPlane, PointToPoint};
use hicp_raster::Rasterizer;
use thiserror::Error;

use self::settled::Settled;
pub use self::warning::{CloudSide, CloudWarning};
use self::warning::{LEAST_POINTS, extents, is_measured, undetermined, warnings_of};

/// Share of the source points with a counterpart below which a warning follows.
const LITTLE_OVERLAP: f64 = 0.3;

/// Information of a rotation, relative to the best determined direction, below which it stays as it
/// is, as in [`presets::local`](crate::presets::local).
const FROZEN: f64 = 0.005;

/// Gates of a registration without a stated one, as shares of the source's diameter.
const GATES: [f64; 2] = [0.1, 0.02];

/// The preparation of points for a registration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CloudOptions {
    /// Edge of the cubic cells in which points are replaced by their mean, meters; `None` keeps all
    /// points ([`voxel_downsample`]).
    pub voxel_meters: Option<f64>,
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

    /// Creates the target of a registration, as [`CloudOptions::cloud`] does.
    ///
    /// If the error does not depend on normals, no point is skipped for lack of one: scans of lines
    /// and edges determine none ([`Cloud::with_some_normals`]).
    ///
    /// # Errors
    ///
    /// As for [`CloudOptions::cloud`].
    pub fn target_of(
        &self,
        registration: Registration,
        points: &[Point3<f32>],
        normals: Option<&[UnitVector3<f32>]>,
    ) -> Result<Cloud, NormalCount> {
        let create = match registration {
            Registration::PointToPoint => Cloud::with_some_normals,
            _ => Cloud::new,
        };
        self.prepared(points, normals, create)
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
        self.prepared(points, normals, Cloud::new)
    }

    /// Prepares points and normals, and creates a cloud of them with a constructor.
    fn prepared(
        &self,
        points: &[Point3<f32>],
        normals: Option<&[UnitVector3<f32>]>,
        create: fn(Vec<Surfel>) -> Cloud,
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
            let cloud = create(points.iter().zip(normals).map(surfel).collect());
            return Ok(cloud.with_normals_from(self.neighbors));
        };
        Ok(create(points.iter().zip(normals).map(surfel).collect()))
    }
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
    PointToPlane,
    /// [`Generalized`] ICP (GICP), plane to plane, with the normals of both.
    ///
    /// It ends at fewer wrong poses without a warning than [`Registration::PointToPlane`], and
    /// takes 1.3 times as long.
    #[default]
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

    /// Builds the pipeline, which pairs every source point with its nearest target point.
    ///
    /// Pairs of more than `max_distance` meters are removed. If it is `None`, two stages run, with
    /// a tenth and then a fiftieth of the source's diameter. The first bridges large offsets, and
    /// the second leaves out points without a counterpart.
    ///
    /// A stage ends if a step moves the source by less than 0.1 mm and 0.01°, or after 100
    /// iterations. If the RMS radius of the paired points is below 33 mm, the limit is 3·10⁻³ of it
    /// instead of 0.1 mm. If it is above 3.3 m, the limit is 3·10⁻⁵ of it.
    #[must_use]
    pub fn build(self, max_distance: Option<f64>) -> BoxedStage {
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

fn stages<M>(metric: M, max_distance: Option<f64>) -> BoxedStage
where
    M: Minimize + Clone + Send + 'static,
{
    let stage = |filter| Icp {
        selection: AllSamples,
        association: NearestNeighbor::new(Stride::Pixels(1), SearchIndex::BoxTree),
        filter,
        metric: metric.clone(),
        stop: (Settled, IterationLimit(100)),
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
    /// `None` if a direction is not determined ([`CloudWarning::Undetermined`]), or if the last
    /// iteration froze a rotation. It does not contain wrong pairs, so it is optimistic where the
    /// clouds overlap in part. A nearest neighbor is rarely the same point of the surface, which
    /// also makes it optimistic: the mean of ξᵀΣ⁻¹ξ, which is 6 if Σ is right, was 9 to 17 with
    /// point-to-plane, 9 to 64 with GICP and 1200 to 1600 with point-to-point. These are random
    /// samples of a closed surface, 3,000 points each, with noise of up to 1 % of its radius (100
    /// pairs).
    #[must_use]
    pub fn covariance(&self) -> Option<Matrix6<f64>> {
        let is_open = |w: &CloudWarning| matches!(w, CloudWarning::Undetermined { .. });
        let quality = self.outcome.quality.as_ref()?;
        (quality.covariance()).filter(|_| !self.warnings.iter().any(is_open))
    }
}

/// Registers two point clouds from an initial pose `target_from_source`, in meters.
///
/// The source may also be a [`Model`](hicp_core::Model), and the target an
/// [`Observation`](hicp_core::Observation). The pipeline is that of [`Registration::build`], or any
/// other stage. If a component of it needs a mesh or an image that is absent, the outcome keeps the
/// initial pose and names the component. Never fails on data: without overlap, the outcome states
/// that no pairs were found.
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
/// let mut pipeline = Registration::default().build(None);
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
    let few = |(_, cloud): &(_, &Cloud)| cloud.surfels().len() < LEAST_POINTS;
    let few_pairs = session.workspace.pairs().len() < LEAST_POINTS || clouds.iter().any(few);
    let by_pairs = other_unit.is_some() || few_pairs;
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
    let iterations = outcome.iterations;
    let unsettled = outcome.termination == Termination::IterationLimit;
    let unsettled = unsettled.then_some(CloudWarning::Unsettled { iterations });
    alignment.warnings.extend(unsettled);
    let pairs = session.workspace.pairs();
    let neighbors = CloudOptions::default().neighbors;
    let open = (outcome.quality).and_then(|q| undetermined(&q, pairs, neighbors));
    alignment.warnings.extend(open);
    alignment
}

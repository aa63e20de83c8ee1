//! Warnings about two clouds and their registration.

use hicp_association::estimate_normals;
use hicp_core::internal::small::eigen3;
use hicp_core::internal::{bounds, coordinate_step};
use hicp_core::{Cloud, Correspondences, Matrix3, Point3, Vector3};
use hicp_icp::Quality;
use hicp_metric::{NormalEquations, Observability};
use thiserror::Error;

use crate::warning::Meters;

/// Information of a direction, relative to the best determined one, below which only noise
/// determines it: a multiple of the noise relative to the size of the pairs, within limits.
const UNDETERMINED: (f64, [f64; 2]) = (0.3, [0.002, 0.01]);

/// Ratio of the extents of two clouds without overlap from which a warning follows: less than that
/// of meters to centimeters.
const OTHER_UNIT: f64 = 30.0;

/// Largest distance between adjacent coordinates that never matters, also in a cloud of one point.
const FINE_METERS: f64 = 1e-6;

/// Share of the distance between neighboring points that rounding the coordinates may cost.
///
/// The pose averages over all points, so that it is more accurate than one of them.
const ROUNDING: f64 = 0.01;

/// Number of points that a pose needs.
pub(super) const LEAST_POINTS: usize = 6;

/// Largest number of pairs whose surface is examined.
const MOST_PAIRS: usize = 4000;
/// Number of patches that these make, with a normal each. Noise bends a smaller patch.
const PATCHES: usize = 40;

/// Squared share of a rotation in the open directions from which a warning names it.
const ROTATION: f64 = 0.1;

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
    /// The points are so far from their origin that `f32` rounds them by more than a hundredth of
    /// the distance between neighbors.
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
    /// A cloud has fewer points than a pose needs, without those that were skipped.
    #[error("{side}: {count} usable points, expected 6 or more: do not trust the pose")]
    FewPoints {
        /// The cloud.
        side: CloudSide,
        /// Number of points.
        count: usize,
    },
    /// The limit of iterations ended the registration, perhaps before it converged.
    #[error(
        "the registration ended at its limit after {iterations} iterations, perhaps before it converged: start again from the pose"
    )]
    Unsettled {
        /// Number of iterations of all stages.
        iterations: usize,
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
        meters: Option<f64>,
        side: CloudSide,
        points: &[Point3<f32>],
    ) -> Option<Self> {
        let meters = meters?;
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

/// Returns `true` if a point is finite and not at (0, 0, 0).
pub(super) fn is_measured(point: &Point3<f32>) -> bool {
    point.iter().all(|x| x.is_finite()) && *point != Point3::origin()
}

/// Returns the warning about directions that the pairs, or the surface that they show, leave open.
///
/// Normals of the source are estimated from `neighbors` or more.
pub(super) fn undetermined(
    quality: &Quality,
    pairs: &Correspondences,
    neighbors: usize,
) -> Option<CloudWarning> {
    let of_pairs = quality.observability()?;
    let (per_noise, [least, most]) = UNDETERMINED;
    let limit = (per_noise * quality.plane_rmse / of_pairs.length).clamp(least, most);
    let n_open = |found: &Observability| found.n_degenerate(limit);
    let of_surface = surface(&of_pairs, pairs, neighbors).filter(|_| n_open(&of_pairs) == 0);
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
/// that are estimated from the points of the source alone, its mean is zero. If most points have no
/// normal, as on lines, returns `None`.
fn surface(
    of_pairs: &Observability,
    pairs: &Correspondences,
    neighbors: usize,
) -> Option<Observability> {
    let pairs = pairs.as_slice();
    let some = pairs
        .iter()
        .step_by(pairs.len().div_ceil(MOST_PAIRS).max(1));
    let points: Vec<_> = some.clone().map(|pair| pair.source.point).collect();
    let normals = estimate_normals(&points, neighbors.max(points.len() / PATCHES));
    let mut common = NormalEquations::new(of_pairs.pivot, of_pairs.length);
    let mut used = 0;
    for (pair, normal) in some.zip(normals) {
        let has_normal = pair.target.normal.iter().all(|x| x.is_finite());
        let Some(normal) = normal.filter(|_| has_normal) else {
            continue;
        };
        used += 1;
        let (point, weight) = (pair.source.point.cast::<f64>(), f64::from(pair.weight));
        let target = pair.target.normal.into_inner().cast::<f64>();
        let source = normal.into_inner().cast::<f64>();
        let source = source * source.dot(&target).signum();
        common.add_row(&point, &((target + source) / 2.0), 0.0, weight);
        common.add_row(&point, &((target - source) / 2.0), 0.0, -weight);
    }
    common.observability().filter(|_| 2 * used > points.len())
}

/// Returns the warning about two clouds whose extents differ as if their units did.
pub(super) fn extents(clouds: &[(CloudSide, &Cloud)]) -> Option<CloudWarning> {
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
pub(super) fn warnings_of(side: CloudSide, cloud: &Cloud) -> impl Iterator<Item = CloudWarning> {
    let count = cloud.n_skipped();
    let skipped = (count > 0).then_some(CloudWarning::PointsSkipped { side, count });
    let estimated = cloud.normals_from().filter(|neighbors| *neighbors > 0);
    let estimated = estimated.map(|neighbors| CloudWarning::NormalsEstimated { side, neighbors });
    let usable = cloud.surfels().len();
    let few = (usable < LEAST_POINTS).then_some(CloudWarning::FewPoints {
        side,
        count: usable,
    });
    let step = coordinate_step(cloud.surfels().iter().map(|surfel| surfel.point));
    // As if the points were spread over a square.
    #[allow(clippy::cast_precision_loss)] // Counts far below 2⁵³.
    let spacing = extent(cloud) / (cloud.surfels().len() as f64).sqrt();
    let coarse = step > FINE_METERS && step > ROUNDING * spacing;
    let coarse = coarse.then_some(CloudWarning::CoarseCoordinates { side, step });
    let prepared = skipped.into_iter().chain(estimated);
    prepared.chain(few).chain(coarse)
}

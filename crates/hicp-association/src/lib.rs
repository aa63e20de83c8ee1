//! The traits [`PointSelection`], [`DataAssociation`] and [`OutlierFilter`], with implementations.
//!
//! They define which model points are registered, to which observed points, and which pairs are
//! kept.
//!
//! **Should you use this crate?** Yes, to write a custom association, selection or filter. Set
//! `default-features = false` if you do not want the k-d tree. To refine poses, use `hybrid-icp`.
//!
//! ```
//! use hicp_association::{DataAssociation, MaxDistance, MaxNormalAngle, OutlierFilter, Projective};
//! use hicp_core::{Context, Correspondences, Isometry3, Iteration, Surfel};
//!
//! fn gated_pairs(context: &mut Context<'_>, source: &[Surfel], pose: &Isometry3<f64>) -> Correspondences {
//!     let mut pairs = Correspondences::new();
//!     // An association only adds pairs: the caller stores the pose and the number of candidates.
//!     pairs.begin(pose, source.len());
//!     Projective.associate(context, source, pose, &mut pairs);
//!     let problem = context.problem;
//!     let filter = &mut (MaxDistance::diameters(0.25), MaxNormalAngle::degrees(60.0));
//!     filter.filter(&Iteration::new(0, pose, problem), &mut pairs);
//!     pairs
//! }
//! ```
//!
//! # Components
//!
//! | selections | associations | filters | weights |
//! |---|---|---|---|
//! | [`AllSamples`] | [`NearestNeighbor`] | [`MaxDistance`] | [`ConstantWeight`] |
//! | [`VisibleSurface`] | [`KNearest`] | [`MaxNormalAngle`] | [`DistanceWeight`] |
//! | [`VisibleSide`] | [`NormalCompatible`] | [`MedianDistance`] | [`NormalWeight`] |
//! | [`ObservedSurface`] | [`NormalShooting`] | [`MadDistance`] | [`SensorNoiseWeight`] |
//! | [`WithoutBoundary`] | [`Reciprocal`] | [`Trimmed`] | |
//! | [`UniformCount`] | [`Projective`] | [`VarTrimmed`] | |
//! | [`RandomSample`] | [`ProjectiveSearch`] | [`OneToOne`] | |
//! | [`VoxelGrid`] | [`ProjectiveInterpolated`] | [`BoundaryTargets`] | |
//! | [`NormalSpace`] | [`ObservationToModel`] | [`MinPairs`] | |
//! | [`StableSampling`] | [`ClosestPointOnMesh`] | [`Schedule`] | |
//! | | [`RenderedSurface`] | | |
//! | | [`Contour`] | | |
//!
//! Selections from [`WithoutBoundary`] on select from the points of another selection, and
//! [`Reciprocal`] from the pairs of another association. Filters and weights implement the same
//! trait and chain as tuples, in order. Associations join: a pair of them, or a `Vec`, gives the
//! pairs of all.
//!
//! [`estimate_normals`] and [`voxel_downsample`] prepare point clouds. [`PointSearch`] finds
//! nearest points for custom components.

// Image sizes and counts are converted to floating point; all are far below 2²⁴.
#![allow(clippy::cast_precision_loss)]

mod association;
mod boundary;
mod cloud;
mod filter;
mod length;
mod search;
mod selection;
mod stride;

pub use association::*;
pub use cloud::*;
pub use filter::*;
pub use length::Length;
pub use search::{Nearest, PointSearch};
pub use selection::*;
pub use stride::Stride;

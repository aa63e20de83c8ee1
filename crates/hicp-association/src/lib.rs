//! Which model points are registered, to which observed points, and which pairs are kept: the traits [`PointSelection`],
//! [`DataAssociation`] and [`OutlierFilter`] with their implementations.
//!
//! **Should you use this crate?** To write an association, a selection or a filter of your own, yes, with
//! `default-features = false` if you do not want the k-d tree. To refine poses, use `hybrid-icp`.
//!
//! ```
//! use hicp_association::{DataAssociation, MaxDistance, MaxNormalAngle, OutlierFilter, Projective};
//! use hicp_core::{Context, Correspondences, Isometry3, Problem, Surfel};
//!
//! fn gated_pairs(context: &mut Context<'_>, source: &[Surfel], pose: &Isometry3<f64>) -> Correspondences {
//!     let mut pairs = Correspondences::new();
//!     Projective.associate(context, source, pose, &mut pairs);
//!     let problem = context.problem;
//!     (MaxDistance::diameters(0.25), MaxNormalAngle::degrees(60.0)).filter(&problem, &mut pairs);
//!     pairs
//! }
//! ```
//!
//! # What there is
//!
//! | selections | associations | filters | weights |
//! |---|---|---|---|
//! | [`AllSamples`] | `NearestNeighbor`, [`WarmNearestNeighbor`], [`OrganizedNearestNeighbor`] | [`MaxDistance`] | [`ConstantWeight`] |
//! | [`VisibleSurface`] | [`KNearest`] | [`MaxNormalAngle`] | [`DistanceWeight`] |
//! | [`ObservedSurface`] | [`NormalCompatible`] | [`MedianDistance`] | [`NormalWeight`] |
//! | [`WithoutBoundary`] | [`NormalShooting`] | [`MadDistance`] | [`SensorNoiseWeight`] |
//! | [`UniformCount`] | [`Reciprocal`] | [`Trimmed`] | |
//! | [`RandomSample`] | [`Projective`] | [`VarTrimmed`] | |
//! | [`VoxelGrid`] | [`ProjectiveSearch`] | [`OneToOne`] | |
//! | [`NormalSpace`] | [`ProjectiveInterpolated`] | [`BoundaryTargets`] | |
//! | [`StableSampling`] | [`ObservationToModel`] | [`MinPairs`] | |
//! | | [`ClosestPointOnMesh`] | | |
//!
//! Selections from [`WithoutBoundary`] on choose among the points of another one, and [`Reciprocal`] among the pairs of
//! another association: they nest. Filters and weights are of one trait and chain as tuples, in order.
//!
//! Modules in reading order:
//! - `selection` (trait), `all_samples`, `visible_surface`, `observed_surface`, `stride`; of another selection
//!   `uniform_count`, `random_sample`, `voxel_grid`, `normal_space`, `stable_sampling`, `without_boundary`;
//! - `association` (trait), `projective`, `projective_search`, `projective_interpolated`; `nearest_neighbor` (feature `kiddo`, on
//!   by default), `warm_nearest_neighbor`, `organized_nearest_neighbor`, `k_nearest`, `normal_compatible`, `normal_shooting`, `reciprocal`; from the observation `observation_to_model`, `closest_point_on_mesh`;
//! - `filter` (trait), `max_distance`, `max_normal_angle`, `median_distance`, `mad_distance`, `trimmed`, `var_trimmed`, `one_to_one`,
//!   `boundary_targets`, `min_pairs`, `schedule`; `constant_weight`, `distance_weight`, `normal_weight`, `sensor_noise_weight`;
//! - what they share: `length`, `wide_tree`, `point_grid`, `box_tree` with `point_tree`, `observed_points` and `triangle`, `pixel_projection`, `boundary`, `distances`, `keep`, `scratch`.

// Image sizes and counts become floating point numbers; all are far below 2²⁴.
#![allow(clippy::cast_precision_loss)]

mod all_samples;
mod association;
mod boundary;
mod boundary_targets;
mod box_tree;
mod closest_point_on_mesh;
mod constant_weight;
mod distance_weight;
mod distances;
mod filter;
mod k_nearest;
mod keep;
mod length;
mod mad_distance;
mod max_distance;
mod max_normal_angle;
mod median_distance;
mod min_pairs;
#[cfg(feature = "kiddo")]
mod nearest_neighbor;
mod normal_compatible;
mod normal_shooting;
mod normal_space;
mod normal_weight;
mod observation_to_model;
mod observed_points;
mod observed_surface;
mod one_to_one;
mod organized_nearest_neighbor;
mod pixel_projection;
mod point_grid;
mod point_tree;
mod projective;
mod projective_interpolated;
mod projective_search;
mod random_sample;
mod reciprocal;
mod schedule;
mod scratch;
mod selection;
mod sensor_noise_weight;
mod stable_sampling;
mod stride;
mod triangle;
mod trimmed;
mod uniform_count;
mod var_trimmed;
mod visible_surface;
mod voxel_grid;
mod warm_nearest_neighbor;
mod wide_tree;
mod without_boundary;

pub use all_samples::AllSamples;
pub use association::DataAssociation;
pub use boundary_targets::BoundaryTargets;
pub use closest_point_on_mesh::ClosestPointOnMesh;
pub use constant_weight::ConstantWeight;
pub use distance_weight::DistanceWeight;
pub use filter::OutlierFilter;
pub use k_nearest::KNearest;
pub use length::Length;
pub use mad_distance::MadDistance;
pub use max_distance::MaxDistance;
pub use max_normal_angle::MaxNormalAngle;
pub use median_distance::MedianDistance;
pub use min_pairs::MinPairs;
#[cfg(feature = "kiddo")]
pub use nearest_neighbor::NearestNeighbor;
pub use normal_compatible::NormalCompatible;
pub use normal_shooting::NormalShooting;
pub use normal_space::NormalSpace;
pub use normal_weight::NormalWeight;
pub use observation_to_model::ObservationToModel;
pub use observed_surface::ObservedSurface;
pub use one_to_one::OneToOne;
pub use organized_nearest_neighbor::OrganizedNearestNeighbor;
pub use projective::Projective;
pub use projective_interpolated::ProjectiveInterpolated;
pub use projective_search::ProjectiveSearch;
pub use random_sample::RandomSample;
pub use reciprocal::Reciprocal;
pub use schedule::Schedule;
pub use selection::PointSelection;
pub use sensor_noise_weight::{SensorNoise, SensorNoiseWeight};
pub use stable_sampling::StableSampling;
pub use stride::Stride;
pub use trimmed::Trimmed;
pub use uniform_count::UniformCount;
pub use var_trimmed::VarTrimmed;
pub use visible_surface::VisibleSurface;
pub use voxel_grid::VoxelGrid;
pub use warm_nearest_neighbor::WarmNearestNeighbor;
pub use without_boundary::WithoutBoundary;

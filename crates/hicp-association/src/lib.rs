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
//! Modules in reading order: `selection` (trait), `all_samples`, `visible_surface`, `stride`; `association` (trait),
//! `projective`, `nearest_neighbor` (feature `kiddo`, on by default); `filter` (trait), `max_distance`, `max_normal_angle`.

// Image sizes and counts become floating point numbers; all are far below 2²⁴.
#![allow(clippy::cast_precision_loss)]

mod all_samples;
mod association;
mod filter;
mod max_distance;
mod max_normal_angle;
#[cfg(feature = "kiddo")]
mod nearest_neighbor;
mod projective;
mod selection;
mod stride;
mod visible_surface;

pub use all_samples::AllSamples;
pub use association::DataAssociation;
pub use filter::OutlierFilter;
pub use max_distance::MaxDistance;
pub use max_normal_angle::MaxNormalAngle;
#[cfg(feature = "kiddo")]
pub use nearest_neighbor::NearestNeighbor;
pub use projective::Projective;
pub use selection::PointSelection;
pub use stride::Stride;
pub use visible_surface::VisibleSurface;

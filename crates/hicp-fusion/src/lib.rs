//! Fuses pose estimates on SE(3) while the camera moves.
//!
//! - [`Fuser`]: the trait. A custom fuser implements it.
//! - [`Fusion`], [`fuse`]: the fusion of Barfoot & Furgale.
//! - [`FusionMethod`]: the paper's six methods (§V-A).
//! - [`Gated`], [`SymmetryAware`], [`SharedError`]: fusers around a fuser.
//!
//! **Should you use this crate?** Yes, to fuse poses with covariances from any source: it depends
//! on `hicp-core` only, and re-exports it. To estimate a pose from images along a trajectory, use
//! `hybrid_icp::SequentialEstimator`, which drives a fuser.
//!
//! ```
//! use hicp_fusion::hicp_core::{Isometry3, Point3, Vector3};
//! use hicp_fusion::{CameraMotion, Fuser, FuserConfig, FusionMethod, PoseEstimate, UnitCovariance};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // An object with a radius of 6 cm around its origin.
//! let unit = UnitCovariance::about_object(Point3::origin(), 0.06)?;
//! let method: FusionMethod = "weighted-average".parse()?;
//! let mut fuser = method.build(FuserConfig { unit, ..FuserConfig::default() });
//!
//! // A good estimate at half a meter. The camera advances by 10 cm, and the next has twice the variance.
//! let first = Isometry3::translation(0.0, 0.0, 0.500);
//! fuser.update(&PoseEstimate::new(first, unit.at(&first) * 0.1)?);
//! fuser.propagate(&CameraMotion::new(Isometry3::translation(0.0, 0.0, -0.100))?);
//! let second = Isometry3::translation(0.003, 0.0, 0.400);
//! fuser.update(&PoseEstimate::new(second, unit.at(&second) * 0.2)?);
//!
//! let fused = fuser.estimate().ok_or("nothing fused")?;
//! let position = fused.camera_from_object().translation.vector;
//! assert!((position - Vector3::new(0.001, 0.0, 0.400)).norm() < 1e-9);
//! # Ok(()) }
//! ```
//!
//! Conventions: poses are `camera_from_object`. Twists are ξ = [ρ; φ], translation first, in meters
//! and radians. Covariances describe left perturbations T = exp(ξ^) T̄ in the camera frame.

mod covariance;
mod estimate;
mod fuser;
mod fusion;
mod information;
mod motion;
mod solution;
mod tails;
mod unit;

pub use covariance::{CovarianceModel, InflatedCovariance, MVE_FLOOR, MveCovariance};
pub use estimate::{FusionError, MAX_TRANSLATION_METERS, PoseEstimate};
pub use fuser::*;
pub use fusion::{Fusion, fuse};
pub use hicp_core;
pub use information::MIN_STANDARD_DEVIATION;
pub use motion::{CameraMotion, Transport};
pub use solution::{Fused, FusionLimits, Solution};
pub use tails::probability_within;
pub use unit::UnitCovariance;

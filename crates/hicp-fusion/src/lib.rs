//! Fusing pose estimates on SE(3) while the camera moves: the trait [`Fuser`], Barfoot & Furgale's fusion ([`Fusion`], [`fuse`]), the
//! paper's six methods ([`FusionMethod`], §V-A), and fusers that look at what they are given ([`Gated`], [`SymmetryAware`], [`SharedError`]).
//!
//! **Should you use this crate?** To fuse poses with covariances, whoever made them, yes: it depends on `hicp-core` alone. To
//! estimate a pose from images along a trajectory, use `hybrid_icp::SequentialEstimator`, which drives a fuser.
//!
//! ```
//! use hicp_core::{Isometry3, Matrix6, Point3, Vector3};
//! use hicp_fusion::{CameraMotion, Fuser, FuserConfig, FusionMethod, PoseEstimate, UnitCovariance};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // An object of 6 cm radius about its origin.
//! let unit = UnitCovariance::about_object(Point3::origin(), 0.06)?;
//! let method: FusionMethod = "weighted-average".parse()?;
//! let mut fuser = method.build(FuserConfig { unit, ..FuserConfig::default() });
//!
//! // Half a metre away, seen well; the camera then advances by 10 cm, and the object is seen half as well.
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
//! Conventions: `camera_from_object`; twists ξ = [ρ; φ], translation first, metres and radians; covariances are those of left
//! perturbations T = exp(ξ^) T̄, in the camera frame.

mod batch;
mod config;
mod covariance;
mod error;
mod estimate;
mod fuser;
mod fusion;
mod gate;
mod method;
mod motion;
mod recursive;
mod shared_error;
mod single;
mod symmetry_aware;
mod tails;
mod unit;

pub use batch::BatchFuser;
pub use config::FuserConfig;
pub use covariance::{CovarianceModel, InflatedCovariance, MVE_FLOOR, MveCovariance};
pub use error::FusionError;
pub use estimate::{MAX_TRANSLATION_METERS, MAX_VARIANCE, MIN_STANDARD_DEVIATION, PoseEstimate};
pub use fuser::{Failure, Fuser, Update};
pub use fusion::{Fused, Fusion, FusionLimits, Solution, fuse};
pub use gate::{CHI_SQUARED_6_999, Gate, Gated};
pub use method::{BoxedFuser, FusionMethod, UnknownMethod};
pub use motion::{CameraMotion, Transport};
pub use recursive::RecursiveFuser;
pub use shared_error::SharedError;
pub use single::{LastEstimate, MostConfident};
pub use symmetry_aware::SymmetryAware;
pub use tails::probability_within;
pub use unit::UnitCovariance;

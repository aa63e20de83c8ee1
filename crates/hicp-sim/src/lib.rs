//! Synthetic scenes from a seed: procedural household objects, object poses, perturbed initial
//! poses and depth noise.
//!
//! **Should you use this crate?** Use it to try a pipeline without a dataset, or to test a
//! component against known ground truth.
//!
//! ```
//! use hicp_sim::{Household, perturb, rng};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mug = Household::Mug.model()?;
//! assert!(mug.mesh().is_closed());
//! let mut rng = rng(7);
//! let truth = hicp_sim::object_pose(&mut rng, &mug.center(), 0.3..0.6, 0.02);
//! let init = perturb(&mut rng, &truth, 0.0062, 9.5_f64.to_radians());
//! let (angle, distance) = hicp_core::se3::pose_distance(&init, &truth);
//! assert!((angle.to_degrees() - 9.5).abs() < 1e-9 && (distance - 0.0062).abs() < 1e-12);
//! # Ok(()) }
//! ```

// Counts of profile points are converted to floating-point numbers.
#![allow(clippy::cast_precision_loss)]

mod case;
mod clutter;
mod corruption;
mod error;
mod field;
mod hand;
mod mask;
mod moving;
mod objects;
mod photo;
mod reconstruction;
mod sampling;
mod sensor;
mod stream;
mod trajectory;
mod tsdf;

pub use case::{Case, CaseConfig, CaseMaker, InitialPose, Start, VsdBins, rotation_of};
pub use clutter::{Clutter, ClutterView, PlacedObject, SeenObject};
pub use corruption::{Corruption, OCCLUDER_GAP_METERS};
pub use error::SimError;
pub use mask::MaskDefects;
pub use moving::{Hand, MovingConfig, MovingScene};
pub use objects::{Household, Proportions, Solid, Texture, invented};
pub use photo::Lighting;
pub use reconstruction::{MIN_COMPONENT_SHARE, Reconstruction, ReconstructionNoise, WrongPose};
pub use sampling::{
    DEGREES_PER_MILLIMETER, MEAN_ROTATION_ERROR_DEGREES, MEAN_TRANSLATION_ERROR_METERS,
    object_pose, perturb, perturb_by_mean, rotation, unit_vector,
};
pub use sensor::{
    DEPTH_EDGE_METERS, DepthNoise, DepthSensor, Distortion, Dropout, RelativeGaussian,
};
pub use stream::stream;
pub use trajectory::Trajectory;
pub use tsdf::{Component, MAX_VOXELS, ScalarGrid, TsdfConfig, TsdfVolume, components, join};

/// The random generator of all simulations: small, fast, and the same on every machine and in every
/// version.
pub type SimRng = rand_pcg::Pcg64Mcg;

/// Creates the generator for a seed.
#[must_use]
pub fn rng(seed: u64) -> SimRng {
    rand::SeedableRng::seed_from_u64(seed)
}

/// Rounds to `f32`, the precision of images and meshes.
#[allow(clippy::cast_possible_truncation)]
fn narrow(number: f64) -> f32 {
    number as f32
}

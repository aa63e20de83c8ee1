//! Scores and pose errors.
//!
//! - [`Score`]: the trait. [`MeanVsd`] (the paper's MVE) scores a pose against the live image,
//!   [`SampledMve`] ranks many poses, and [`Vsd`] compares with a known true pose.
//! - [`Evidence`]: what agrees with a pose, what contradicts it, and how well the mask fits.
//! - [`Confidence`]: the probability that a pose is right, from the evidence and its [`Misfit`].
//!   [`Doubt`] is 1 minus that probability, as a score.
//! - [`ColorAgreement`]: compares colors, and returns how strong their evidence is.
//!   [`SampledColor`] ranks many poses.
//! - [`Flatness`]: recognizes a wall in the mask.
//! - [`bop_vsd`], [`mssd`], [`mspd`], [`add`], [`adi`], [`Recalls`]: errors and recalls of the BOP
//!   benchmark. [`ModelPoints`] prepares a model for many pairs of poses.
//! - [`roc_area`], [`reliability`]: the separation of correct poses from wrong ones by a score.
//!
//! **Should you use this crate?** Yes, to judge poses from any source, with or without ground
//! truth. To refine poses, use `hybrid-icp`, which reports the MVE of the refined pose. `hicp-core`
//! is re-exported.
//!
//! ```
//! use hicp_score::hicp_core::{DistanceImage, Mask};
//! # fn main() -> Result<(), hicp_score::ScoreError> {
//! let truth = DistanceImage::new(2, 1, vec![0.500, 0.500])?;
//! let estimate = DistanceImage::new(2, 1, vec![0.500, 0.512])?;
//! let mask = Mask::full(2, 1);
//! let errors = hicp_score::vsd(&estimate, &mask, &truth, &mask, 0.1)?;
//! assert_eq!(errors[0], 0.5); // 12 mm is wrong at a tolerance of 5 mm …
//! assert_eq!(errors[2], 0.0); // … and right at 15 mm.
//! # Ok(()) }
//! ```

// Counts are converted to floating point; all are far below 2⁵³.
#![allow(clippy::cast_precision_loss)]

mod color;
mod errors;
mod judgment;
mod mve;
mod score;
mod tolerances;

pub use color::{ColorAgreement, ColorEvidence, SampledColor, Shading};
pub use errors::{
    MSSD_MM, ModelPoints, N_THRESHOLDS, PoseErrors, Recalls, ScoreError, TargetErrors, Vsd, add,
    adi, bop_vsd, match_instances, most_visible, mspd, mssd, spheres_overlap, top_estimates,
    visibility_masks, vsd,
};
pub use hicp_core;
pub use judgment::{
    Confidence, Doubt, Evidence, Flatness, LabeledScore, Misfit, N_FEATURES, ReliabilityBin,
    reliability, roc_area,
};
pub use mve::{MaskTrust, MeanVsd, Occlusion, SampledMve, VISIBILITY_TOLERANCE_METERS};
pub use score::Score;
pub use tolerances::{N_TOLERANCES, tolerances};

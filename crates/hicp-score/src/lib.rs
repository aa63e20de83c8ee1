//! Scores of a pose: Visible Surface Discrepancy ([`vsd`], [`Vsd`]), the mean VSD estimate against the live image
//! ([`MeanVsd`], the paper's MVE), and distances between model points ([`add`], [`adi`]).
//!
//! **Should you use this crate?** To judge poses, with or without ground truth, whoever made them: yes. To refine them, use
//! `hybrid-icp`, which reports the MVE of what it returns.
//!
//! ```
//! use hicp_core::{DistanceImage, Mask};
//! # fn main() -> Result<(), hicp_score::ScoreError> {
//! let truth = DistanceImage::new(2, 1, vec![0.500, 0.500])?;
//! let estimate = DistanceImage::new(2, 1, vec![0.500, 0.512])?;
//! let mask = Mask::full(2, 1);
//! let errors = hicp_score::vsd(&estimate, &mask, &truth, &mask, 0.1)?;
//! assert_eq!(errors[0], 0.5); // 12 mm is wrong at a tolerance of 5 mm …
//! assert_eq!(errors[2], 0.0); // … and right at 15 mm.
//! # Ok(()) }
//! ```
//!
//! Modules in reading order: `score` (trait), `mean_vsd`, `vsd`, `tolerances`, `pose_error`, `error`.

// Counts become floating point numbers; all are far below 2⁵³.
#![allow(clippy::cast_precision_loss)]

mod agreement;
mod error;
mod mean_vsd;
mod pose_error;
mod score;
mod tolerances;
mod vsd;

pub use error::ScoreError;
pub use mean_vsd::{MeanVsd, VISIBILITY_TOLERANCE_METERS};
pub use pose_error::{add, adi};
pub use score::Score;
pub use tolerances::{N_TOLERANCES, tolerances};
pub use vsd::{Vsd, visibility_masks, vsd};

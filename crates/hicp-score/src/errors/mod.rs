//! Errors of a pose against the true one, and their recalls.

pub(crate) mod bop_vsd;
pub(crate) mod model_points;
pub(crate) mod nearest;
pub(crate) mod pose_error;
pub(crate) mod recall;
pub(crate) mod vsd;

pub use bop_vsd::{bop_vsd, spheres_overlap};
pub use model_points::ModelPoints;
pub use pose_error::{add, adi, mspd, mssd};
pub use recall::{
    MSSD_MM, N_THRESHOLDS, PoseErrors, Recalls, TargetErrors, match_instances, most_visible,
    top_estimates,
};
pub use vsd::{ScoreError, Vsd, visibility_masks, vsd};

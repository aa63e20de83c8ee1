//! Limits on the work that a pipeline file may request.

/// The work that a pipeline file may request before it is refused with
/// [`PipelineErrorKind::Limit`](crate::PipelineErrorKind::Limit).
///
/// A file can come from anywhere, and a few words of it can request years of work. The defaults are
/// more than a hundred times what any preset needs in the worst case.
/// [`PipelineFile::build`](crate::PipelineFile::build) uses them, and
/// [`PipelineFile::build_within`](crate::PipelineFile::build_within) accepts others. Stages that
/// are composed in Rust are not limited.
///
/// ```
/// use hicp_pipeline::{PipelineFile, PipelineLimits};
/// # fn main() -> Result<(), hicp_pipeline::PipelineError> {
/// let text = r#"
/// type = "repeat"
/// stage = { type = "icp", selection = "all-samples", association = "projective", metric = "symmetric" }
/// "#;
/// let mut file = PipelineFile::parse(text, "mine")?;
/// file.set("times=1000000000")?;
/// let error = file.build().map(|_| ()).unwrap_err().to_string();
/// assert!(error.starts_with("mine: times: found 1000000000"));
/// assert!(file.build_within(&PipelineLimits::NONE).is_ok());
/// # Ok(()) }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PipelineLimits {
    /// Iterations of a whole run in the worst case: 1 million.
    ///
    /// A ranked hypothesis counts as one, and so does every step that a solver takes within an
    /// iteration.
    pub max_iterations: u64,
    /// Hypotheses of a search: 100 000.
    pub max_hypotheses: u64,
    /// Points that a part samples on the model: 1 million, of 24 bytes each.
    pub max_samples: u64,
    /// Neighbors of a point that an association considers: 100. All of them may become pairs.
    pub max_neighbors: u64,
}

impl PipelineLimits {
    /// The limits of [`PipelineFile::build`](crate::PipelineFile::build).
    pub const DEFAULT: Self = Self {
        max_iterations: 1_000_000,
        max_hypotheses: 100_000,
        max_samples: 1_000_000,
        max_neighbors: 100,
    };

    /// No limits.
    pub const NONE: Self = Self {
        max_iterations: u64::MAX,
        max_hypotheses: u64::MAX,
        max_samples: u64::MAX,
        max_neighbors: u64::MAX,
    };
}

impl Default for PipelineLimits {
    fn default() -> Self {
        Self::DEFAULT
    }
}

//! How much work a pipeline file may ask for.

use hicp_icp::MAX_ITERATIONS;

use super::catalog::PartKind;
use super::error::PipelineError;
use super::reader::Reader;

/// How much work a pipeline file may ask for before it is refused with [`PipelineError::Limit`].
///
/// A file comes from anywhere, and a few words of it may ask for years. The defaults are more than a hundred times what any preset
/// asks for at worst. [`PipelineFile::build`](crate::PipelineFile::build) uses them,
/// [`PipelineFile::build_within`](crate::PipelineFile::build_within) takes others; stages composed in Rust are not limited.
///
/// ```
/// use hybrid_icp::{PipelineFile, PipelineLimits, Preset};
/// # fn main() -> Result<(), hybrid_icp::PipelineError> {
/// let mut file = PipelineFile::parse(Preset::Hybrid.toml(), "hybrid")?;
/// file.set("times=1000000000")?;
/// let error = file.build().map(|_| ()).unwrap_err().to_string();
/// assert!(error.starts_with("hybrid: times: found 1000000000"));
/// assert!(file.build_within(&PipelineLimits::NONE).is_ok());
/// # Ok(()) }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PipelineLimits {
    /// Iterations of a whole run at most, every stage as often and as long as it may: 1 million. A hypothesis that is ranked counts
    /// as one, and so does every step that a solver takes within an iteration.
    pub max_iterations: u64,
    /// Hypotheses of a search: 100 000.
    pub max_hypotheses: u64,
    /// Points that an association or a score samples on the model: 1 million, of 24 bytes each.
    pub max_samples: u64,
    /// Neighbours of a point that an association looks at: 100. All of them may become pairs.
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

    /// Refuses a pipeline that asks for more time or memory than the limits.
    pub(super) fn check(&self, pipeline: &Reader<'_>) -> Result<(), PipelineError> {
        self.sizes(pipeline)?;
        self.iterations(pipeline).map(|_| ())
    }

    /// Refuses sizes above their limits, in all parts of a part.
    fn sizes(&self, part: &Reader<'_>) -> Result<(), PipelineError> {
        let limited = [
            ("samples", "samples", self.max_samples, "max_samples"),
            ("k", "neighbors", self.max_neighbors, "max_neighbors"),
        ];
        for (field, what, limit, limit_field) in limited {
            if part.has(field) {
                let count = u64::from(part.count(field)?);
                if count > limit {
                    return Err(part.above(field, format!("{count} {what}"), limit, limit_field));
                }
            }
        }
        part.held()?.iter().try_for_each(|inner| self.sizes(inner))
    }

    /// Refuses a stage that may take more iterations than the limit; returns how many those are at most.
    ///
    /// The innermost field that takes it above the limit is the one that is named.
    fn iterations(&self, stage: &Reader<'_>) -> Result<u64, PipelineError> {
        let one = |field: &str| self.iterations(&stage.part(field)?);
        match stage.name() {
            "icp" => {
                let mut iterations = MAX_ITERATIONS as u64;
                for rule in stage.parts("stop")? {
                    if rule.name() == "iteration-limit" {
                        iterations = iterations.min(rule.count("iterations")?.into());
                    }
                }
                let steps = self.steps(&stage.part("metric")?)?;
                self.within(stage, "metric", product(iterations.max(1), steps))
            }
            "cascade" => self.sum(stage, "stages"),
            "repeat" | "keep-best" => self.times(stage, "times", one("stage")?),
            "switch" => Ok(one("aligned")?.max(one("misaligned")?)),
            // Only one of them runs.
            "switch-among" => {
                let each = stage.parts("stages")?;
                each.iter()
                    .try_fold(0, |most: u64, part| Ok(most.max(self.iterations(part)?)))
            }
            "alternate" => {
                let worse = one("aligned")?.max(one("misaligned")?);
                self.times(stage, "max_steps", worse)
            }
            "anderson" => self.times(stage, "max_steps", one("stage")?),
            "hypothesis-search" => {
                let hypotheses = u64::from(stage.count("hypotheses")?);
                if hypotheses > self.max_hypotheses {
                    return Err(stage.above(
                        "hypotheses",
                        format!("{hypotheses} hypotheses"),
                        self.max_hypotheses,
                        "max_hypotheses",
                    ));
                }
                let refined = stage.count("refined")?.into();
                // The local stage once from where it begins, and once from the best hypothesis.
                let local = product(2, one("stage")?);
                let explored = product(refined, one("explore")?);
                let total = local.saturating_add(hypotheses).saturating_add(explored);
                self.within(stage, "refined", total)
            }
            "at-resolution" | "guard" => one("stage"),
            _ => Err(stage.unknown(PartKind::Stage)),
        }
    }

    /// Steps that a metric takes within an iteration at most.
    fn steps(&self, metric: &Reader<'_>) -> Result<u64, PipelineError> {
        let inner = || self.steps(&metric.part("metric")?);
        match metric.name() {
            "gauss-newton" | "levenberg-marquardt" => self.times(metric, "iterations", inner()?),
            "robust" | "pose-prior" | "frozen" | "conditioned" => inner(),
            "weighted-sum" | "metric-schedule" => {
                let mut most = 1;
                for part in metric.parts("metrics")? {
                    most = most.max(self.steps(&part)?);
                }
                Ok(most)
            }
            _ => Ok(1),
        }
    }

    fn times(&self, part: &Reader<'_>, field: &str, inner: u64) -> Result<u64, PipelineError> {
        let times = u64::from(part.count(field)?);
        self.within(part, field, product(times, inner.max(1)))
    }

    fn sum(&self, part: &Reader<'_>, field: &str) -> Result<u64, PipelineError> {
        let mut total = 0_u64;
        for inner in part.parts(field)? {
            total = total.saturating_add(self.iterations(&inner)?);
        }
        self.within(part, field, total)
    }

    fn within(&self, part: &Reader<'_>, field: &str, total: u64) -> Result<u64, PipelineError> {
        if total <= self.max_iterations {
            return Ok(total);
        }
        let most = format!("up to {total} iterations in all");
        Err(part.above(field, most, self.max_iterations, "max_iterations"))
    }
}

impl Default for PipelineLimits {
    fn default() -> Self {
        Self::DEFAULT
    }
}

fn product(a: u64, b: u64) -> u64 {
    a.saturating_mul(b)
}

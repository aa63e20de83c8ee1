//! The work that a pipeline may take, checked against the limits.

use toml::de::DeValue;

use crate::build::Parameters;
use crate::error::{PipelineError, PipelineErrorKind};
use crate::limits::PipelineLimits;

/// Counts that [`PipelineLimits`] bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limited {
    /// Hypotheses of a search.
    Hypotheses,
    /// Points sampled on the model.
    Samples,
    /// Neighbors of a point.
    Neighbors,
}

impl Parameters<'_> {
    /// Reads a whole number of at least `min`, and refuses it above its limit.
    pub fn limited(
        &mut self,
        limited: Limited,
        name: &'static str,
        min: u32,
        default: u32,
        meaning: &'static str,
    ) -> Result<usize, PipelineError> {
        let count: u32 = self.count(name, min, default, meaning)?;
        let limits = self.limits();
        let (what, limit) = match limited {
            Limited::Hypotheses => ("hypotheses", (limits.max_hypotheses, "max_hypotheses")),
            Limited::Samples => ("samples", (limits.max_samples, "max_samples")),
            Limited::Neighbors => ("neighbors", (limits.max_neighbors, "max_neighbors")),
        };
        self.check(name, count.into(), format!("{count} {what}"), limit)?;
        Ok(count as usize)
    }

    /// Declares that the part runs its inner parts, which were read before, up to `times` times.
    ///
    /// `field` is the parameter with this number. A part that does not call this method counts as
    /// running the longest of its inner parts once.
    pub fn repeats(&mut self, field: &'static str, times: usize) -> Result<(), PipelineError> {
        let inner = self.inner.iter().map(|(_, iterations)| *iterations).max();
        let total = inner.unwrap_or(1).max(1).saturating_mul(times as u64);
        self.takes(field, total)
    }

    /// Declares the iterations that the part may take; `field` is the parameter with their number.
    pub(crate) fn takes(&mut self, field: &str, iterations: u64) -> Result<(), PipelineError> {
        self.iterations = Some(iterations);
        let limit = (self.limits().max_iterations, "max_iterations");
        let what = format!("up to {iterations} iterations in all");
        self.check(field, iterations, what, limit)
    }

    /// Returns the iterations that the inner parts of a field may take, in order.
    pub(crate) fn iterations_of(&self, field: &str) -> impl Iterator<Item = u64> {
        let inner = self.inner.iter().filter(move |(name, _)| *name == field);
        inner.map(|(_, iterations)| *iterations)
    }

    /// Declares that this rule ends a stage after a number of iterations.
    pub(crate) fn ends_after(&mut self, iterations: usize) {
        self.iterations = Some(iterations as u64);
    }

    /// Returns the limits of the file.
    fn limits(&self) -> PipelineLimits {
        let context = self.reading.as_ref().map(|(context, _)| context);
        context.map_or(PipelineLimits::NONE, |context| *context.limits)
    }

    /// Refuses a field that requests more than a limit; `what` is what it requests.
    fn check(
        &self,
        field: &str,
        amount: u64,
        what: String,
        (limit, limit_field): (u64, &'static str),
    ) -> Result<(), PipelineError> {
        let Some((context, fields)) = self.reading.as_ref().filter(|_| amount > limit) else {
            return Ok(());
        };
        let (found, spot) = fields.field(field);
        let found = match found {
            Some(DeValue::Integer(number)) => format!("{number}, {what}"),
            _ => what,
        };
        let option = limit_field.replace('_', "-");
        let problem = format!(
            "found {found}, expected at most {limit}: raise the limit (--{option} N, PipelineLimits::{limit_field}) if that is meant"
        );
        Err(context.error(PipelineErrorKind::Limit, &spot, problem))
    }
}

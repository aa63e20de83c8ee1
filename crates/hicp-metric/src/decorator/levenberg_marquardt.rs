//! Levenberg–Marquardt iterations over fixed pairs.

use std::mem;

use hicp_core::{Correspondences, Isometry3, Iteration, se3};

use crate::decorator::moved::{compose, move_sources};
use crate::metric::error_metric::Step;
use crate::metric::minimize::Minimize;

/// How much the damping grows when a step is rejected and shrinks when one is accepted.
const FACTOR: f64 = 10.0;
/// Damping beyond which no step is left.
const MAX_DAMPING: f64 = 1e12;
const MIN_DAMPING: f64 = 1e-12;

/// Iterates over one set of pairs like [`crate::GaussNewton`], but takes only steps that lower the mean loss.
///
/// The normal equations are damped by λ diag(JᵀWJ) (Levenberg 1944; Marquardt 1963) in scaled unknowns, each diagonal entry at
/// least 10⁻⁶ of the mean; so λ has no unit. A step is tried on a copy of the pairs: if the metric's
/// [`Minimize::mean_loss`] there is lower, λ falls by 10; if not, the step is discarded and λ grows by 10. The mean loss after
/// the increment is therefore never above the one before, which is the one reported.
///
/// No step where the first linearisation gives none. Where no step lowers the loss the increment is the identity.
/// Cost per iteration: a pass to move the pairs, one for the loss, and one to linearise.
#[derive(Clone, Debug)]
pub struct LevenbergMarquardt<M> {
    /// What is minimised.
    pub metric: M,
    /// Largest number of steps tried, rejected ones included; default 20. Zero moves nothing.
    pub max_iterations: usize,
    /// Ends when a step's length, with rotations as displacements at the RMS radius, is at most this share of that radius; default 10⁻⁶.
    pub tolerance: f64,
    /// λ of the first step tried, relative to the diagonal; default 10⁻³.
    pub initial_damping: f64,
    current: Correspondences,
    trial: Correspondences,
}

impl<M> LevenbergMarquardt<M> {
    /// Iterates a metric with the default limits.
    #[must_use]
    pub fn new(metric: M) -> Self {
        Self {
            metric,
            max_iterations: 20,
            tolerance: 1e-6,
            initial_damping: 1e-3,
            current: Correspondences::new(),
            trial: Correspondences::new(),
        }
    }
}

impl<M: Default> Default for LevenbergMarquardt<M> {
    fn default() -> Self {
        Self::new(M::default())
    }
}

impl<M: Minimize> Minimize for LevenbergMarquardt<M> {
    fn inner(&mut self, _: &Iteration<'_>) -> Option<&mut dyn Minimize> {
        Some(&mut self.metric)
    }

    fn minimize(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<Step> {
        let mean_loss = self.metric.mean_loss(iteration, pairs)?;
        let mut system = self.metric.system(iteration, pairs)?;
        let (mut increment, mut loss) = (Isometry3::identity(), mean_loss);
        let mut damping = self.initial_damping.clamp(MIN_DAMPING, MAX_DAMPING);
        for pass in 0..self.max_iterations {
            let Some(solution) = system.solution(damping) else {
                if pass == 0 {
                    return None;
                }
                break;
            };
            let next = compose(&solution.increment, &increment);
            let tried = if se3::is_finite(&next) {
                move_sources(pairs, &next, &mut self.trial);
                self.metric.mean_loss(iteration, &self.trial)
            } else {
                None
            };
            let done = solution.size <= self.tolerance;
            match tried {
                Some(lower) if lower < loss => {
                    mem::swap(&mut self.current, &mut self.trial);
                    (increment, loss) = (next, lower);
                    damping = (damping / FACTOR).max(MIN_DAMPING);
                    match self.metric.system(iteration, &self.current) {
                        Some(anew) if !done => system = anew,
                        _ => break,
                    }
                }
                _ if done || damping >= MAX_DAMPING => break,
                _ => damping *= FACTOR,
            }
        }
        Some(Step {
            increment,
            mean_loss,
        })
    }

    fn label(&self) -> &'static str {
        "levenberg-marquardt"
    }
}

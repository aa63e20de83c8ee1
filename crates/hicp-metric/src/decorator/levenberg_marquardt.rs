//! Levenberg–Marquardt iterations over fixed pairs.

use std::mem;

use hicp_core::internal::Scratch;
use hicp_core::{Correspondences, Isometry3, Iteration, se3};

use crate::decorator::moved::move_sources;
use crate::metric::error_metric::Step;
use crate::metric::minimize::Minimize;

/// Factor by which the damping grows with a rejected step and shrinks with an accepted one.
const FACTOR: f64 = 10.0;
/// Largest damping; beyond it, steps are negligible.
const MAX_DAMPING: f64 = 1e12;
const MIN_DAMPING: f64 = 1e-12;

/// Iterates over one set of pairs like [`GaussNewton`](crate::GaussNewton), with only steps that
/// lower the loss.
///
/// The normal equations are damped by λ diag(JᵀWJ) (Levenberg 1944; Marquardt 1963) in scaled
/// unknowns, so λ has no unit. Each diagonal entry counts as at least 10⁻⁶ of the mean. A step is
/// tried on a copy of the pairs. If the metric's [`Minimize::mean_loss`] is lower there, λ
/// decreases by a factor of 10. Otherwise the step is rejected and λ increases by a factor of 10.
/// The mean loss after the increment is therefore never above the reported one, which is that
/// before it.
///
/// If the first linearization gives no step, neither does this. If no step lowers the loss, the
/// increment is the identity. Cost per iteration: three passes, to move the pairs, to compute the
/// loss, and to linearize.
#[derive(Clone, Debug, PartialEq)]
pub struct LevenbergMarquardt<M> {
    /// The metric to minimize.
    pub metric: M,
    /// Largest number of steps, including rejected ones; default 20. Zero gives the identity.
    pub max_iterations: usize,
    /// Relative step length at which the iterations end; default 10⁻⁶.
    ///
    /// It is relative to the RMS radius. Rotations count as displacements at that radius.
    pub tolerance: f64,
    /// λ of the first step, relative to the diagonal; default 10⁻³.
    pub initial_damping: f64,
    current: Scratch<Correspondences>,
    trial: Scratch<Correspondences>,
}

impl<M> LevenbergMarquardt<M> {
    /// Creates the decorator with the default limits.
    #[must_use]
    pub fn new(metric: M) -> Self {
        Self {
            metric,
            max_iterations: 20,
            tolerance: 1e-6,
            initial_damping: 1e-3,
            current: Scratch::default(),
            trial: Scratch::default(),
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
            let next = se3::compose(&solution.increment, &increment);
            let tried = if se3::is_finite(&next) {
                move_sources(pairs, &next, &mut self.trial.0);
                self.metric.mean_loss(iteration, &self.trial.0)
            } else {
                None
            };
            let done = solution.size <= self.tolerance;
            match tried {
                Some(lower) if lower < loss => {
                    mem::swap(&mut self.current.0, &mut self.trial.0);
                    (increment, loss) = (next, lower);
                    damping = (damping / FACTOR).max(MIN_DAMPING);
                    match self.metric.system(iteration, &self.current.0) {
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

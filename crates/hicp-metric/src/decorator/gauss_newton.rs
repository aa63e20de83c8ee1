//! Gauss–Newton iterations over fixed pairs.

use hicp_core::internal::Scratch;
use hicp_core::{Correspondences, Isometry3, Iteration, se3};

use crate::decorator::moved::move_sources;
use crate::metric::error_metric::Step;
use crate::metric::minimize::Minimize;

/// Iterates Gauss–Newton over one set of pairs, linearizing again at the moved sources.
///
/// It pays if associating costs more than a few passes over the pairs, and rotations are large: one
/// linearized point-to-plane step leaves 4° of 15°. It always solves the metric's
/// [`Minimize::system`], whatever its `minimize` does. The increment is the product of the inner
/// ones. The mean loss is that *before* the increment. The loss may rise, see
/// [`LevenbergMarquardt`](crate::LevenbergMarquardt).
///
/// If the first linearization gives no step, neither does this. A later one without a step ends the
/// iterations.
#[derive(Clone, Debug, PartialEq)]
pub struct GaussNewton<M> {
    /// The metric to minimize.
    pub metric: M,
    /// Largest number of inner steps; default 10. Zero gives the identity.
    pub max_iterations: usize,
    /// Relative step length at which the iterations end; default 10⁻⁶.
    ///
    /// It is relative to the RMS radius. Rotations count as displacements at that radius.
    pub tolerance: f64,
    moved: Scratch<Correspondences>,
}

impl<M> GaussNewton<M> {
    /// Creates the decorator with the default limits.
    #[must_use]
    pub fn new(metric: M) -> Self {
        Self {
            metric,
            max_iterations: 10,
            tolerance: 1e-6,
            moved: Scratch::default(),
        }
    }
}

impl<M: Default> Default for GaussNewton<M> {
    fn default() -> Self {
        Self::new(M::default())
    }
}

impl<M: Minimize> Minimize for GaussNewton<M> {
    fn inner(&mut self, _: &Iteration<'_>) -> Option<&mut dyn Minimize> {
        Some(&mut self.metric)
    }

    fn minimize(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<Step> {
        let mean_loss = self.metric.mean_loss(iteration, pairs)?;
        let mut increment = Isometry3::identity();
        for pass in 0..self.max_iterations {
            let system = if pass == 0 {
                self.metric.system(iteration, pairs)
            } else {
                move_sources(pairs, &increment, &mut self.moved.0);
                self.metric.system(iteration, &self.moved.0)
            };
            let Some(solution) = system.and_then(|system| system.solution(0.0)) else {
                if pass == 0 {
                    return None;
                }
                break;
            };
            let next = se3::compose(&solution.increment, &increment);
            if !se3::is_finite(&next) {
                break;
            }
            increment = next;
            if solution.size <= self.tolerance {
                break;
            }
        }
        Some(Step {
            increment,
            mean_loss,
        })
    }

    fn label(&self) -> &'static str {
        "gauss-newton"
    }
}

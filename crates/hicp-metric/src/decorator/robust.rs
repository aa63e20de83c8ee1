//! Robust kernels over any metric.

use hicp_core::internal::{Scratch, median};
use hicp_core::{Correspondences, Iteration, Pair};

use crate::decorator::kernel::{Kernel, RobustKernel};
use crate::metric::error_metric::{NO_ROWS, Step, has_rows};
use crate::metric::minimize::Minimize;
use crate::system::normal_equations::NormalEquations;

/// σ of a Gaussian, divided by the median of its absolute values.
const SIGMA_PER_MAD: f64 = 1.4826;
/// Smallest scale, a picometer, so that residuals of zero keep the weight 1.
const MIN_SCALE: f64 = 1e-12;

/// The σ that residuals are divided by.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Scale {
    /// A known σ of the residuals, meters.
    Meters(f64),
    /// 1.4826 × the median of |r| over the pairs with weight and rows, with a floor.
    ///
    /// It is computed in each step, and right for residuals of one dimension. Distances of points
    /// in space (`PointToPoint`) have a median 2.3 times as large for the same σ per axis. More
    /// than half of the pairs must be right.
    Mad {
        /// Smallest σ, meters: the resolution of the sensor.
        ///
        /// Without it, a perfect fit would reject all residuals that are not exactly zero.
        floor_meters: f64,
    },
}

/// The median absolute residual, at least 1 mm.
impl Default for Scale {
    fn default() -> Self {
        Self::Mad { floor_meters: 1e-3 }
    }
}

/// Applies a robust kernel to a metric: E = 2σ² ρ(r/σ), where r² is the error of the inner metric.
///
/// It uses iteratively reweighted least squares. A step multiplies the weight of each pair by
/// w(r/σ) in a copy, which the inner metric minimizes, in closed form or not.
///
/// The mean loss is the mean of E over the *original* weights. Stop rules on it keep their meaning:
/// at a given σ, E falls with every exact step, and it rises if pairs drift into the tail of the
/// kernel. The mean of w r² would fall there, because the weights vanish. If σ is estimated, E also
/// changes with σ. For [`Kernel::L2`] and for small residuals, it equals the inner loss. Pairs
/// without rows have no part in the scale and the mean, and no weight in the copy.
///
/// The scale depends on all pairs, so the kernel is not part of the error of a single pair:
/// [`Minimize::add_squared_errors`] adds the errors of the inner metric. [`Minimize::system`] is
/// that of the reweighted pairs. Any [`RobustKernel`] can be used. Cost: one pass for the
/// residuals, one to copy the pairs, a selection for the median, and the inner metric.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Robust<M, K = Kernel> {
    /// The metric to minimize.
    pub metric: M,
    /// The influence of a residual; default [`Kernel::HUBER`].
    pub kernel: K,
    /// The scale of residuals; by default the median with a floor of 1 mm.
    pub scale: Scale,
    reweighted: Scratch<Correspondences>,
    residuals: Scratch<Vec<f64>>,
    sorted: Scratch<Vec<f64>>,
}

impl<M: Minimize, K: RobustKernel> Robust<M, K> {
    /// Applies a kernel to a metric.
    #[must_use]
    pub fn new(metric: M, kernel: K, scale: Scale) -> Self {
        Self {
            metric,
            kernel,
            scale,
            reweighted: Scratch::default(),
            residuals: Scratch::default(),
            sorted: Scratch::default(),
        }
    }

    /// Computes the residuals and returns σ, or `None` if it is not finite.
    fn measure(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<f64> {
        self.residuals.0.clear();
        self.residuals.0.resize(pairs.len(), NO_ROWS);
        self.metric
            .add_squared_errors(iteration, pairs, 1.0, &mut self.residuals.0);
        for residual in &mut self.residuals.0 {
            // Keeps the sign of `NO_ROWS`.
            *residual = residual.sqrt();
        }
        let pairs = pairs.as_slice();
        let sigma = match self.scale {
            Scale::Meters(sigma) => sigma,
            Scale::Mad { floor_meters } => {
                self.sorted.0.clear();
                let counting = pairs.iter().zip(&self.residuals.0);
                self.sorted.0.extend(
                    counting
                        .filter(|(pair, residual)| pair.weight > 0.0 && has_rows(**residual))
                        .map(|(_, residual)| *residual),
                );
                let sigma = SIGMA_PER_MAD * median(&mut self.sorted.0, f64::total_cmp)?;
                if !sigma.is_finite() {
                    return None;
                }
                sigma.max(floor_meters)
            }
        };
        let sigma = sigma.max(MIN_SCALE);
        sigma.is_finite().then_some(sigma)
    }

    /// Fills the copy with the kernel's weights and returns the robust mean loss.
    fn reweigh(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<f64> {
        let sigma = self.measure(iteration, pairs)?;
        let kernel = &self.kernel;
        self.reweighted
            .0
            .begin(pairs.camera_from_object(), pairs.n_candidates());
        let weighted = pairs.as_slice().iter().zip(&self.residuals.0);
        self.reweighted.0.extend(weighted.map(|(pair, residual)| {
            let share = if has_rows(*residual) {
                kernel.weight(residual / sigma)
            } else {
                0.0
            };
            #[allow(clippy::cast_possible_truncation)] // The weight of a pair is an f32.
            let weight = (f64::from(pair.weight) * share) as f32;
            Pair { weight, ..*pair }
        }));
        self.loss(pairs, sigma)
    }

    /// Returns Σ w 2σ² ρ(r/σ) / Σ w over the last residuals.
    fn loss(&self, pairs: &Correspondences, sigma: f64) -> Option<f64> {
        let (mut sum, mut weight) = (0.0, 0.0);
        for (pair, residual) in pairs.as_slice().iter().zip(&self.residuals.0) {
            if has_rows(*residual) {
                let w = f64::from(pair.weight);
                sum += w * self.kernel.loss(residual / sigma);
                weight += w;
            }
        }
        let mean = 2.0 * sigma * sigma * sum / weight;
        (weight > 0.0 && mean.is_finite()).then_some(mean)
    }
}

impl<M: Minimize, K: RobustKernel> Minimize for Robust<M, K> {
    fn inner(&mut self, _: &Iteration<'_>) -> Option<&mut dyn Minimize> {
        Some(&mut self.metric)
    }

    fn mean_loss(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<f64> {
        let sigma = self.measure(iteration, pairs)?;
        self.loss(pairs, sigma)
    }

    fn system(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
    ) -> Option<NormalEquations> {
        self.reweigh(iteration, pairs)?;
        self.metric.system(iteration, &self.reweighted.0)
    }

    fn system_and_loss(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
    ) -> Option<(NormalEquations, f64)> {
        let mean_loss = self.reweigh(iteration, pairs)?;
        let system = self.metric.system(iteration, &self.reweighted.0)?;
        Some((system, mean_loss))
    }

    fn minimize(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<Step> {
        let mean_loss = self.reweigh(iteration, pairs)?;
        let step = self.metric.minimize(iteration, &self.reweighted.0)?;
        Some(Step { mean_loss, ..step })
    }

    fn label(&self) -> &'static str {
        "robust"
    }
}

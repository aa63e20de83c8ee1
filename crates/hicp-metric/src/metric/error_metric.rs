//! The trait of error metrics.

use hicp_core::{Correspondences, Isometry3, Pair, VectorLoop, type_label, vectorized};

use crate::system::moments::Moments;
use crate::system::normal_equations::NormalEquations;

/// What one minimisation found: the loss where it stands, and the way from there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// The increment T_k of Algorithm 1: the next estimate is `increment * camera_from_object`. Camera frame.
    pub increment: Isometry3<f64>,
    /// Weighted mean of the metric's squared residuals *before* the increment, at the pose that the pairs were made at; m².
    pub mean_loss: f64,
}

/// An error metric E(c, n, o, m, T) and its minimiser: Algorithm 1, line 3.
///
/// Pairs are in the camera frame with the source already moved, so a metric is linearised at the identity increment
/// ξ = [ρ; φ] (translation first, left perturbation).
///
/// Implement [`ErrorMetric::linearize`] and get the rest: Gauss–Newton from the provided [`ErrorMetric::minimize`]; override
/// `minimize` where there is a closed form or a batch kernel. What acts on the set of pairs rather than on one of them (a
/// kernel with a scale, a prior, a frozen direction) overrides [`ErrorMetric::system`], and [`ErrorMetric::mean_loss`] if it
/// changes the loss; decorators therefore ask the metric inside for its `system`, not for its rows.
///
/// ```
/// use hicp_core::{Pair, Vector3};
/// use hicp_metric::{ErrorMetric, NormalEquations};
///
/// /// The difference of depths alone: z of the optical axis.
/// #[derive(Debug)]
/// struct DepthDifference;
///
/// impl ErrorMetric for DepthDifference {
///     fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
///         let (p, c) = (pair.source.point.cast::<f64>(), pair.target.point.cast::<f64>());
///         // The residual moves by z · (displacement of p): one row at p along z.
///         system.add_row(&p, &Vector3::z(), p.z - c.z, f64::from(pair.weight));
///     }
/// }
/// ```
pub trait ErrorMetric {
    /// Adds the residual rows of one pair, linearised at the identity increment.
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations);

    /// Returns E(c, n, o, m, I) of one pair at the pose that it was made at, without its weight; m².
    ///
    /// The provided method sums the squares of the pair's own rows. Override it where that is a short formula: kernels and
    /// [`ErrorMetric::mean_loss`] ask once per pair.
    fn squared_error(&self, pair: &Pair) -> f64 {
        let mut system = NormalEquations::new(pair.source.point.cast(), 1.0);
        let unweighted = Pair {
            weight: 1.0,
            ..*pair
        };
        self.linearize(&unweighted, &mut system);
        system.loss()
    }

    /// Returns the weighted mean of the errors at the pose that the pairs were made at, as [`ErrorMetric::minimize`] reports
    /// it; m². Pure: `&mut self` is scratch.
    ///
    /// `None` without weight or with numbers that are not finite.
    fn mean_loss(&mut self, pairs: &Correspondences) -> Option<f64> {
        let (mut sum, mut weight) = (0.0, 0.0);
        for pair in pairs.as_slice() {
            let w = f64::from(pair.weight);
            sum += w * self.squared_error(pair);
            weight += w;
        }
        let mean = sum / weight;
        (weight > 0.0 && mean.is_finite()).then_some(mean)
    }

    /// Returns all pairs linearised: what one Gauss–Newton step solves, and what information, covariance and observability at
    /// that pose are read from. Pure: `&mut self` is scratch.
    ///
    /// `None` without weight or with points that are not finite. The provided method sums the rows of
    /// [`ErrorMetric::linearize`] about the centroid, with lengths scaled by the RMS radius.
    fn system(&mut self, pairs: &Correspondences) -> Option<NormalEquations> {
        let system = vectorized(Linearize {
            metric: self,
            pairs: pairs.as_slice(),
        })?;
        // Sources were checked with the centroid; this catches targets and normals.
        system.loss().is_finite().then_some(system)
    }

    /// Takes one step of minimisation over all pairs. Pure: `&mut self` is scratch.
    ///
    /// A metric that depends on the pose (a prior, a frozen direction of the object frame) finds it in
    /// [`Correspondences::camera_from_object`].
    ///
    /// `None` when the pairs do not determine a step: none at all, only zero weights, fewer rows than unknowns, or numbers
    /// that are not finite. The provided method is one Gauss–Newton step: it solves [`ErrorMetric::system`].
    fn minimize(&mut self, pairs: &Correspondences) -> Option<Step> {
        let system = self.system(pairs)?;
        let sum = || pairs.as_slice().iter().map(|p| f64::from(p.weight)).sum();
        let weight: f64 = system.weight().unwrap_or_else(sum);
        let mean_loss = system.loss() / weight;
        let increment = system.solve()?;
        mean_loss.is_finite().then_some(Step {
            increment,
            mean_loss,
        })
    }

    /// Says which iteration of a stage, from 0, the next pairs belong to, and the pose that the stage began at: for metrics
    /// that change from one to the next ([`crate::MetricSchedule`]) or are tied to the start ([`crate::PosePrior`]).
    ///
    /// Pure all the same: equal calls of `begin` and equal pairs give equal results. Decorators pass it on.
    fn begin(&mut self, iteration: usize, init: &Isometry3<f64>) {
        let _ = (iteration, init);
    }

    /// Name in traces.
    fn name(&self) -> &'static str {
        type_label::<Self>()
    }
}

/// Sums the rows of all pairs.
struct Linearize<'a, M: ?Sized> {
    metric: &'a M,
    pairs: &'a [Pair],
}

impl<M: ErrorMetric + ?Sized> VectorLoop for Linearize<'_, M> {
    type Output = Option<NormalEquations>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        // One pass: about any point near by at first, and where the centroid and the radius turned out to be after.
        let mut moments = Moments::about_first(self.pairs)?;
        let mut system = NormalEquations::new(moments.origin(), 1.0);
        for pair in self.pairs {
            moments.add(pair);
            self.metric.linearize(pair, &mut system);
        }
        let (pivot, length) = moments.pivot_and_length()?;
        Some(system.moved_to(pivot, length, moments.weight()))
    }
}

impl<T: ErrorMetric + ?Sized> ErrorMetric for Box<T> {
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        (**self).linearize(pair, system);
    }

    fn squared_error(&self, pair: &Pair) -> f64 {
        (**self).squared_error(pair)
    }

    fn mean_loss(&mut self, pairs: &Correspondences) -> Option<f64> {
        (**self).mean_loss(pairs)
    }

    fn system(&mut self, pairs: &Correspondences) -> Option<NormalEquations> {
        (**self).system(pairs)
    }

    fn minimize(&mut self, pairs: &Correspondences) -> Option<Step> {
        (**self).minimize(pairs)
    }

    fn begin(&mut self, iteration: usize, init: &Isometry3<f64>) {
        (**self).begin(iteration, init);
    }

    fn name(&self) -> &'static str {
        (**self).name()
    }
}

//! The trait of error metrics.

use hicp_core::internal::{VectorLoop, type_label, vectorized};
use hicp_core::{Correspondences, Isometry3, Pair};

use crate::system::moments::Moments;
use crate::system::normal_equations::NormalEquations;

/// The result of one minimization: the loss at the current pose, and the increment from there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// The increment T_k of Algorithm 1, in the camera frame.
    ///
    /// The next estimate is `increment * camera_from_object`.
    pub increment: Isometry3<f64>,
    /// Weighted mean of the squared residuals at the pose of the pairs, *before* the increment; m².
    pub mean_loss: f64,
}

/// An error metric E(c, n, o, m, T) of one pair (Algorithm 1, line 3).
///
/// Pairs are in the camera frame and their sources are already moved. A metric is therefore
/// linearized at the identity increment ξ = [ρ; φ] (translation first, left perturbation).
///
/// Implement [`ErrorMetric::linearize`]; the rest is provided. Override other methods if that is
/// useful:
///
/// - [`ErrorMetric::squared_error`], if it is a short formula.
/// - [`ErrorMetric::linearize_all`], if there is a faster loop over many pairs.
/// - [`ErrorMetric::step`], if the minimum has a closed form.
///
/// A metric may skip pairs by adding no rows for them. The provided mean losses count such a pair
/// with an error of zero. To leave it out, override [`ErrorMetric::step`] *and*
/// [`ErrorMetric::mean_squared_error`], because both must have the same mean.
///
/// Every error metric is a [`Minimize`](crate::Minimize), which is what a stage requires. A
/// component that acts on the whole set of pairs (a robust kernel, a prior, a frozen axis)
/// implements `Minimize` instead.
///
/// ```
/// use hicp_core::{Pair, Vector3};
/// use hicp_metric::{ErrorMetric, NormalEquations};
///
/// /// The difference of depths, z along the optical axis.
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
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not an error metric",
    label = "this must implement `ErrorMetric` (or `Minimize`)",
    note = "`Icp::metric` accepts an `ErrorMetric`, a decorator such as `Robust<M>` around one, or a `Box<dyn Minimize>`"
)]
pub trait ErrorMetric {
    /// Adds the residual rows of one pair, linearized at the identity increment.
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations);

    /// Returns E(c, n, o, m, I) of one pair at the pose of the pairs, without its weight; m².
    ///
    /// The provided method sums the squares of the pair's rows. Robust kernels and mean losses call
    /// it once per pair.
    fn squared_error(&self, pair: &Pair) -> f64 {
        let mut system = NormalEquations::of_loss(pair.source.point.cast());
        let unweighted = Pair {
            weight: 1.0,
            ..*pair
        };
        self.linearize(&unweighted, &mut system);
        system.loss()
    }

    /// Returns the weighted mean of the errors at the pose of the pairs, as [`ErrorMetric::step`]
    /// does; m².
    ///
    /// Returns `None` without weight or with numbers that are not finite.
    fn mean_squared_error(&self, pairs: &Correspondences) -> Option<f64> {
        let (mut sum, mut weight) = (0.0, 0.0);
        for pair in pairs.as_slice() {
            let w = f64::from(pair.weight);
            sum += w * self.squared_error(pair);
            weight += w;
        }
        let mean = sum / weight;
        (weight > 0.0 && mean.is_finite()).then_some(mean)
    }

    /// Returns all pairs linearized, or `None` without weight or with points that are not finite.
    ///
    /// The provided method sums the rows of [`ErrorMetric::linearize`] around the centroid, with
    /// lengths scaled by the RMS radius.
    fn linearize_all(&self, pairs: &Correspondences) -> Option<NormalEquations> {
        vectorized(Linearize {
            metric: self,
            pairs: pairs.as_slice(),
        })
    }

    /// Computes one step of minimization over all pairs.
    ///
    /// Returns `None` if the pairs do not determine a step: no pairs, only zero weights, fewer rows
    /// than unknowns, or numbers that are not finite. The provided method is one Gauss–Newton step.
    fn step(&self, pairs: &Correspondences) -> Option<Step> {
        let system = self.linearize_all(pairs)?;
        let sum = || pairs.as_slice().iter().map(|p| f64::from(p.weight)).sum();
        let weight: f64 = system.weight.unwrap_or_else(sum);
        let mean_loss = system.loss() / weight;
        let increment = system.solve()?;
        mean_loss.is_finite().then_some(Step {
            increment,
            mean_loss,
        })
    }

    /// Returns the name in traces.
    fn name(&self) -> &'static str {
        type_label::<Self>()
    }
}

/// The loop that sums the rows of all pairs.
struct Linearize<'a, M: ?Sized> {
    metric: &'a M,
    pairs: &'a [Pair],
}

impl<M: ErrorMetric + ?Sized> VectorLoop for Linearize<'_, M> {
    type Output = Option<NormalEquations>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        // One pass: the sums are relative to a nearby point first, and then moved to the centroid
        // and scaled by the radius.
        let mut moments = Moments::about_first(self.pairs)?;
        let mut system = NormalEquations::new(moments.origin, 1.0);
        for pair in self.pairs {
            moments.add(pair);
            self.metric.linearize(pair, &mut system);
        }
        system.centered(&moments)
    }
}

macro_rules! forward {
    ($($pointer:ty),+) => {$(
        impl<T: ErrorMetric + ?Sized> ErrorMetric for $pointer {
            fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
                (**self).linearize(pair, system);
            }

            fn squared_error(&self, pair: &Pair) -> f64 {
                (**self).squared_error(pair)
            }

            fn mean_squared_error(&self, pairs: &Correspondences) -> Option<f64> {
                (**self).mean_squared_error(pairs)
            }

            fn linearize_all(&self, pairs: &Correspondences) -> Option<NormalEquations> {
                (**self).linearize_all(pairs)
            }

            fn step(&self, pairs: &Correspondences) -> Option<Step> {
                (**self).step(pairs)
            }

            fn name(&self) -> &'static str {
                (**self).name()
            }
        }
    )+};
}
forward!(Box<T>, &T, &mut T);

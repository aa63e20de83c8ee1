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

/// The squared error of a pair without rows: the empty sum, −0.0.
///
/// Adding it to any number does not change that number. A sum of squares that starts with it keeps
/// it if and only if no row is added.
pub const NO_ROWS: f64 = -0.0;

/// Returns whether a squared error, or a sum that started with [`NO_ROWS`], is that of rows.
pub(crate) fn has_rows(squared_error: f64) -> bool {
    squared_error.to_bits() != NO_ROWS.to_bits()
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
/// A metric may skip pairs by adding no rows for them. Means and robust kernels leave such a pair
/// out. A custom [`ErrorMetric::squared_error`] reports it by [`NO_ROWS`]. A custom
/// [`ErrorMetric::step`] must report the same mean as [`ErrorMetric::mean_squared_error`].
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
    /// Returns [`NO_ROWS`] for a pair without rows. The provided method sums the squares of the
    /// pair's rows. Robust kernels and mean losses call it once per pair.
    fn squared_error(&self, pair: &Pair) -> f64 {
        let mut system = NormalEquations::of_loss(pair.source.point.cast());
        let unweighted = Pair {
            weight: 1.0,
            ..*pair
        };
        self.linearize(&unweighted, &mut system);
        if system.rows > 0 {
            system.loss()
        } else {
            NO_ROWS
        }
    }

    /// Returns the weighted mean of the errors at the pose of the pairs, as [`ErrorMetric::step`]
    /// does; m².
    ///
    /// Returns `None` without weight or with numbers that are not finite.
    fn mean_squared_error(&self, pairs: &Correspondences) -> Option<f64> {
        let (mut sum, mut weight) = (0.0, 0.0);
        for pair in pairs.as_slice() {
            let error = self.squared_error(pair);
            if has_rows(error) {
                let w = f64::from(pair.weight);
                sum += w * error;
                weight += w;
            }
        }
        let mean = sum / weight;
        (weight > 0.0 && mean.is_finite()).then_some(mean)
    }

    /// Returns the normal equations of all pairs, linearized at the identity increment.
    ///
    /// Returns `None` if all weights are zero or a point is not finite. The provided method sums
    /// the rows of [`ErrorMetric::linearize`]. Rotations are around the centroid of the sources,
    /// and lengths are scaled by their RMS radius.
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
        let mean_loss = system.mean_loss_or(|| self.mean_squared_error(pairs))?;
        Some(Step {
            increment: system.solve()?,
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
        let mut skipped = 0.0;
        for pair in self.pairs {
            moments.add(pair);
            let before = system.rows;
            self.metric.linearize(pair, &mut system);
            if system.rows == before {
                skipped += f64::from(pair.weight);
            }
        }
        let mut system = system.centered(&moments)?;
        system.weight = Some(moments.weight() - skipped);
        Some(system)
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

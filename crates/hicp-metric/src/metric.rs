//! The trait of error metrics.

use hicp_core::{Correspondences, Isometry3, Pair, type_label};

use crate::normal_equations::NormalEquations;

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
/// Implement [`ErrorMetric::linearize`] and get Gauss–Newton from the provided [`ErrorMetric::minimize`]; override
/// `minimize` where there is a closed form or a batch kernel.
///
/// ```
/// use hicp_core::Pair;
/// use hicp_metric::{ErrorMetric, NormalEquations};
///
/// /// Point-to-plane in the model's tangent planes instead of the observation's.
/// #[derive(Debug)]
/// struct PlaneToPoint;
///
/// impl ErrorMetric for PlaneToPoint {
///     fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
///         let normal = pair.source.normal.cast::<f64>().into_inner();
///         let (p, c) = (pair.source.point.cast::<f64>(), pair.target.point.cast::<f64>());
///         // The residual moves by n · (displacement of p): one row at p along n.
///         system.add_row(&p, &normal, normal.dot(&(p - c)), f64::from(pair.weight));
///     }
/// }
/// ```
pub trait ErrorMetric {
    /// Adds the residual rows of one pair, linearised at the identity increment.
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations);

    /// Takes one step of minimisation over all pairs. Pure: `&mut self` is scratch.
    ///
    /// A metric that depends on the pose (a prior, a frozen direction of the object frame) finds it in
    /// [`Correspondences::camera_from_object`].
    ///
    /// `None` when the pairs do not determine a step: none at all, only zero weights, fewer rows than unknowns, or numbers
    /// that are not finite. The provided method is one Gauss–Newton step about the centroid with lengths scaled by the RMS radius.
    fn minimize(&mut self, pairs: &Correspondences) -> Option<Step> {
        let mut system = NormalEquations::about_sources(pairs.as_slice())?;
        for pair in pairs.as_slice() {
            self.linearize(pair, &mut system);
        }
        let weight: f64 = pairs.as_slice().iter().map(|p| f64::from(p.weight)).sum();
        let mean_loss = system.loss() / weight;
        let increment = system.solve()?;
        mean_loss.is_finite().then_some(Step {
            increment,
            mean_loss,
        })
    }

    /// Name in traces.
    fn name(&self) -> &'static str {
        type_label::<Self>()
    }
}

impl<T: ErrorMetric + ?Sized> ErrorMetric for Box<T> {
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        (**self).linearize(pair, system);
    }

    fn minimize(&mut self, pairs: &Correspondences) -> Option<Step> {
        (**self).minimize(pairs)
    }

    fn name(&self) -> &'static str {
        (**self).name()
    }
}

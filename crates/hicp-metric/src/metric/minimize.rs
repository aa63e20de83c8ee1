//! The trait of metrics and decorators that a stage can minimize over a set of pairs.

use hicp_core::internal::type_label;
use hicp_core::{Correspondences, Iteration};

use crate::metric::error_metric::{ErrorMetric, Step};
use crate::system::normal_equations::NormalEquations;

/// Minimizes over the pairs of one iteration: every [`ErrorMetric`], and the decorators around one.
///
/// A decorator (a kernel with a scale, a prior, a frozen direction) acts on the set of pairs and
/// not on one of them. It returns the wrapped metric in [`Minimize::inner`] and overrides the
/// methods that it changes. The others forward, except for [`Minimize::system_and_loss`] and
/// [`Minimize::minimize`], which use the decorator's own system and mean loss.
///
/// A decorator that does not change the system, for example because it counts or logs, must
/// override `minimize`, too, and call that of the wrapped metric. Otherwise one Gauss–Newton step
/// replaces its closed form or solver ([`PointToPoint`](crate::PointToPoint),
/// [`LevenbergMarquardt`](crate::LevenbergMarquardt)). `hicp_testkit::check_metric_forwards`
/// detects this.
///
/// It is pure: equal iterations and pairs give equal results, and `&mut self` is scratch. A metric
/// that depends on the pose reads it from [`Correspondences::camera_from_object`]. The index of the
/// iteration and the initial pose of the stage are in [`Iteration`].
///
/// If the error of one pair depends on them, create an [`ErrorMetric`] for the pairs at hand:
///
/// ```
/// use hicp_core::{Correspondences, Iteration, Matrix3, Pair, Vector3};
/// use hicp_metric::{ErrorMetric, Minimize, NormalEquations};
///
/// /// The distance from target to source, in standard deviations of each point of the source.
/// ///
/// /// It holds roots of their information in the frame of the source: Σ⁻¹ = WᵀW.
/// struct Whitened(Vec<Matrix3<f64>>);
///
/// /// The same at a pose.
/// struct WhitenedAt<'a> {
///     roots: &'a [Matrix3<f64>],
///     source_from_target: Matrix3<f64>,
/// }
///
/// impl ErrorMetric for WhitenedAt<'_> {
///     fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
///         let (p, c) = (pair.source.point.cast::<f64>(), pair.target.point.cast::<f64>());
///         let root = self.roots[pair.source_index as usize] * self.source_from_target;
///         for row in root.row_iter() {
///             let direction: Vector3<f64> = row.transpose();
///             system.add_row(&p, &direction, direction.dot(&(p - c)), f64::from(pair.weight));
///         }
///     }
/// }
///
/// impl Whitened {
///     fn at(&self, pairs: &Correspondences) -> WhitenedAt<'_> {
///         let rotation = pairs.camera_from_object().rotation.inverse();
///         let source_from_target = *rotation.to_rotation_matrix().matrix();
///         WhitenedAt { roots: &self.0, source_from_target }
///     }
/// }
///
/// impl Minimize for Whitened {
///     fn inner(&mut self, _: &Iteration<'_>) -> Option<&mut dyn Minimize> {
///         None
///     }
///     fn system(
///         &mut self,
///         _: &Iteration<'_>,
///         pairs: &Correspondences,
///     ) -> Option<NormalEquations> {
///         self.at(pairs).linearize_all(pairs)
///     }
///     fn mean_loss(&mut self, _: &Iteration<'_>, pairs: &Correspondences) -> Option<f64> {
///         self.at(pairs).mean_squared_error(pairs)
///     }
///     fn add_squared_errors(
///         &mut self,
///         iteration: &Iteration<'_>,
///         pairs: &Correspondences,
///         factor: f64,
///         errors: &mut [f64],
///     ) {
///         self.at(pairs).add_squared_errors(iteration, pairs, factor, errors);
///     }
/// }
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not an error metric",
    label = "this must implement `ErrorMetric` (or `Minimize`)",
    note = "`Icp::metric` accepts an `ErrorMetric`, a decorator such as `Robust<M>` around one, or a `Box<dyn Minimize>`"
)]
pub trait Minimize {
    /// Returns the wrapped metric for an iteration, to which the provided methods forward.
    ///
    /// Returns `None` if there is none.
    fn inner(&mut self, iteration: &Iteration<'_>) -> Option<&mut dyn Minimize>;

    /// Returns the normal equations of all pairs at the pose, for one Gauss–Newton step.
    ///
    /// They also give the information, covariance and observability of the pose. Returns `None` if
    /// all weights are zero or a point is not finite.
    fn system(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
    ) -> Option<NormalEquations> {
        self.inner(iteration)?.system(iteration, pairs)
    }

    /// Returns the weighted mean of the errors at the pose of the pairs; m².
    ///
    /// Returns `None` without weight or with numbers that are not finite.
    fn mean_loss(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<f64> {
        self.inner(iteration)?.mean_loss(iteration, pairs)
    }

    /// Adds `factor` times the squared error of each pair, without its weight, to `errors`; m².
    ///
    /// The factor is above zero. Pairs without rows keep their entry, also the initial value
    /// [`NO_ROWS`](crate::NO_ROWS).
    fn add_squared_errors(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
        factor: f64,
        errors: &mut [f64],
    ) {
        if let Some(inner) = self.inner(iteration) {
            inner.add_squared_errors(iteration, pairs, factor, errors);
        }
    }

    /// Returns [`Minimize::system`] and [`Minimize::mean_loss`].
    ///
    /// The provided method calls both. Override it if one pass over the pairs yields both.
    fn system_and_loss(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
    ) -> Option<(NormalEquations, f64)> {
        let system = self.system(iteration, pairs)?;
        Some((system, self.mean_loss(iteration, pairs)?))
    }

    /// Computes one step of minimization over all pairs.
    ///
    /// Returns `None` if the pairs do not determine a step: no pairs, only zero weights, fewer rows
    /// than unknowns, or numbers that are not finite. The provided method is one Gauss–Newton step:
    /// it solves the system of [`Minimize::system_and_loss`]. It does not call [`Minimize::inner`].
    fn minimize(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<Step> {
        let (system, mean_loss) = self.system_and_loss(iteration, pairs)?;
        Some(Step {
            increment: system.solve()?,
            mean_loss,
        })
    }

    /// Returns the name in traces. It is not called `name`, to keep a metric's own `name`
    /// unambiguous.
    fn label(&self) -> &'static str {
        type_label::<Self>()
    }
}

impl<M: ErrorMetric + ?Sized> Minimize for M {
    fn inner(&mut self, _: &Iteration<'_>) -> Option<&mut dyn Minimize> {
        None
    }

    fn system(&mut self, _: &Iteration<'_>, pairs: &Correspondences) -> Option<NormalEquations> {
        self.linearize_all(pairs)
    }

    fn mean_loss(&mut self, _: &Iteration<'_>, pairs: &Correspondences) -> Option<f64> {
        self.mean_squared_error(pairs)
    }

    fn add_squared_errors(
        &mut self,
        _: &Iteration<'_>,
        pairs: &Correspondences,
        factor: f64,
        errors: &mut [f64],
    ) {
        for (error, pair) in errors.iter_mut().zip(pairs.as_slice()) {
            *error += factor * self.squared_error(pair);
        }
    }

    fn system_and_loss(
        &mut self,
        _: &Iteration<'_>,
        pairs: &Correspondences,
    ) -> Option<(NormalEquations, f64)> {
        let system = self.linearize_all(pairs)?;
        let mean_loss = system.mean_loss_or(|| self.mean_squared_error(pairs))?;
        Some((system, mean_loss))
    }

    fn minimize(&mut self, _: &Iteration<'_>, pairs: &Correspondences) -> Option<Step> {
        self.step(pairs)
    }

    fn label(&self) -> &'static str {
        self.name()
    }
}

// Not for every `Box<T>`, since a boxed error metric implements it already.
macro_rules! forward {
    ($($pointer:ty),+) => {$(
        impl Minimize for $pointer {
            fn inner(&mut self, iteration: &Iteration<'_>) -> Option<&mut dyn Minimize> {
                (**self).inner(iteration)
            }

            fn system(
                &mut self,
                iteration: &Iteration<'_>,
                pairs: &Correspondences,
            ) -> Option<NormalEquations> {
                (**self).system(iteration, pairs)
            }

            fn mean_loss(
                &mut self,
                iteration: &Iteration<'_>,
                pairs: &Correspondences,
            ) -> Option<f64> {
                (**self).mean_loss(iteration, pairs)
            }

            fn add_squared_errors(
                &mut self,
                iteration: &Iteration<'_>,
                pairs: &Correspondences,
                factor: f64,
                errors: &mut [f64],
            ) {
                (**self).add_squared_errors(iteration, pairs, factor, errors);
            }

            fn system_and_loss(
                &mut self,
                iteration: &Iteration<'_>,
                pairs: &Correspondences,
            ) -> Option<(NormalEquations, f64)> {
                (**self).system_and_loss(iteration, pairs)
            }

            fn minimize(
                &mut self,
                iteration: &Iteration<'_>,
                pairs: &Correspondences,
            ) -> Option<Step> {
                (**self).minimize(iteration, pairs)
            }

            fn label(&self) -> &'static str {
                (**self).label()
            }
        }
    )+};
}
forward!(
    Box<dyn Minimize + '_>,
    Box<dyn Minimize + Send + '_>,
    Box<dyn Minimize + Send + Sync + '_>,
    &mut (dyn Minimize + '_),
    &mut (dyn Minimize + Send + '_)
);

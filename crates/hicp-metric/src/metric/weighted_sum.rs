//! Several metrics in one normal system.

use hicp_core::internal::for_tuples;
use hicp_core::{Correspondences, Iteration};

use crate::metric::minimize::Minimize;
use crate::system::normal_equations::NormalEquations;

/// E = Σₖ αₖ Eₖ: several metrics over the same pairs, minimized together by Gauss–Newton.
///
/// Point-to-plane with a little point-to-point (α ≈ 0.1) does not slide along planes. GenZ-ICP
/// (Lee, Lim & Han 2024) is the sum of both with α and 1 − α. Terms are `(factor, metric)`: a tuple
/// of up to eight, or a `Vec` of any number of one type (such as boxed ones). Factors are not
/// negative, and terms of factor 0 are skipped.
///
/// Terms contribute their [`Minimize::system`], so kernels and priors inside keep their effect.
/// Closed forms, solvers, frozen components and policies belong outside: use `Frozen` around the
/// sum. The system is solved with the policy and the frozen components of the first term.
///
/// ```
/// use hicp_metric::{PointToPlane, PointToPoint, Robust, WeightedSum};
///
/// let metric = WeightedSum {
///     terms: ((1.0, Robust::<PointToPlane>::default()), (0.1, PointToPoint)),
/// };
/// # let _ = metric;
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WeightedSum<T> {
    /// The terms, each `(factor, metric)`.
    pub terms: T,
}

/// The terms of a [`WeightedSum`]: one to eight pairs `(factor, metric)` as a tuple, or a `Vec` of
/// any number.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a list of terms",
    note = "`WeightedSum::terms` accepts a tuple of one to eight `(f64, M)` or a `Vec<(f64, M)>`, each `M` an error metric"
)]
pub trait Terms {
    /// Calls `visit` with every term of positive factor, in order, until it returns `None`.
    fn visit(&mut self, visit: &mut dyn FnMut(f64, &mut dyn Minimize) -> Option<()>) -> Option<()>;
}

impl<M: Minimize> Terms for (f64, M) {
    fn visit(&mut self, visit: &mut dyn FnMut(f64, &mut dyn Minimize) -> Option<()>) -> Option<()> {
        if self.0 > 0.0 {
            visit(self.0, &mut self.1)?;
        }
        Some(())
    }
}

impl<M: Minimize> Terms for Vec<(f64, M)> {
    fn visit(&mut self, visit: &mut dyn FnMut(f64, &mut dyn Minimize) -> Option<()>) -> Option<()> {
        self.iter_mut().try_for_each(|term| term.visit(visit))
    }
}

macro_rules! terms {
    ($($member:ident),+) => {
        impl<$($member: Minimize),+> Terms for ($((f64, $member),)+) {
            #[allow(non_snake_case)]
            fn visit(
                &mut self,
                visit: &mut dyn FnMut(f64, &mut dyn Minimize) -> Option<()>,
            ) -> Option<()> {
                let ($($member,)+) = self;
                $($member.visit(visit)?;)+
                Some(())
            }
        }
    };
}
for_tuples!(terms);

impl<T: Terms> Minimize for WeightedSum<T> {
    fn inner(&mut self, _: &Iteration<'_>) -> Option<&mut dyn Minimize> {
        None
    }

    fn system(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
    ) -> Option<NormalEquations> {
        let mut total: Option<NormalEquations> = None;
        self.terms.visit(&mut |factor, metric| {
            let term = metric.system(iteration, pairs)?;
            match &mut total {
                Some(total) => total.merge(&term, factor),
                None => total = Some(term.scaled(factor)),
            }
            Some(())
        })?;
        total
    }

    fn mean_loss(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<f64> {
        let mut sum = 0.0;
        self.terms.visit(&mut |factor, metric| {
            sum += factor * metric.mean_loss(iteration, pairs)?;
            Some(())
        })?;
        Some(sum)
    }

    fn add_squared_errors(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
        factor: f64,
        errors: &mut [f64],
    ) {
        // Every term adds to each error, so the visit never ends early.
        let _ = self.terms.visit(&mut |own, metric| {
            metric.add_squared_errors(iteration, pairs, factor * own, errors);
            Some(())
        });
    }

    fn label(&self) -> &'static str {
        "weighted-sum"
    }
}

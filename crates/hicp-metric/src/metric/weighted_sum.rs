//! Several metrics in one normal system.

use hicp_core::{Correspondences, Isometry3, Pair};

use crate::metric::error_metric::{ErrorMetric, Step};
use crate::system::normal_equations::NormalEquations;

/// E = Σₖ αₖ Eₖ: several metrics over the same pairs, minimised together by Gauss–Newton.
///
/// Point-to-plane with a little point-to-point (α = 0.1 or so) no longer slides along planes; GenZ-ICP (Lee, Lim & Han 2024) is
/// the sum of both with α and 1 − α. Terms are `(factor, metric)`: a tuple of two or three, or a `Vec` of any number of one type
/// (boxed ones, for instance). Factors are not negative; a term of factor 0 is left out.
///
/// Terms contribute their [`ErrorMetric::system`]s, so kernels and priors inside keep their effect; what solves (closed forms,
/// solvers, held components, policies) belongs outside: `Frozen` around the sum, not in it. The system is solved with the
/// policy and the held components of the first term.
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
    /// `(factor, metric)` each.
    pub terms: T,
}

/// The terms of a sum, in order.
struct Total {
    system: Option<NormalEquations>,
}

impl Total {
    /// Adds a term's system; `None` where the term has none.
    fn add<M: ErrorMetric>(
        &mut self,
        (factor, metric): &mut (f64, M),
        pairs: &Correspondences,
    ) -> Option<()> {
        if *factor > 0.0 {
            let term = metric.system(pairs)?;
            match &mut self.system {
                Some(system) => system.merge(&term, *factor),
                None => self.system = Some(term.scaled(*factor)),
            }
        }
        Some(())
    }
}

/// A term's part of the mean loss.
fn mean_loss<M: ErrorMetric>(
    (factor, metric): &mut (f64, M),
    pairs: &Correspondences,
) -> Option<f64> {
    if *factor > 0.0 {
        Some(*factor * metric.mean_loss(pairs)?)
    } else {
        Some(0.0)
    }
}

fn squared_error<M: ErrorMetric>((factor, metric): &(f64, M), pair: &Pair) -> f64 {
    if *factor > 0.0 {
        factor * metric.squared_error(pair)
    } else {
        0.0
    }
}

fn linearize<M: ErrorMetric>(
    (factor, metric): &(f64, M),
    pair: &Pair,
    system: &mut NormalEquations,
) {
    if *factor > 0.0 {
        #[allow(clippy::cast_possible_truncation)] // The weight of a pair is an f32.
        let weight = (f64::from(pair.weight) * factor) as f32;
        metric.linearize(&Pair { weight, ..*pair }, system);
    }
}

/// Gauss–Newton over the whole sum.
fn step(system: Option<NormalEquations>, mean_loss: Option<f64>) -> Option<Step> {
    Some(Step {
        increment: system?.solve()?,
        mean_loss: mean_loss?,
    })
}

macro_rules! sum {
    ($($member:ident),+) => {
        impl<$($member: ErrorMetric),+> ErrorMetric for WeightedSum<($((f64, $member),)+)> {
            #[allow(non_snake_case)]
            fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
                let ($($member,)+) = &self.terms;
                $(linearize($member, pair, system);)+
            }

            #[allow(non_snake_case)]
            fn squared_error(&self, pair: &Pair) -> f64 {
                let ($($member,)+) = &self.terms;
                let mut sum = 0.0;
                $(sum += squared_error($member, pair);)+
                sum
            }

            #[allow(non_snake_case)]
            fn mean_loss(&mut self, pairs: &Correspondences) -> Option<f64> {
                let ($($member,)+) = &mut self.terms;
                let mut sum = 0.0;
                $(sum += mean_loss($member, pairs)?;)+
                Some(sum)
            }

            #[allow(non_snake_case)]
            fn system(&mut self, pairs: &Correspondences) -> Option<NormalEquations> {
                let ($($member,)+) = &mut self.terms;
                let mut total = Total { system: None };
                $(total.add($member, pairs)?;)+
                total.system
            }

            fn minimize(&mut self, pairs: &Correspondences) -> Option<Step> {
                step(self.system(pairs), self.mean_loss(pairs))
            }

            #[allow(non_snake_case)]
            fn begin(&mut self, iteration: usize, init: &Isometry3<f64>) {
                let ($($member,)+) = &mut self.terms;
                $($member.1.begin(iteration, init);)+
            }

            fn name(&self) -> &'static str {
                "weighted-sum"
            }
        }
    };
}
sum!(A);
sum!(A, B);
sum!(A, B, C);

impl<M: ErrorMetric> ErrorMetric for WeightedSum<Vec<(f64, M)>> {
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        for term in &self.terms {
            linearize(term, pair, system);
        }
    }

    fn squared_error(&self, pair: &Pair) -> f64 {
        self.terms
            .iter()
            .map(|term| squared_error(term, pair))
            .sum()
    }

    fn mean_loss(&mut self, pairs: &Correspondences) -> Option<f64> {
        let mut sum = 0.0;
        for term in &mut self.terms {
            sum += mean_loss(term, pairs)?;
        }
        Some(sum)
    }

    fn system(&mut self, pairs: &Correspondences) -> Option<NormalEquations> {
        let mut total = Total { system: None };
        for term in &mut self.terms {
            total.add(term, pairs)?;
        }
        total.system
    }

    fn minimize(&mut self, pairs: &Correspondences) -> Option<Step> {
        step(self.system(pairs), self.mean_loss(pairs))
    }

    fn begin(&mut self, iteration: usize, init: &Isometry3<f64>) {
        for (_, metric) in &mut self.terms {
            metric.begin(iteration, init);
        }
    }

    fn name(&self) -> &'static str {
        "weighted-sum"
    }
}

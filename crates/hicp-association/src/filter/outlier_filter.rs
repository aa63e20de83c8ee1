//! The trait of outlier filters, and their chains.

use hicp_core::internal::{for_tuples, type_label};
use hicp_core::{Correspondences, Iteration, Problem};

/// Removes or re-weights pairs (the third and fourth ICP components, §II).
///
/// Rejection and weighting are one trait, so that both can be chained in any order. A removed pair
/// lowers the number of pairs, which stop rules read, and the fitness. A pair of weight 0 has no
/// influence on the step, but it still counts.
///
/// `()` keeps everything. A tuple of up to eight filters applies them in order, and so does a `Vec`
/// of any length.
///
/// # Contract
///
/// - Keeps the order of the pairs, their pose and the number of candidates. Weights stay finite and
///   not negative.
/// - Pure given the iteration. If it changes from one iteration to the next, it reads
///   [`Iteration::index`] and does not count its calls: a stage passes an earlier iteration again
///   after a rejected pose.
///
/// ```
/// use hicp_association::OutlierFilter;
/// use hicp_core::{Correspondences, Iteration};
///
/// /// Keeps pairs within a limit that halves with every iteration, down to 5 mm.
/// struct Narrowing {
///     first_meters: f32,
/// }
///
/// impl OutlierFilter for Narrowing {
///     fn filter(&mut self, iteration: &Iteration<'_>, pairs: &mut Correspondences) {
///         let halvings = i32::try_from(iteration.index).unwrap_or(i32::MAX);
///         let limit = (self.first_meters * 0.5_f32.powi(halvings)).max(0.005);
///         pairs.retain(|pair| pair.distance() <= limit);
///     }
/// }
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not an outlier filter",
    label = "this must implement `OutlierFilter`",
    note = "`Icp::filter` accepts an `OutlierFilter`, `()`, an `Option` of one, a `Vec` of one type (for example `Vec<Box<dyn OutlierFilter>>`), or a tuple of one to eight of them"
)]
pub trait OutlierFilter {
    /// Filters the pairs of one iteration and keeps their order.
    fn filter(&mut self, iteration: &Iteration<'_>, pairs: &mut Correspondences);

    /// Returns the name in traces.
    fn name(&self) -> &'static str {
        type_label::<Self>()
    }

    /// Returns the name of the component that does not support a problem, or `None`.
    ///
    /// For example, a projection needs a depth image and does not support two point clouds. A stage
    /// ends with `Termination::Unsupported` and this name before its first iteration. A component
    /// around another one forwards the call. The provided method returns `None`.
    fn unsupported(&self, _problem: &Problem<'_>) -> Option<&'static str> {
        None
    }

    /// Appends the names of the filters that this one applies, in order.
    ///
    /// A single filter appends its name; a chain appends those of its members.
    fn names(&self, names: &mut Vec<&'static str>) {
        names.push(self.name());
    }
}

impl OutlierFilter for () {
    fn filter(&mut self, _iteration: &Iteration<'_>, _pairs: &mut Correspondences) {}

    fn name(&self) -> &'static str {
        "none"
    }

    fn names(&self, _names: &mut Vec<&'static str>) {}
}

macro_rules! forward {
    ($($pointer:ty),+) => {$(
        impl<T: OutlierFilter + ?Sized> OutlierFilter for $pointer {
            fn filter(&mut self, iteration: &Iteration<'_>, pairs: &mut Correspondences) {
                (**self).filter(iteration, pairs);
            }

            fn name(&self) -> &'static str {
                (**self).name()
            }

            fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
                (**self).unsupported(problem)
            }

            fn names(&self, names: &mut Vec<&'static str>) {
                (**self).names(names);
            }
        }
    )+};
}
forward!(Box<T>, &mut T);

/// `None` keeps everything.
impl<T: OutlierFilter> OutlierFilter for Option<T> {
    fn filter(&mut self, iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        for filter in self.iter_mut() {
            filter.filter(iteration, pairs);
        }
    }

    fn name(&self) -> &'static str {
        self.as_ref().map_or("none", OutlierFilter::name)
    }

    fn names(&self, names: &mut Vec<&'static str>) {
        self.iter().for_each(|filter| filter.names(names));
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        self.as_ref()?.unsupported(problem)
    }
}

/// Applies the members in order.
impl<T: OutlierFilter> OutlierFilter for Vec<T> {
    fn filter(&mut self, iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        for filter in self.iter_mut() {
            filter.filter(iteration, pairs);
        }
    }

    fn name(&self) -> &'static str {
        "chain"
    }

    fn names(&self, names: &mut Vec<&'static str>) {
        self.iter().for_each(|filter| filter.names(names));
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        self.iter().find_map(|filter| filter.unsupported(problem))
    }
}

macro_rules! chain {
    ($($member:ident),+) => {
        impl<$($member: OutlierFilter),+> OutlierFilter for ($($member,)+) {
            #[allow(non_snake_case)]
            fn filter(&mut self, iteration: &Iteration<'_>, pairs: &mut Correspondences) {
                let ($($member,)+) = self;
                $($member.filter(iteration, pairs);)+
            }

            fn name(&self) -> &'static str {
                "chain"
            }

            #[allow(non_snake_case)]
            fn names(&self, names: &mut Vec<&'static str>) {
                let ($($member,)+) = self;
                $($member.names(names);)+
            }

            #[allow(non_snake_case)]
            fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
                let ($($member,)+) = self;
                None$(.or_else(|| $member.unsupported(problem)))+
            }
        }
    };
}
for_tuples!(chain);

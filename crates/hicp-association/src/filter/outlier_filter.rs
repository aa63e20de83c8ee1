//! The trait of outlier filters, and their chains.

use hicp_core::internal::{for_tuples, type_label};
use hicp_core::{Correspondences, Iteration, Problem};

/// Removes or re-weights pairs (the third and fourth ICP components, §II).
///
/// `()` keeps everything. A tuple of up to eight filters applies them in order, and so does a `Vec`
/// of any length.
///
/// A filter is pure given the iteration. If it changes from one iteration to the next, it reads
/// [`Iteration::index`] and does not count its calls.
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

    /// Returns the name of the part that cannot work on a problem, such as a projection between
    /// point clouds.
    ///
    /// A stage then ends with that name before it runs. The provided method returns `None`.
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

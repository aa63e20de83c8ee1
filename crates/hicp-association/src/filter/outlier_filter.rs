//! The trait of outlier filters, and how they chain.

use hicp_core::{Correspondences, Problem};

/// Removes or re-weights pairs (the third and fourth ICP components, §II).
///
/// `()` keeps everything; tuples apply their members in order.
pub trait OutlierFilter {
    /// Filters the pairs of one iteration, keeping their order.
    fn filter(&mut self, problem: &Problem<'_>, pairs: &mut Correspondences);

    /// Says which iteration of a stage, from 0, the next pairs belong to, for filters that change from one to the next.
    ///
    /// Pure given the iteration: only the number announced last counts, not which came before. A stage announces 0 to a filter
    /// that has seen others, and goes back by one to measure the pose that it returns after a rejected one.
    fn begin(&mut self, iteration: usize) {
        let _ = iteration;
    }
}

impl OutlierFilter for () {
    fn filter(&mut self, _problem: &Problem<'_>, _pairs: &mut Correspondences) {}
}

impl<T: OutlierFilter + ?Sized> OutlierFilter for Box<T> {
    fn filter(&mut self, problem: &Problem<'_>, pairs: &mut Correspondences) {
        (**self).filter(problem, pairs);
    }

    fn begin(&mut self, iteration: usize) {
        (**self).begin(iteration);
    }
}

/// `None` keeps everything.
impl<T: OutlierFilter> OutlierFilter for Option<T> {
    fn filter(&mut self, problem: &Problem<'_>, pairs: &mut Correspondences) {
        if let Some(inner) = self {
            inner.filter(problem, pairs);
        }
    }

    fn begin(&mut self, iteration: usize) {
        for member in self.iter_mut() {
            member.begin(iteration);
        }
    }
}

/// Applies the members in order.
impl<T: OutlierFilter> OutlierFilter for Vec<T> {
    fn filter(&mut self, problem: &Problem<'_>, pairs: &mut Correspondences) {
        for member in self {
            member.filter(problem, pairs);
        }
    }

    fn begin(&mut self, iteration: usize) {
        for member in self.iter_mut() {
            member.begin(iteration);
        }
    }
}

macro_rules! chain {
    ($($member:ident),+) => {
        impl<$($member: OutlierFilter),+> OutlierFilter for ($($member,)+) {
            #[allow(non_snake_case)]
            fn filter(&mut self, problem: &Problem<'_>, pairs: &mut Correspondences) {
                let ($($member,)+) = self;
                $($member.filter(problem, pairs);)+
            }

            #[allow(non_snake_case)]
            fn begin(&mut self, iteration: usize) {
                let ($($member,)+) = self;
                $($member.begin(iteration);)+
            }
        }
    };
}
chain!(A);
chain!(A, B);
chain!(A, B, C);
chain!(A, B, C, D);
chain!(A, B, C, D, E);
chain!(A, B, C, D, E, F);
chain!(A, B, C, D, E, F, G);
chain!(A, B, C, D, E, F, G, H);

//! The laws of outlier filters.

use hybrid_icp::association::OutlierFilter;
use hybrid_icp::core::{Correspondences, Isometry3, Iteration, Pair};

use crate::association::finite;
use crate::law::{Subject, Trial, bits};
use crate::pairs::{PairSet, good_pairs, hard_pairs};

/// The laws that [`check_filter`] checks beyond the contract of the trait.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FilterLaws {
    /// Filtering twice gives the same pairs as filtering once. True for fixed limits, false for
    /// shares and weights.
    pub idempotent: bool,
    /// Weights do not change: the filter only removes pairs.
    pub keeps_weights: bool,
}

/// Checks an [`OutlierFilter`]; `make` creates a fresh one.
///
/// # Laws
///
/// - Only removes pairs or changes their weights, and keeps their order. An empty set stays empty.
/// - Weights of finite pairs stay finite and not negative.
/// - The pose and the number of candidates stored in the pairs do not change.
/// - Pure: a fresh, a used and a boxed instance, and a chain of this filter alone, give the same
///   bits.
/// - Pure given the iteration: the result depends on the index of the iteration, not on earlier
///   iterations.
/// - Never panics: also without pairs, with one pair, with equal distances, and with numbers that
///   are not finite.
/// - Keeps the laws declared in [`FilterLaws`].
///
/// # Panics
///
/// Panics if a law is broken, with the law, the input and the value found.
pub fn check_filter<T: OutlierFilter + 'static>(make: impl Fn() -> T, laws: FilterLaws) {
    let subject = Subject::new::<T>(None);
    let (mut used, mut boxed) = (make(), Box::new(make()) as Box<dyn OutlierFilter>);
    for set in good_pairs().into_iter().chain(hard_pairs()) {
        for iteration in ITERATIONS {
            let input = format!("{}, iteration {iteration}", set.label);
            let trial = subject.on(&input);
            let filtered = |filter: &mut (dyn OutlierFilter + 'static)| {
                run(filter, &set, iteration, &set.pairs)
            };
            let expected = trial.calm(|| filtered(&mut make()));
            contract(&trial, laws, &set.pairs, &expected);
            trial.pure::<dyn OutlierFilter, _>(&expected, [&mut used, &mut boxed], filtered);
            for before in histories(iteration) {
                let mut filter = make();
                let input = format!("{input}, after the iterations {before:?}");
                let trial = subject.on(&input);
                for earlier in &before {
                    trial.calm(|| run(&mut filter, &set, *earlier, &set.pairs));
                }
                let law = "pure given the iteration: earlier iterations do not change the result";
                trial.same(law, &expected, &trial.calm(|| filtered(&mut filter)));
            }
            let law = "a chain of one filter gives the result of that filter";
            trial.same(law, &expected, &trial.calm(|| filtered(&mut (make(),))));
            if laws.idempotent {
                let law =
                    "idempotent, as declared: filtering twice gives the same as filtering once";
                let twice = trial.calm(|| run(&mut make(), &set, iteration, &expected));
                trial.same(law, &expected, &twice);
            }
        }
    }
}

/// The iterations in which filters are tested.
const ITERATIONS: [usize; 4] = [0, 1, 4, 49];

/// Returns sequences of iterations that may precede an iteration.
///
/// They are the regular one, a gap, another run, and the same iteration again, as after a rejected
/// pose.
fn histories(iteration: usize) -> [Vec<usize>; 4] {
    [
        (0..iteration).collect(),
        vec![iteration + 30],
        vec![0, 1, 2, 3],
        vec![iteration, iteration + 1],
    ]
}

/// Filters a copy of the pairs, as a stage does in an iteration.
fn run(
    filter: &mut dyn OutlierFilter,
    set: &PairSet,
    iteration: usize,
    pairs: &Correspondences,
) -> Correspondences {
    let mut pairs = pairs.clone();
    let init = Isometry3::translation(0.0, 0.0, 0.5);
    filter.filter(&Iteration::new(iteration, &init, set.problem), &mut pairs);
    pairs
}

fn contract(
    trial: &Trial<'_>,
    laws: FilterLaws,
    before: &Correspondences,
    after: &Correspondences,
) {
    trial.same(
        "the pose and the candidates stored in the pairs do not change",
        &(before.camera_from_object(), before.n_candidates()),
        &(after.camera_from_object(), after.n_candidates()),
    );
    let identity = |pair: &Pair| {
        bits(&Pair {
            weight: 0.0,
            ..*pair
        })
    };
    let mut rest = before.as_slice().iter();
    for pair in after.as_slice() {
        let wanted = identity(pair);
        let Some(origin) = rest.find(|candidate| identity(candidate) == wanted) else {
            trial.broken(
                "only removes or re-weights pairs, and keeps their order",
                format_args!("{pair:?}, which is not among the remaining input pairs"),
            );
        };
        if laws.keeps_weights {
            trial.same(
                "weights do not change, as declared",
                &origin.weight,
                &pair.weight,
            );
        }
        if finite(pair) && origin.weight.is_finite() {
            let law = "weights stay finite and not negative";
            let valid = pair.weight.is_finite() && pair.weight >= 0.0;
            trial.holds(law, valid, format_args!("{pair:?}"));
        }
    }
}

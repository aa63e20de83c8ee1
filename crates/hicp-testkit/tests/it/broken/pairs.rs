//! Selections, associations and filters with a fault.

use hicp_testkit::{AssociationLaws, FilterLaws, check_association, check_filter, check_selection};
use hybrid_icp::association::{DataAssociation, OutlierFilter, PointSelection, Projective};
use hybrid_icp::core::{Context, Correspondences, Isometry3, Iteration, Model, Pair, Surfel};

use super::caught;

/// A selection that differs at each call or returns points that are not finite.
struct Sloppy {
    calls: usize,
    nan: bool,
}

impl PointSelection for Sloppy {
    fn select(
        &mut self,
        context: &mut Context<'_>,
        pose: &Isometry3<f64>,
        source: &mut Vec<Surfel>,
    ) {
        let skip = self.calls;
        self.calls += 1;
        let samples = context.problem.model().map_or(&[][..], Model::samples);
        source.extend(samples.iter().skip(skip).take(9));
        if self.nan {
            source[0].point.x = pose.translation.x as f32 * f32::INFINITY;
        }
    }
}

#[test]
fn broken_selections_are_detected() {
    let sloppy = |nan| move || Sloppy { calls: 0, nan };
    caught("pure", || check_selection(sloppy(false)));
    caught("points are finite", || check_selection(sloppy(true)));
}

/// An association that changes the pairs of a correct association.
struct Spoilt(fn(&[Surfel], &mut Pair));

impl DataAssociation for Spoilt {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        pose: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        Projective.associate(context, source, pose, pairs);
        let change = self.0;
        pairs
            .as_mut_slice()
            .iter_mut()
            .for_each(|pair| change(source, pair));
    }
}

/// An association that removes pairs of other associations.
struct Clears;

impl DataAssociation for Clears {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        pose: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        pairs.retain(|_| false);
        Projective.associate(context, source, pose, pairs);
    }
}

/// An association that adds nothing to the pairs of others.
struct Continues;

impl DataAssociation for Continues {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        pose: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        if pairs.is_empty() {
            Projective.associate(context, source, pose, pairs);
        }
    }
}

#[test]
fn broken_associations_are_detected() {
    let laws = AssociationLaws::default();
    caught("moved by the pose", || {
        let unmoved = |source: &[Surfel], pair: &mut Pair| {
            pair.source = source[pair.source_index as usize];
        };
        check_association(|| Spoilt(unmoved), laws);
    });
    caught("not negative", || {
        check_association(|| Spoilt(|_, pair| pair.weight = -1.0), laws);
    });
    caught("source indices", || {
        check_association(|| Spoilt(|_, pair| pair.source_index += 10_000), laws);
    });
    caught("target indices", || {
        check_association(|| Spoilt(|_, pair| pair.target_index = u32::MAX), laws);
    });
    let computing = AssociationLaws {
        targets_are_the_observed: false,
        ..laws
    };
    caught("or unlisted", || {
        check_association(|| Spoilt(|_, pair| pair.target_index = 1 << 31), computing);
    });
    caught("observed surfels of their indices", || {
        check_association(|| Spoilt(|_, pair| pair.target.point.z += 0.01), laws);
    });
    caught("already there do not change", || {
        check_association(|| Clears, laws);
    });
    caught("change those that are added", || {
        check_association(|| Continues, laws);
    });
    caught("pairs are finite", || {
        check_association(|| Spoilt(|_, pair| pair.source.point.z /= 0.0), laws);
    });
}

/// A filter given by a function.
#[derive(Clone, Copy)]
struct By(fn(&mut Correspondences));

impl OutlierFilter for By {
    fn filter(&mut self, _iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        self.0(pairs);
    }
}

#[test]
fn broken_filters_are_detected() {
    let laws = FilterLaws::default();
    let spoils = |filter: fn(&mut Correspondences)| move || By(filter);
    caught("keeps their order", || {
        check_filter(spoils(|pairs| pairs.as_mut_slice().reverse()), laws);
    });
    caught("only removes", || {
        let moves = |pairs: &mut Correspondences| {
            for pair in pairs.as_mut_slice() {
                pair.target.point.x += 0.001;
            }
        };
        check_filter(spoils(moves), laws);
    });
    caught("not negative", || {
        let negates = |pairs: &mut Correspondences| {
            for pair in pairs.as_mut_slice() {
                pair.weight = -pair.weight - 1.0;
            }
        };
        check_filter(spoils(negates), laws);
    });
    let halves = |pairs: &mut Correspondences| {
        for pair in pairs.as_mut_slice() {
            pair.weight *= 0.5;
        }
    };
    caught("idempotent", || {
        let idempotent = FilterLaws {
            idempotent: true,
            ..laws
        };
        check_filter(spoils(halves), idempotent);
    });
    caught("weights do not change", || {
        let keeps_weights = FilterLaws {
            keeps_weights: true,
            ..laws
        };
        check_filter(spoils(halves), keeps_weights);
    });
    caught("never panics", || {
        check_filter(spoils(|pairs| assert!(!pairs.as_slice().is_empty())), laws);
    });
}

/// A filter that keeps fewer pairs with each iteration, based on a memory of earlier iterations.
struct Remembers {
    iterations: usize,
    remember: fn(usize, usize) -> usize,
}

impl OutlierFilter for Remembers {
    fn filter(&mut self, iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        self.iterations = (self.remember)(self.iterations, iteration.index);
        let limit = 0.05 / (1.0 + self.iterations as f32);
        pairs.retain(|pair| pair.distance() < limit);
    }
}

#[test]
fn filters_that_remember_earlier_iterations_are_detected() {
    let remembers = |remember| {
        move || Remembers {
            iterations: 0,
            remember,
        }
    };
    let law = "pure given the iteration";
    caught(law, || {
        let counts = |iterations, _| iterations + 1;
        check_filter(remembers(counts), FilterLaws::default());
    });
    caught(law, || {
        let never_back = |iterations: usize, iteration| iterations.max(iteration);
        check_filter(remembers(never_back), FilterLaws::default());
    });
    // Without the memory, the same filter is a schedule, which is correct.
    check_filter(remembers(|_, iteration| iteration), FilterLaws::default());
}

/// Checks that the helpers of this file pass without a fault, so that the faults themselves are
/// detected.
#[test]
fn components_without_a_fault_pass() {
    check_association(|| Spoilt(|_, _| ()), AssociationLaws::default());
    check_filter(|| By(|_| ()), FilterLaws::default());
}

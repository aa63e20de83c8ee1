//! The laws of data associations.

use hybrid_icp::association::DataAssociation;
use hybrid_icp::core::{
    Correspondences, Observation, Pair, Point3, Problem, RigidTransform, Surfel, Vector3,
};

use crate::law::{Subject, Trial};
use crate::scenes::{Case, cases, sides, workspace};

/// The laws that [`check_association`] checks beyond the contract of the trait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AssociationLaws {
    /// Every pair's source is `source[source_index]`, moved by the pose. False for an association
    /// that starts from the observation.
    pub sources_are_the_selected: bool,
    /// Every pair's target is the observation's surfel of `target_index`.
    ///
    /// False for an association that computes its targets, such as one that interpolates. Its
    /// indices are still those of observed surfels, or [`Pair::UNLISTED`].
    pub targets_are_the_observed: bool,
}

impl Default for AssociationLaws {
    fn default() -> Self {
        Self {
            sources_are_the_selected: true,
            targets_are_the_observed: true,
        }
    }
}

/// Checks a [`DataAssociation`]; `make` creates a fresh one.
///
/// # Laws
///
/// - Pure: a fresh, a used and a boxed instance give the same pairs in the same order.
/// - Never panics: without a source, with one point, with points and poses that are not finite, and
///   if nothing is observed.
/// - Pairs are finite. Weights are finite and not negative.
/// - The source is the selected point, *moved*. The target is the observed surfel of its index (see
///   [`AssociationLaws`]). Indices are in range.
/// - The pose stored in the pairs, and pairs that are already there, do not change. The pairs added
///   to those are the same as without them.
///
/// # Panics
///
/// Panics if a law is broken, with the law, the input and the value found.
pub fn check_association<T: DataAssociation + 'static>(
    make: impl Fn() -> T,
    laws: AssociationLaws,
) {
    let subject = Subject::new::<T>(Some(make().name()));
    let (mut used, mut boxed) = (make(), Box::new(make()) as Box<dyn DataAssociation>);
    for case in cases() {
        for (what, source) in sources(&case.problem) {
            let input = format!("{what} of {}", case.label);
            let trial = subject.on(&input);
            let associate = |association: &mut (dyn DataAssociation + 'static)| {
                let (mut workspace, mut pairs) = (workspace(), Correspondences::new());
                pairs.begin(&case.pose, source.len());
                let mut context = workspace.context(&case.problem);
                association.associate(&mut context, &source, &case.pose, &mut pairs);
                pairs
            };
            let pairs = trial.calm(|| associate(&mut make()));
            contract(&trial, laws, &source, sides(&case.problem).1, &pairs);
            let law = "the pose stored in the pairs does not change";
            trial.same(law, &case.pose, pairs.camera_from_object());
            let (earlier, later) = trial.calm(|| joined(&mut make(), &case, &source));
            let law = "pairs that are already there do not change";
            trial.same(law, &earlier_pairs().map(Some), &earlier);
            let law = "pairs that are already there do not change those that are added";
            trial.same(law, &pairs.as_slice(), &later.as_slice());
            trial.pure::<dyn DataAssociation, _>(&pairs, [&mut used, &mut boxed], associate);
        }
    }
    subject.named([make().name(), used.name(), boxed.name()]);
}

/// Returns the first pairs, which another association left there, and those added to them.
fn joined(
    association: &mut impl DataAssociation,
    case: &Case,
    source: &[Surfel],
) -> ([Option<Pair>; 2], Vec<Pair>) {
    let (mut workspace, mut pairs) = (workspace(), Correspondences::new());
    pairs.begin(&case.pose, source.len());
    pairs.extend(earlier_pairs());
    let mut context = workspace.context(&case.problem);
    association.associate(&mut context, source, &case.pose, &mut pairs);
    let mut pairs = pairs.as_slice().iter().copied();
    ([pairs.next(), pairs.next()], pairs.collect())
}

/// Returns pairs of another association: one in the scene, and one far from it.
fn earlier_pairs() -> [Pair; 2] {
    let surfel = |z| Surfel {
        point: Point3::new(0.0, 0.0, z),
        normal: -Vector3::z_axis(),
    };
    [0.5, 50.0].map(|z| Pair::new(0, surfel(z), 0, surfel(z + 0.01)))
}

fn sources(problem: &Problem<'_>) -> [(&'static str, Vec<Surfel>); 4] {
    let samples = sides(problem).0.samples();
    let some: Vec<Surfel> = samples.iter().step_by(8).copied().collect();
    let mut broken = some.clone();
    broken.truncate(20);
    broken[3].point = Point3::new(f32::NAN, 0.0, 0.0);
    broken[7].point = Point3::new(0.0, f32::INFINITY, 0.0);
    [
        ("every eighth sample", some),
        ("one sample", vec![samples[0]]),
        ("no sample", Vec::new()),
        ("samples that are not all finite", broken),
    ]
}

fn contract(
    trial: &Trial<'_>,
    laws: AssociationLaws,
    source: &[Surfel],
    observation: &Observation,
    pairs: &Correspondences,
) {
    let mover = RigidTransform::new(pairs.camera_from_object());
    for pair in pairs.as_slice() {
        let found = format_args!("{pair:?}");
        trial.holds("pairs are finite", finite(pair), found);
        let law = "weights are finite and not negative";
        trial.holds(law, pair.weight.is_finite() && pair.weight >= 0.0, found);
        if laws.sources_are_the_selected {
            let Some(selected) = source.get(pair.source_index as usize) else {
                trial.broken("source indices are in range", found);
            };
            let moved = mover.surfel(selected);
            let off = (moved.point - pair.source.point).norm();
            let turned = (moved.normal.into_inner() - pair.source.normal.into_inner()).norm();
            trial.holds(
                "sources are the selected points, moved by the pose",
                off <= 1e-5 * (1.0 + moved.point.coords.norm()) && turned < 1e-4,
                format_args!("{pair:?}, expected the source {moved:?}"),
            );
        }
        let observed = observation.surfel(pair.target_index);
        if laws.targets_are_the_observed {
            let law = "target indices are those of observed surfels";
            trial.holds(law, observed.is_some(), found);
            trial.holds(
                "targets are the observed surfels of their indices",
                observed == Some(&pair.target),
                format_args!("{pair:?}, expected the target {observed:?}"),
            );
        } else {
            let law = "target indices are those of observed surfels, or unlisted";
            let listed = pair.target_index != Pair::UNLISTED;
            trial.holds(law, observed.is_some() || !listed, found);
        }
    }
}

/// Returns whether all coordinates of a pair are finite.
pub(crate) fn finite(pair: &Pair) -> bool {
    [&pair.source, &pair.target].into_iter().all(|surfel| {
        surfel.point.iter().all(|x| x.is_finite()) && surfel.normal.iter().all(|x| x.is_finite())
    })
}

//! The laws of scores and switchers.

use hybrid_icp::score::Score;
use hybrid_icp::switch::Switcher;

use crate::law::Subject;
use crate::scenes::{at_rendered_pose, cases, scenes};

/// The laws that [`check_score`] checks beyond the contract of the trait.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScoreLaws {
    /// The largest possible score; infinity by default.
    pub worst: f64,
    /// The true pose scores better than one with an error of 3 cm and 30°. False for scores with
    /// another purpose.
    pub ranks_poses: bool,
    /// Number of renders in addition to that of the pose; 0 by default.
    pub extra_renders: u64,
}

impl Default for ScoreLaws {
    fn default() -> Self {
        Self {
            worst: f64::INFINITY,
            ranks_poses: true,
            extra_renders: 0,
        }
    }
}

/// Checks a [`Score`]; `make` creates a fresh one.
///
/// # Laws
///
/// - Never NaN, never negative, never above [`ScoreLaws::worst`].
/// - Pure: a fresh, a used and a boxed instance give the same bits.
/// - Never panics: also if nothing is observed, behind the camera, and at poses that are not
///   finite.
/// - Shares the render: uses the view from the context, so that a rendered pose is not rendered
///   again.
/// - The true pose scores better than one far away, as declared.
///
/// # Panics
///
/// Panics if a law is broken, with the law, the input and the value found.
pub fn check_score<T: Score + 'static>(make: impl Fn() -> T, laws: ScoreLaws) {
    let subject = Subject::new::<T>(Some(make().name()));
    let (mut used, mut boxed) = (make(), Box::new(make()) as Box<dyn Score>);
    for case in cases() {
        let trial = subject.on(&case.label);
        let score = |score: &mut (dyn Score + 'static)| {
            at_rendered_pose(&case.problem, &case.pose, |context| {
                score.score(context, &case.pose)
            })
        };
        let of_fresh = trial.calm(|| score(&mut make()));
        let (value, renders) = of_fresh;
        trial.holds("a score is never NaN", !value.is_nan(), value);
        trial.holds(
            "a score is within its range",
            value >= 0.0 && value <= laws.worst,
            format_args!("{value}, expected 0 to {}", laws.worst),
        );
        trial.shares_the_render(renders, laws.extra_renders);
        trial.pure::<dyn Score, _>(&of_fresh, [&mut used, &mut boxed], score);
    }
    for scene in scenes().iter().filter(|_| laws.ranks_poses) {
        let score = |pose| {
            at_rendered_pose(&scene.problem(), pose, |context| {
                make().score(context, pose)
            })
            .0
        };
        let (truth, far) = (score(&scene.truth), score(&scene.far));
        subject.on(scene.name).holds(
            "ranks poses, as declared: the true pose scores better than one far away",
            truth < far,
            format_args!("{truth} at the true pose, {far} far away"),
        );
    }
    subject.named([make().name(), used.name(), boxed.name()]);
}

/// The laws that [`check_switcher`] checks beyond the contract of the trait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SwitcherLaws {
    /// Number of regimes; two by default.
    pub regimes: usize,
    /// Number of renders in addition to that of the pose; 0 by default.
    pub extra_renders: u64,
}

impl Default for SwitcherLaws {
    fn default() -> Self {
        Self {
            regimes: 2,
            extra_renders: 0,
        }
    }
}

/// Checks a [`Switcher`]; `make` creates a fresh one.
///
/// # Laws
///
/// - The regime is one of those declared. The reported score is not NaN.
/// - Pure: a fresh, a used and a boxed instance give the same result.
/// - Never panics: also if nothing is observed, behind the camera, and at poses that are not
///   finite.
/// - Shares the render: uses the view from the context, so that a rendered pose is not rendered
///   again.
///
/// # Panics
///
/// Panics if a law is broken, with the law, the input and the value found.
pub fn check_switcher<T: Switcher + 'static>(make: impl Fn() -> T, laws: SwitcherLaws) {
    let subject = Subject::new::<T>(Some(make().name()));
    let (mut used, mut boxed) = (make(), Box::new(make()) as Box<dyn Switcher>);
    for case in cases() {
        let trial = subject.on(&case.label);
        let judge = |switcher: &mut (dyn Switcher + 'static)| {
            at_rendered_pose(&case.problem, &case.pose, |context| {
                switcher.regime(context, &case.pose)
            })
        };
        let of_fresh = trial.calm(|| judge(&mut make()));
        let (event, renders) = of_fresh;
        let found = format_args!("{event:?}");
        let declared = event.regime.0 < laws.regimes;
        trial.holds("the regime is one of those declared", declared, found);
        let is_number = !event.score.is_some_and(f64::is_nan);
        trial.holds("a score is never NaN", is_number, found);
        trial.shares_the_render(renders, laws.extra_renders);
        trial.pure::<dyn Switcher, _>(&of_fresh, [&mut used, &mut boxed], judge);
    }
    subject.named([make().name(), used.name(), boxed.name()]);
}

//! The laws of scores and switchers.

use hybrid_icp::score::Score;
use hybrid_icp::switch::Switcher;

use crate::law::Subject;
use crate::scenes::{at_rendered_pose, cases, scenes};

/// What [`check_score`] may take for granted of a score beyond the trait's contract.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScoreLaws {
    /// The largest score there is; infinity by default.
    pub worst: f64,
    /// The true pose scores better than one 3 cm and 30° off. False for scores that measure something else.
    pub ranks_poses: bool,
    /// Renders beside that of the pose; 0 by default.
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

/// Checks a [`Score`]; `make` makes a fresh one.
///
/// # Laws
///
/// - Never NaN, never negative, never above [`ScoreLaws::worst`].
/// - Pure: a fresh and a used instance give the same bits, and so does a boxed one.
/// - Never panics: also with nothing observed, behind the camera, and at poses that are not finite.
/// - Shares the render: asks the context, so that a pose already rendered costs no other render.
/// - The truth scores better than a pose far off, as declared.
///
/// # Panics
///
/// Panics with the law, the input and what was found when a law is broken.
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
            "ranks poses, as declared: the truth scores better than a pose far off",
            truth < far,
            format_args!("{truth} at the truth, {far} far off"),
        );
    }
    subject.named([make().name(), used.name(), boxed.name()]);
}

/// What [`check_switcher`] may take for granted of a switcher.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SwitcherLaws {
    /// How many regimes there are; two by default.
    pub regimes: usize,
    /// Renders beside that of the pose; 0 by default.
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

/// Checks a [`Switcher`]; `make` makes a fresh one.
///
/// # Laws
///
/// - The regime is one of those declared; the score it names is not NaN.
/// - Pure: a fresh and a used instance give the same answer, and so does a boxed one.
/// - Never panics: also with nothing observed, behind the camera, and at poses that are not finite.
/// - Shares the render: asks the context, so that a pose already rendered costs no other render.
///
/// # Panics
///
/// Panics with the law, the input and what was found when a law is broken.
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

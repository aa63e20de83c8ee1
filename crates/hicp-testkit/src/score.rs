//! The laws of scores and switchers.

use hybrid_icp::core::{Isometry3, Problem};
use hybrid_icp::icp::RegimeEvent;
use hybrid_icp::score::Score;
use hybrid_icp::switch::Switcher;

use crate::law::{BOXED, NAMED, PURE, SHARED_RENDER, Subject};
use crate::scenes::{cases, scenes, workspace};

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
    let mut used = make();
    for case in cases() {
        let input = case.label.as_str();
        let score = |score: &mut dyn Score| {
            subject.calm(input, || run_score(score, &case.problem, &case.pose))
        };
        let expected = score(&mut make());
        let (value, renders) = expected;
        subject.holds("a score is never NaN", input, !value.is_nan(), || {
            value.to_string()
        });
        subject.holds(
            "a score is within its range",
            input,
            value >= 0.0 && value <= laws.worst,
            || format!("{value}, expected 0 to {}", laws.worst),
        );
        subject.holds(SHARED_RENDER, input, renders <= laws.extra_renders, || {
            format!("{renders} more renders of a pose already rendered")
        });
        subject.same(PURE, input, &expected, &score(&mut used));
        subject.same(PURE, input, &expected, &score(&mut used));
        let mut boxed: Box<dyn Score> = Box::new(make());
        let through_box = subject.calm(input, || run_score(&mut boxed, &case.problem, &case.pose));
        subject.same(BOXED, input, &expected, &through_box);
        subject.same(BOXED, input, &make().name(), &boxed.name());
    }
    if laws.ranks_poses {
        for scene in scenes() {
            let (truth, _) = run_score(&mut make(), &scene.problem(), &scene.truth);
            let (far, _) = run_score(&mut make(), &scene.problem(), &scene.far);
            subject.holds(
                "ranks poses, as declared: the truth scores better than a pose far off",
                scene.name,
                truth < far,
                || format!("{truth} at the truth, {far} far off"),
            );
        }
    }
    subject.holds(NAMED, "any", !used.name().is_empty(), String::new);
    subject.same(NAMED, "any", &make().name(), &used.name());
}

fn run_score<S: Score + ?Sized>(
    score: &mut S,
    problem: &Problem<'_>,
    pose: &Isometry3<f64>,
) -> (f64, u64) {
    let mut workspace = workspace();
    workspace.context(problem).view(pose);
    let before = workspace.renders();
    let value = score.score(&mut workspace.context(problem), pose);
    (value, workspace.renders() - before)
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
    let mut used = make();
    for case in cases() {
        let input = case.label.as_str();
        let judge = |switcher: &mut dyn Switcher| {
            subject.calm(input, || run_switcher(switcher, &case.problem, &case.pose))
        };
        let expected = judge(&mut make());
        let (event, renders) = expected;
        subject.holds(
            "the regime is one of those declared",
            input,
            event.regime.0 < laws.regimes,
            || format!("{event:?}"),
        );
        subject.holds(
            "a score is never NaN",
            input,
            !event.score.is_some_and(f64::is_nan),
            || format!("{event:?}"),
        );
        subject.holds(SHARED_RENDER, input, renders <= laws.extra_renders, || {
            format!("{renders} more renders of a pose already rendered")
        });
        subject.same(PURE, input, &expected, &judge(&mut used));
        subject.same(PURE, input, &expected, &judge(&mut used));
        let mut boxed: Box<dyn Switcher> = Box::new(make());
        let through_box = subject.calm(input, || {
            run_switcher(&mut boxed, &case.problem, &case.pose)
        });
        subject.same(BOXED, input, &expected, &through_box);
        subject.same(BOXED, input, &make().name(), &boxed.name());
    }
    subject.holds(NAMED, "any", !used.name().is_empty(), String::new);
    subject.same(NAMED, "any", &make().name(), &used.name());
}

fn run_switcher<S: Switcher + ?Sized>(
    switcher: &mut S,
    problem: &Problem<'_>,
    pose: &Isometry3<f64>,
) -> (RegimeEvent, u64) {
    let mut workspace = workspace();
    workspace.context(problem).view(pose);
    let before = workspace.renders();
    let event = switcher.regime(&mut workspace.context(problem), pose);
    (event, workspace.renders() - before)
}

//! Tests of switching until the score stalls, and of the decisions that guards report.

use hicp_core::{Context, Isometry3, Problem};
use hicp_icp::{
    DecisionEvent, Guard, KeepBest, Observer, Outcome, Session, Stage, Termination, Workspace,
};
use hicp_score::Score;
use hicp_switch::{Regime, RegimeEvent, SwitchUntilStall, Switcher};

use crate::support::RayCaster;

/// The distance from x = 2.
struct Distance;

impl Score for Distance {
    fn score(&mut self, _: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> f64 {
        (camera_from_object.translation.vector.x - 2.0).abs()
    }
}

/// Selects by the side, and scores by the distance if it has a score.
struct BySide {
    scores: bool,
}

impl Switcher for BySide {
    fn regime(&mut self, context: &mut Context<'_>, pose: &Isometry3<f64>) -> RegimeEvent {
        RegimeEvent {
            regime: Regime(usize::from(pose.translation.vector.x < 2.0)),
            score: self.scores.then(|| Distance.score(context, pose)),
        }
    }
}

struct Shift(f64);

impl Stage for Shift {
    fn run(&mut self, _: &Problem<'_>, init: &Isometry3<f64>, _: &mut Session<'_>) -> Outcome {
        let moved = Isometry3::translation(self.0, 0.0, 0.0) * init;
        Outcome::refined(moved, Termination::Converged)
    }
}

/// The pose, the score, the best score and the decision of each event; and the regimes.
#[derive(Default)]
struct Decisions(Vec<(f64, f64, f64, bool)>, Vec<Regime>);

impl Observer for Decisions {
    fn on_regime(&mut self, event: &RegimeEvent) {
        self.1.push(event.regime);
    }

    fn on_decision(&mut self, event: &DecisionEvent<'_>) {
        let x = event.camera_from_object.translation.vector.x;
        self.0.push((x, event.score, event.best, event.kept));
    }
}

/// Runs a stage from x, and returns the x that it ends at, and the decisions.
fn run(mut stage: impl Stage, x: f64) -> (f64, Vec<(f64, f64, f64, bool)>) {
    let (mut workspace, mut decisions) = (Workspace::new(RayCaster), Decisions::default());
    let mut session = Session::new(&mut workspace, &mut decisions);
    let init = Isometry3::translation(x, 0.0, 0.0);
    let outcome = stage.run(&Problem::default(), &init, &mut session);
    (outcome.camera_from_object.translation.vector.x, decisions.0)
}

fn alternate(scores: bool) -> impl Stage {
    SwitchUntilStall {
        switcher: BySide { scores },
        aligned: Shift(0.5),
        misaligned: Shift(1.0),
        max_steps: 6,
        min_gain: 0.01,
        good_enough: 0.0,
    }
}

#[test]
fn a_custom_switcher_selects_and_scores() {
    let (end, decisions) = run(alternate(true), 0.25);
    let expected = [
        (1.25, 0.75, 1.75, true),
        (2.25, 0.25, 0.75, true),
        (2.75, 0.75, 0.25, false),
        // The other stage is tried once.
        (3.25, 1.25, 0.25, false),
    ];
    assert_eq!((end, &decisions[..]), (2.25, &expected[..]));
}

#[test]
fn the_regime_of_the_switcher_is_reported_and_after_a_stall_the_other_one() {
    let mut stage = SwitchUntilStall {
        switcher: Regime(2),
        aligned: Shift(0.5),
        misaligned: Shift(1.0),
        max_steps: 6,
        min_gain: 0.01,
        good_enough: 0.0,
    };
    let (mut workspace, mut seen) = (Workspace::new(RayCaster), Decisions::default());
    let mut session = Session::new(&mut workspace, &mut seen);
    stage.run(&Problem::default(), &Isometry3::identity(), &mut session);
    assert_eq!(seen.1, [Regime(2), Regime::ALIGNED]);
}

#[test]
fn without_a_score_no_step_improves_and_nothing_is_decided() {
    assert_eq!(run(alternate(false), 0.25), (0.25, Vec::new()));
}

#[test]
fn guards_report_what_they_keep() {
    let guard = |x| {
        let (stage, score) = (Shift(1.0), Distance);
        run(Guard { stage, score }, x)
    };
    assert_eq!(guard(0.0), (1.0, vec![(1.0, 1.0, 2.0, true)]));
    assert_eq!(guard(2.0), (2.0, vec![(3.0, 1.0, 0.0, false)]));
    let best = KeepBest {
        times: 2,
        stage: Shift(1.0),
        score: Distance,
    };
    let expected = vec![(2.0, 0.0, 1.0, true), (3.0, 1.0, 0.0, false)];
    assert_eq!(run(best, 1.0), (2.0, expected));
}

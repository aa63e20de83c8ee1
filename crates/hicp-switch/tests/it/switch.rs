//! Tests of Dynamic Switching: the called switcher, the selected stage, and the reported events.

use crate::support::{RayCaster, cuboid, depth_image, observe, observe_depth, pose, wedge};
use hicp_core::{Context, Isometry3, Model, PinholeCamera, Problem};
use hicp_icp::{Cascade, Observer, Outcome, Session, Stage, Termination, Workspace};
use hicp_score::{MeanVsd, Score};
use hicp_switch::{PAPER_ALPHA, Regime, RegimeEvent, Switch, Switcher, Threshold};

/// A score with a fixed value.
#[derive(Clone, Copy, Debug)]
struct Fixed(f64);

impl Score for Fixed {
    fn score(&mut self, _: &mut Context<'_>, _: &Isometry3<f64>) -> f64 {
        self.0
    }
}

/// A stage that marks the pose.
struct Mark(f64);

impl Stage for Mark {
    fn run(&mut self, _: &Problem<'_>, init: &Isometry3<f64>, _: &mut Session<'_>) -> Outcome {
        let marked = Isometry3::translation(self.0, 0.0, 0.0) * init;
        Outcome::kept(&marked, Termination::Converged)
    }
}

#[derive(Default)]
struct Regimes(Vec<RegimeEvent>);

impl Observer for Regimes {
    fn on_regime(&mut self, event: &RegimeEvent) {
        self.0.push(*event);
    }
}

/// Runs a switch between marks 1 (aligned) and 2 (misaligned), and returns the mark and the events.
fn mark(switcher: impl Switcher) -> (f64, Vec<RegimeEvent>) {
    let model = Model::new(cuboid(0.1, 0.1, 0.1));
    let camera = PinholeCamera::new(10.0, 10.0, 3.5, 3.5, 8, 8).unwrap();
    let observation = observe_depth(depth_image(&camera, |_| 1.0), &camera);
    let mut switch = Switch {
        switcher,
        aligned: Mark(1.0),
        misaligned: Mark(2.0),
    };
    let (mut workspace, mut regimes) = (Workspace::new(RayCaster), Regimes::default());
    let mut session = Session::new(&mut workspace, &mut regimes);
    let outcome = switch.run(
        &Problem::new(&model, &observation),
        &Isometry3::identity(),
        &mut session,
    );
    (outcome.camera_from_object.translation.vector.x, regimes.0)
}

/// A switcher that is aligned inside of a cascade.
struct InCascade;

impl Switcher for InCascade {
    fn regime(&mut self, context: &mut Context<'_>, pose: &Isometry3<f64>) -> RegimeEvent {
        let mut regime = match context.cascade_init() {
            Some(_) => Regime::ALIGNED,
            None => Regime::MISALIGNED,
        };
        regime.regime(context, pose)
    }
}

#[test]
fn a_switcher_knows_the_initial_pose_of_its_cascade() {
    let model = Model::new(cuboid(0.1, 0.1, 0.1));
    let camera = PinholeCamera::new(10.0, 10.0, 3.5, 3.5, 8, 8).unwrap();
    let observation = observe_depth(depth_image(&camera, |_| 1.0), &camera);
    let problem = Problem::new(&model, &observation);
    let (mut workspace, init) = (Workspace::new(RayCaster), Isometry3::identity());
    let mut marked = |stage: &mut dyn Stage| {
        let outcome = stage.run(&problem, &init, &mut Session::new(&mut workspace, &mut ()));
        outcome.camera_from_object.translation.x
    };
    let switch = || Switch {
        switcher: InCascade,
        aligned: Mark(1.0),
        misaligned: Mark(2.0),
    };
    assert_eq!(marked(&mut switch()), 2.0);
    assert_eq!(marked(&mut Cascade((switch(),))), 1.0);
}

#[test]
fn pitfall_24_a_score_of_exactly_alpha_is_misaligned() {
    assert_eq!(PAPER_ALPHA, 0.4);
    for (score, regime, expected) in [
        (0.0, Regime::ALIGNED, 1.0),
        (PAPER_ALPHA.next_down(), Regime::ALIGNED, 1.0),
        (PAPER_ALPHA, Regime::MISALIGNED, 2.0),
        (PAPER_ALPHA.next_up(), Regime::MISALIGNED, 2.0),
        (1.0, Regime::MISALIGNED, 2.0),
    ] {
        let threshold = Threshold {
            score: Fixed(score),
            alpha: PAPER_ALPHA,
        };
        let event = RegimeEvent {
            regime,
            score: Some(score),
        };
        assert_eq!(mark(threshold), (expected, vec![event]));
        let boxed: Box<dyn Switcher> = Box::new(threshold);
        assert_eq!(mark(boxed), (expected, vec![event]));
    }
}

#[test]
fn a_regime_is_a_constant_switcher() {
    for (regime, expected, name) in [
        (Regime::ALIGNED, 1.0, "aligned"),
        (Regime::MISALIGNED, 2.0, "misaligned"),
    ] {
        assert_eq!(
            mark(regime),
            (
                expected,
                vec![RegimeEvent {
                    regime,
                    score: None
                }]
            )
        );
        assert_eq!(Switcher::name(&regime), name);
    }
    let boxed: Box<dyn Switcher> = Box::new(Threshold {
        score: Fixed(0.0),
        alpha: 0.0,
    });
    assert_eq!(Switcher::name(&boxed), "threshold");
}

#[test]
fn nested_switches_report_every_choice() {
    let model = Model::new(wedge());
    let camera = PinholeCamera::new(80.3, 84.1, 31.3, 23.9, 64, 48).unwrap();
    let at = pose(0.0, 0.0, 0.25, 0.4, 0.2, 0.1);
    let observation = observe(&model, &camera, &at);
    let threshold = |alpha| Threshold {
        score: MeanVsd::paper(),
        alpha,
    };
    let mut nested = Switch {
        switcher: threshold(0.4),
        aligned: Switch {
            switcher: threshold(0.0),
            aligned: Mark(1.0),
            misaligned: Mark(2.0),
        },
        misaligned: Mark(3.0),
    };
    let mut workspace = Workspace::new(RayCaster);
    let mut run = |init: &Isometry3<f64>| {
        let mut regimes = Regimes::default();
        let mut session = Session::new(&mut workspace, &mut regimes);
        let outcome = nested.run(&Problem::new(&model, &observation), init, &mut session);
        let by = outcome.camera_from_object.translation.vector.x - init.translation.vector.x;
        (
            by,
            regimes
                .0
                .iter()
                .map(|e| (e.regime, e.score))
                .collect::<Vec<_>>(),
            workspace.renders(),
        )
    };
    // The true pose scores 0: below 0.4, and not below 0. Both share its render.
    let (by, told, renders) = run(&at);
    assert!((by - 2.0).abs() < 1e-15);
    assert_eq!(
        told,
        [
            (Regime::ALIGNED, Some(0.0)),
            (Regime::MISALIGNED, Some(0.0))
        ]
    );
    assert_eq!(renders, 1);
    // Behind the camera nothing agrees.
    let (by, told, _) = run(&pose(0.0, 0.0, -1.0, 0.0, 0.0, 0.0));
    assert_eq!((by, told), (3.0, vec![(Regime::MISALIGNED, Some(1.0))]));
    // A pose that is not finite must not panic.
    let (_, told, _) = run(&Isometry3::translation(0.0, f64::NAN, 0.25));
    assert_eq!(told, [(Regime::MISALIGNED, Some(1.0))]);
}

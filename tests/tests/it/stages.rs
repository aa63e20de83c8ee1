//! Stages made of stages: acceleration, schedules, guards, and the numbers at the returned pose.

use hicp_sim::{Household, rng};
use hicp_tests::{Scene, perturbed_scene};
use hybrid_icp::association::{
    AllSamples, MaxDistance, NearestNeighbor, OutlierFilter, Projective, Schedule, VisibleSurface,
};
use hybrid_icp::core::Iteration;
use hybrid_icp::core::{Correspondences, Isometry3, Problem};
use hybrid_icp::icp::{
    Anderson, Cascade, Guard, Icp, IterationEvent, IterationLimit, KeepBest, Observer, Outcome,
    Quality, Regime, SmallMotion, Stage, StageEvent, Termination, Verdict, Workspace,
};
use hybrid_icp::metric::{PointToPlane, PointToPoint};
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::MeanVsd;
use hybrid_icp::switch::{Switch, SwitchAmong, Thresholds};
use hybrid_icp::{Preset, Refiner, presets};

fn case(object: Household, seed: u64, meters: f64, angle: f64) -> (Scene, Isometry3<f64>) {
    perturbed_scene(object, 0.5, &mut rng(seed), (meters, angle))
}

fn slow_icp<S>(stop: S) -> Icp<AllSamples, NearestNeighbor, (), PointToPoint, S> {
    Icp {
        selection: AllSamples,
        association: NearestNeighbor::default(),
        filter: (),
        metric: PointToPoint,
        stop,
    }
}

/// Records the loss at the end of every ICP stage.
#[derive(Default)]
struct StepLosses(Vec<f64>);

impl Observer for StepLosses {
    fn on_stage_end(&mut self, event: &StageEvent<'_>) {
        let loss = event
            .outcome
            .evaluation
            .map_or(f64::INFINITY, |e| e.mean_loss);
        self.0.push(loss);
    }
}

#[test]
fn anderson_reaches_a_loss_in_fewer_steps_than_plain_iteration() {
    let (mut plain_steps, mut fast_steps) = (0, 0);
    for seed in 0..6 {
        let (scene, init) = case(Household::Iron, seed, 0.004, 0.08);
        // The plain iteration makes one increment per step until it converges.
        let mut pose = init;
        let mut losses = Vec::new();
        for _ in 0..60 {
            let outcome = scene.run(&mut slow_icp(IterationLimit(2)), &pose, &mut ());
            let Some(evaluation) = outcome.evaluation else {
                break;
            };
            losses.push(evaluation.mean_loss);
            pose = outcome.camera_from_object;
        }
        let reached = losses.iter().copied().fold(f64::INFINITY, f64::min) * 1.001;
        plain_steps += losses.iter().position(|l| *l <= reached).unwrap() + 1;
        let mut steps = StepLosses::default();
        let mut fast = Anderson::new(slow_icp(IterationLimit(2)));
        scene.run(&mut fast, &init, &mut steps);
        let position = steps.0.iter().position(|l| *l <= reached);
        fast_steps += position.map_or(60, |index| index + 1);
    }
    assert!(
        fast_steps < plain_steps,
        "{fast_steps} accelerated steps, {plain_steps} plain ones"
    );
}

#[test]
fn anderson_never_returns_a_higher_loss_than_its_first_step() {
    for seed in 0..6 {
        let (scene, init) = case(Household::Car, seed, 0.01, 0.3);
        let first = scene.run(&mut slow_icp(IterationLimit(2)), &init, &mut ());
        let mut fast = Anderson::new(slow_icp(IterationLimit(2)));
        let outcome = scene.run(&mut fast, &init, &mut ());
        let loss = |o: &Outcome| o.evaluation.map_or(f64::INFINITY, |e| e.mean_loss);
        assert!(loss(&outcome) <= loss(&first), "{outcome:?}");
        assert_eq!(scene.run(&mut fast, &init, &mut ()), outcome, "pure");
    }
}

/// Records the number of pairs of every iteration.
#[derive(Default)]
struct PairCounts(Vec<usize>);

impl Observer for PairCounts {
    fn on_iteration(&mut self, event: &IterationEvent<'_>) -> std::ops::ControlFlow<()> {
        self.0.push(event.evaluation.n_pairs);
        std::ops::ControlFlow::Continue(())
    }
}

#[test]
fn a_schedule_applies_one_filter_per_iteration_and_restarts_with_each_run() {
    let (scene, init) = case(Household::Mug, 3, 0.004, 0.05);
    let gates = [0.5, 0.02, 0.01, 0.3];
    let mut stage = Icp {
        selection: VisibleSurface::default(),
        association: Projective,
        filter: (Schedule::new(gates.map(MaxDistance::diameters).to_vec()),),
        metric: PointToPoint,
        stop: (IterationLimit(6),),
    };
    let record = |stage: &mut dyn Stage| {
        let mut counts = PairCounts::default();
        let outcome = scene.run(stage, &init, &mut counts);
        (counts.0, outcome)
    };
    let (counts, outcome) = record(&mut stage);
    assert_eq!(counts.len(), 6);
    assert!(
        counts[1] < counts[0] && counts[2] < counts[1] && counts[3] > counts[2],
        "{counts:?}"
    );
    // The outcome states the numbers of the iteration at the returned pose.
    assert_eq!(outcome.n_pairs(), counts[5]);
    assert_eq!(record(&mut stage), (counts, outcome), "a second stage run");
}

#[test]
fn after_a_rollback_the_quality_is_that_of_the_returned_pose() {
    let mut rolled_back = 0;
    for seed in 0..12 {
        let (scene, init) = case(Household::Hammer, seed, 0.004, 0.1);
        let mut stage = presets::projective_point_to_plane();
        let outcome = scene.run(&mut stage, &init, &mut ());
        rolled_back += usize::from(matches!(
            outcome.termination,
            Termination::PairsLost | Termination::LossIncreased
        ));
        let Some(quality) = outcome.quality else {
            continue;
        };
        // The same points, associated again at the returned pose, must give the same pairs.
        let problem = scene.problem();
        let mut workspace = Workspace::new(Rasterizer::default());
        let mut context = workspace.context(&problem);
        let mut source = Vec::new();
        let pose = outcome.camera_from_object;
        use hybrid_icp::association::{DataAssociation, PointSelection};
        VisibleSurface::default().select(&mut context, &init, &mut source);
        let mut pairs = Correspondences::new();
        pairs.begin(&pose, source.len());
        Projective.associate(&mut context, &source, &pose, &mut pairs);
        assert_eq!(
            Quality::of(&Iteration::default(), &pairs, &mut PointToPlane),
            Some(quality),
            "seed {seed}"
        );
        assert_eq!(pairs.len(), outcome.n_pairs());
        assert!((0.0..=1.0).contains(&quality.fitness) && quality.plane_rmse <= quality.point_rmse);
        let loss = outcome.evaluation.unwrap().mean_loss;
        assert!((loss.sqrt() - quality.plane_rmse).abs() < 1e-9);
    }
    assert!(rolled_back >= 3, "only {rolled_back} of 12 rolled back");
}

#[test]
fn a_guard_never_raises_the_score_and_keep_best_keeps_the_lowest() {
    let mut worse_without = 0;
    for (seed, object) in (0..).zip([
        Household::Bowl,
        Household::Plate,
        Household::Mug,
        Household::Pan,
    ]) {
        for (translation, angle) in [(0.0, 0.0), (0.004, 0.1), (0.02, 0.5), (0.08, 1.5)] {
            let (scene, init) = case(object, seed, translation, angle);
            let refine = |stage: Box<dyn Stage + Send>| {
                Refiner::boxed(stage).refine(&scene.model, &scene.observation, &init)
            };
            let plain = refine(Preset::NnPointToPoint.build());
            worse_without += usize::from(plain.mve > plain.mve_initial);
            let guarded = refine(Box::new(Guard {
                stage: Preset::NnPointToPoint.build(),
                score: MeanVsd::default(),
            }));
            if plain.mve < plain.mve_initial {
                assert_eq!(
                    guarded.outcome.camera_from_object,
                    plain.outcome.camera_from_object
                );
            } else {
                assert_eq!(guarded.outcome.camera_from_object, init);
                assert!(matches!(guarded.outcome.verdict, Verdict::KeptInitial(_)));
            }
            let best = refine(Box::new(KeepBest {
                times: 3,
                stage: Preset::NnPointToPoint.build(),
                score: MeanVsd::default(),
            }));
            assert!(best.mve <= plain.mve.min(plain.mve_initial), "{best:?}");
        }
    }
    assert!(worse_without > 0, "no case needs the guard");
}

#[test]
fn a_switch_among_two_stages_equals_the_switch() {
    let (scene, init) = case(Household::Mug, 5, 0.05, 1.0);
    let bounds = vec![0.4];
    let score = MeanVsd::default();
    let mut two = Switch {
        switcher: Thresholds {
            score,
            bounds: bounds.clone(),
        },
        aligned: Preset::ProjectiveCascadePointPlane.build(),
        misaligned: Preset::NnPointToPoint.build(),
    };
    let mut many = SwitchAmong {
        switcher: Thresholds { score, bounds },
        stages: vec![
            Preset::ProjectiveCascadePointPlane.build(),
            Preset::NnPointToPoint.build(),
        ],
    };
    for pose in [scene.truth, init] {
        assert_eq!(
            scene.run(&mut many, &pose, &mut ()),
            scene.run(&mut two, &pose, &mut ())
        );
    }
    let mut beyond = SwitchAmong {
        switcher: Regime(7),
        stages: many.stages,
    };
    let mut last = Preset::NnPointToPoint.build();
    assert_eq!(
        scene.run(&mut beyond, &init, &mut ()),
        scene.run(&mut *last, &init, &mut ())
    );
}

/// Stops every stage after a number of iterations.
struct StopAfter {
    after: usize,
    ended: Vec<Termination>,
}

impl Observer for StopAfter {
    fn on_iteration(&mut self, event: &IterationEvent<'_>) -> std::ops::ControlFlow<()> {
        if event.iteration + 1 >= self.after {
            std::ops::ControlFlow::Break(())
        } else {
            std::ops::ControlFlow::Continue(())
        }
    }

    fn on_stage_end(&mut self, event: &StageEvent<'_>) {
        self.ended.push(event.outcome.termination);
    }
}

#[test]
fn an_observer_can_stop_a_cascade() {
    let (scene, init) = case(Household::Iron, 1, 0.004, 0.05);
    let mut stage = Cascade((
        slow_icp(SmallMotion::default()),
        slow_icp(SmallMotion::default()),
    ));
    let mut observer = StopAfter {
        after: 2,
        ended: Vec::new(),
    };
    let outcome = scene.run(&mut stage, &init, &mut observer);
    // The second stage does not run.
    assert_eq!(observer.ended, [Termination::Stopped]);
    assert_eq!(
        (outcome.termination, outcome.iterations),
        (Termination::Stopped, 2)
    );
    assert_eq!(outcome.verdict, Verdict::Refined);
}

#[test]
fn filters_in_vectors_options_and_boxes_receive_the_iteration_too() {
    #[derive(Default)]
    struct Indices(Vec<usize>);
    impl OutlierFilter for Indices {
        fn filter(&mut self, iteration: &Iteration<'_>, _: &mut Correspondences) {
            self.0.push(iteration.index);
        }
    }
    let mut nested = (vec![Some(Box::new(Indices::default()))],);
    for index in [0, 1] {
        let iteration = Iteration::new(index, &Isometry3::identity(), Problem::default());
        nested.filter(&iteration, &mut Correspondences::new());
    }
    assert_eq!(nested.0[0].as_ref().unwrap().0, [0, 1]);
}

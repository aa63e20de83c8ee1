//! A custom observer: the error at every iteration, within a budget.

use std::ops::ControlFlow;

use hicp_sim::{Household, rng};
use hicp_tests::{perturbed_scene, scene};
use hybrid_icp::core::{Isometry3, se3};
use hybrid_icp::icp::{
    DecisionEvent, IterationEvent, Observer, SearchOptions, StageEvent, Start, Termination,
};
use hybrid_icp::{Preset, Refiner, presets};

// --- The component ---

/// Records the error of every evaluated pose, and ends the run after a number of iterations.
///
/// The iterations of all stages count together. A stop rule sees those of its own stage only.
#[derive(Debug)]
struct ErrorCurve {
    truth: Isometry3<f64>,
    budget: usize,
    /// Stage, metric loss, degrees, millimeters.
    rows: Vec<(usize, f64, f64, f64)>,
    ended: Vec<(&'static str, Termination)>,
}

impl Observer for ErrorCurve {
    fn on_iteration(&mut self, event: &IterationEvent<'_>) -> ControlFlow<()> {
        let (angle, distance) = se3::pose_distance(event.camera_from_object, &self.truth);
        let loss = event.evaluation.mean_loss;
        self.rows
            .push((self.ended.len(), loss, angle.to_degrees(), distance * 1e3));
        if self.rows.len() >= self.budget {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    fn on_stage_end(&mut self, event: &StageEvent<'_>) {
        self.ended.push((event.metric, event.outcome.termination));
    }
}

// --- Its tests ---

fn observe(budget: usize) -> (ErrorCurve, hybrid_icp::Refinement, hybrid_icp::Refinement) {
    let (scene, init) = perturbed_scene(Household::Iron, 0.5, &mut rng(2), (0.006, 0.1));
    let (truth, rows, ended) = (scene.truth, Vec::new(), Vec::new());
    let mut curve = ErrorCurve {
        truth,
        budget,
        rows,
        ended,
    };
    let mut refiner = Refiner::preset(Preset::ProjectiveCascadePointPlane);
    let observed = refiner.refine_observed(&scene.model, &scene.observation, &init, &mut curve);
    let unobserved = refiner.refine(&scene.model, &scene.observation, &init);
    (curve, observed, unobserved)
}

#[test]
fn the_curve_begins_at_the_start_and_holds_the_returned_pose() {
    let (curve, observed, unobserved) = observe(usize::MAX);
    assert_eq!(observed, unobserved, "looking changes nothing");
    let (stage, _, degrees, millimeters) = curve.rows[0];
    assert_eq!(stage, 0);
    assert!((degrees - 0.1_f64.to_degrees()).abs() < 1e-6 && (millimeters - 6.0).abs() < 1e-6);
    let metrics: Vec<_> = curve.ended.iter().map(|(metric, _)| *metric).collect();
    assert_eq!(metrics, ["point-to-point", "point-to-plane"]);
    let (angle, _) = se3::pose_distance(&observed.outcome.camera_from_object, &curve.truth);
    let returned = curve
        .rows
        .iter()
        .position(|row| row.2 == angle.to_degrees());
    assert!(
        returned.is_some_and(|row| row > 0) && angle.to_degrees() < 0.5 * degrees,
        "{curve:?}"
    );
}

#[test]
fn the_budget_is_that_of_all_stages_together() {
    let (all, ..) = observe(usize::MAX);
    let first_stage = all.rows.iter().filter(|row| row.0 == 0).count();
    let (curve, stopped, unobserved) = observe(first_stage + 2);
    assert!(all.rows.len() > first_stage + 2);
    assert_eq!(curve.rows, all.rows[..first_stage + 2]);
    assert_eq!(curve.ended[1].1, Termination::Stopped);
    assert_eq!(stopped.outcome.termination, Termination::Stopped);
    assert!(stopped.outcome.iterations < unobserved.outcome.iterations);
}

/// Stores the decisions of searches.
#[derive(Default)]
struct Decisions(Vec<(Isometry3<f64>, bool)>);

impl Observer for Decisions {
    fn on_decision(&mut self, event: &DecisionEvent<'_>) {
        if event.stage == "hypothesis-search" {
            self.0.push((*event.camera_from_object, event.kept));
        }
    }
}

#[test]
fn a_search_reports_its_poses_and_at_last_the_returned_one() {
    let scene = scene(Household::Iron, 0.0, &mut rng(2));
    let options = SearchOptions {
        start: Start::Ignored,
        ..SearchOptions::default()
    };
    let mut decisions = Decisions::default();
    let refined = Refiner::new(presets::search_with(options)).refine_observed(
        &scene.model,
        &scene.observation,
        &Isometry3::translation(0.0, 0.0, 0.5),
        &mut decisions,
    );
    let returned = (refined.outcome.camera_from_object, true);
    assert_eq!(decisions.0.last(), Some(&returned));
    assert!(decisions.0.iter().any(|(_, kept)| !kept));
}

//! A custom stage: also starts from the opposite orientation.

use std::f64::consts::PI;

use hicp_sim::{Household, rng};
use hicp_testkit::{StageLaws, check_stage};
use hicp_tests::perturbed_scene;
use hybrid_icp::core::{
    Isometry3, Model, Point3, Problem, Translation3, UnitQuaternion, UnitVector3, Vector3, se3,
};
use hybrid_icp::icp::{Outcome, Session, Stage, Termination, Verdict};
use hybrid_icp::score::{MeanVsd, Score};
use hybrid_icp::{Preset, Refiner};

// --- The component ---

/// Runs a stage from the initial pose and from that pose rotated by 180°, and returns the better
/// one.
///
/// The axis of rotation passes through the object's center. Detectors confuse the front and the
/// back of cars, boxes and tools.
#[derive(Clone, Copy, Debug)]
struct BothWays<S, C> {
    stage: S,
    score: C,
    /// Axis in the object frame.
    axis: UnitVector3<f64>,
}

impl<S: Stage, C: Score> Stage for BothWays<S, C> {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        let center = problem.model().map_or(Point3::origin(), Model::center);
        let center = Translation3::from(center.coords);
        let turn = UnitQuaternion::from_axis_angle(&self.axis, PI);
        let turned = init * center * turn * center.inverse();
        let straight = self.stage.run(problem, init, session);
        if straight.termination == Termination::Stopped {
            return straight;
        }
        let mut outcomes = [straight, self.stage.run(problem, &turned, session)];
        let iterations = outcomes.iter().map(|outcome| outcome.iterations).sum();
        let mut score = |outcome: &Outcome| {
            let mut context = session.workspace.context(problem);
            self.score.score(&mut context, &outcome.camera_from_object)
        };
        // The rotated pose itself was never evaluated, so it must have been refined.
        let better =
            outcomes[1].verdict == Verdict::Refined && score(&outcomes[1]) < score(&outcomes[0]);
        let stopped = outcomes[1].termination == Termination::Stopped;
        let chosen = &mut outcomes[usize::from(better)];
        chosen.iterations = iterations;
        if stopped {
            chosen.ended_by(Termination::Stopped)
        } else {
            *chosen
        }
    }
}

// --- Its tests ---

fn both_ways() -> BothWays<impl Stage + Send + 'static, MeanVsd> {
    BothWays {
        stage: Preset::Hybrid.build(),
        score: MeanVsd::default(),
        axis: Vector3::y_axis(),
    }
}

#[test]
fn it_keeps_the_laws() {
    check_stage(both_ways, StageLaws::default());
}

#[test]
fn a_car_detected_back_to_front_is_turned_round() {
    let (mut plain_found, mut found, mut kept) = (0, 0, 0);
    for seed in 0..8 {
        let (scene, near) = perturbed_scene(Household::Car, 0.5, &mut rng(seed), (0.004, 0.07));
        let center = Translation3::from(scene.model.center().coords);
        let back = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), PI);
        let detected = near * center * back * center.inverse();
        let angle = |stage: Box<dyn Stage + Send>, init| {
            let refined = Refiner::boxed(stage).refine(&scene.model, &scene.observation, init);
            se3::pose_distance(&refined.outcome.camera_from_object, &scene.truth)
                .0
                .to_degrees()
        };
        plain_found += usize::from(angle(Preset::Hybrid.build(), &detected) < 2.0);
        found += usize::from(angle(Box::new(both_ways()), &detected) < 2.0);
        kept += usize::from(angle(Box::new(both_ways()), &near) < 2.0);
    }
    assert!(
        plain_found == 0 && found >= 6 && kept >= 6,
        "{plain_found}, {found}, {kept} of 8"
    );
}

//! A custom stage: computes a better pose from a pose.
//!
//! `cargo run --release -p hybrid-icp --example 12_own_stage`

use std::error::Error;

use hybrid_icp::Preset;
use hybrid_icp::core::{Isometry3, Problem, Translation3};
use hybrid_icp::icp::{Outcome, Session, Stage, Termination, Verdict};
use hybrid_icp::score::{MeanVsd, Score};

mod scene;

/// Starts another stage from several distances along the viewing ray, and returns the best pose.
///
/// Detectors that use color have their largest errors along this ray.
struct AlongTheRay<S> {
    stage: S,
    offsets_meters: Vec<f64>,
}

impl<S: Stage> Stage for AlongTheRay<S> {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        let mve = |session: &mut Session<'_>, outcome: &Outcome| {
            let mut context = session.context(problem);
            MeanVsd::default().score(&mut context, &outcome.camera_from_object)
        };
        let mut best = self.stage.run(problem, init, session);
        let mut best_mve = mve(session, &best);
        let mut iterations = best.iterations;
        let Some(model) = problem
            .model()
            .filter(|_| best.termination != Termination::Stopped)
        else {
            return best;
        };
        let ray = (init * model.center()).coords.normalize();
        for offset in &self.offsets_meters {
            let start = Translation3::from(ray * *offset) * init;
            let outcome = self.stage.run(problem, &start, session);
            iterations += outcome.iterations;
            if outcome.termination == Termination::Stopped {
                best = best.ended_by(Termination::Stopped); // The observer ends the whole run.
                break;
            }
            // A stage that keeps its start has not evaluated it.
            if outcome.verdict == Verdict::Refined {
                let score = mve(session, &outcome);
                if score < best_mve {
                    (best, best_mve) = (outcome, score);
                }
            }
        }
        best.iterations = iterations;
        best
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut given = scene::Scene::new()?;
    // A detector that is 4 cm off in depth.
    given.detected = Isometry3::translation(0.0, 0.0, 0.04) * given.detected;
    given.refine(AlongTheRay {
        stage: Preset::Hybrid.build(),
        offsets_meters: vec![-0.06, -0.04, -0.02, 0.02, 0.04, 0.06],
    })
}

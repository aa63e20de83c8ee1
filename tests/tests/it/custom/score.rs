//! A custom score: the silhouette against the mask.

use hicp_sim::{Household, rng};
use hicp_testkit::{ScoreLaws, check_score};
use hicp_tests::perturbed_scene;
use hybrid_icp::core::{Context, Isometry3};
use hybrid_icp::icp::{Guard, Verdict, Workspace};
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::Score;
use hybrid_icp::{Preset, Refiner};

// --- The component ---

/// 1 − intersection over union of the rendered silhouette and the mask.
///
/// It is 0 if the silhouette equals the mask and 1 if they do not overlap. It reads no depth, so it
/// also scores glass and shiny metal.
#[derive(Clone, Copy, Debug)]
struct Silhouette;

impl Score for Silhouette {
    fn score(&mut self, context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> f64 {
        let problem = context.problem;
        let (Some(observation), Some(view)) =
            (problem.observation(), context.view(camera_from_object))
        else {
            return 1.0;
        };
        let mask = observation.mask();
        let (mut both, mut union) = (0_u32, mask.n_set() as u32);
        for (u, v) in view.region().pixels() {
            if view.depth_at(u, v) > 0.0 {
                let inside = mask.get(u, v) == Some(true);
                both += u32::from(inside);
                union += u32::from(!inside);
            }
        }
        1.0 - f64::from(both) / f64::from(union.max(1))
    }

    fn name(&self) -> &'static str {
        "silhouette"
    }
}

// --- Its tests ---

#[test]
fn it_keeps_the_laws() {
    let laws = ScoreLaws {
        worst: 1.0,
        ..ScoreLaws::default()
    };
    check_score(|| Silhouette, laws);
}

#[test]
fn as_a_guard_it_lets_pass_what_covers_the_mask_better_and_nothing_else() {
    let (mut passed, mut refused) = (0, 0);
    let mut workspace = Workspace::new(Rasterizer::default());
    for (seed, object) in (0..).zip(Household::ALL) {
        for (translation, angle) in [(0.005, 0.1), (0.08, 1.5)] {
            let (scene, init) = perturbed_scene(object, 0.5, &mut rng(seed), (translation, angle));
            let problem = scene.problem();
            let mut score = |pose| Silhouette.score(&mut workspace.context(&problem), pose);
            let refine = |stage| {
                Refiner::boxed(stage)
                    .refine(&scene.model, &scene.observation, &init)
                    .outcome
            };
            let plain = refine(Preset::NnPointToPoint.build());
            let guarded = refine(Box::new(Guard {
                stage: Preset::NnPointToPoint.build(),
                score: Silhouette,
            }));
            if score(&plain.camera_from_object) < score(&init) {
                passed += 1;
                assert_eq!(guarded, plain);
            } else {
                refused += 1;
                assert_eq!(guarded.camera_from_object, init);
                assert!(matches!(guarded.verdict, Verdict::KeptInitial(_)));
            }
        }
    }
    assert!(
        passed > 3 && refused > 3,
        "{passed} passed, {refused} refused"
    );
}

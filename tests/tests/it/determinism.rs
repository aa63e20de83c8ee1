//! Checks that a pipeline returns the same bits in a second run and from a box.

use hicp_sim::{Household, rng};
use hicp_tests::{Scene, perturbed_scene};
use hybrid_icp::association::{
    AllSamples, DataAssociation, NearestNeighbor, OutlierFilter, PointSelection, Projective,
    VisibleSurface,
};
use hybrid_icp::core::Isometry3;
use hybrid_icp::icp::{Cascade, Convergence, Divergence, Icp, IterationLimit, Repeat, StopRule};
use hybrid_icp::metric::{ErrorMetric, PointToPlane, PointToPoint};
use hybrid_icp::score::{MeanVsd, Score};
use hybrid_icp::switch::{Switch, Switcher, Threshold};
use hybrid_icp::{BoxedStage, Preset, Refinement, Refiner, presets};

fn cases() -> Vec<(Scene, Isometry3<f64>)> {
    let mut rng = rng(11);
    [Household::Mug, Household::Hammer, Household::Carton]
        .into_iter()
        .flat_map(|object| [(object, 0.005, 0.1), (object, 0.07, 1.0)])
        .map(|(object, meters, angle)| perturbed_scene(object, 1.0, &mut rng, (meters, angle)))
        .collect()
}

fn run(refiner: &mut Refiner, cases: &[(Scene, Isometry3<f64>)]) -> Vec<Refinement> {
    cases
        .iter()
        .map(|(scene, init)| refiner.refine(&scene.model, &scene.observation, init))
        .collect()
}

#[test]
fn a_second_run_gives_the_same_bits() {
    let cases = cases();
    for preset in Preset::ALL {
        let mut used = Refiner::preset(preset);
        let first = run(&mut used, &cases);
        assert_eq!(run(&mut used, &cases), first, "{preset}, same refiner");
        assert_eq!(
            run(&mut Refiner::preset(preset), &cases),
            first,
            "{preset}, new refiner"
        );
    }
}

/// Returns Hybrid ICP with every part behind a box.
fn boxed_hybrid() -> BoxedStage {
    type Part<T> = Box<T>;
    fn icp(
        selection: impl PointSelection + Send + 'static,
        association: impl DataAssociation + Send + 'static,
        metric: impl ErrorMetric + Send + 'static,
    ) -> BoxedStage {
        let selection: Part<dyn PointSelection + Send> = Box::new(selection);
        let association: Part<dyn DataAssociation + Send> = Box::new(association);
        let filter: Part<dyn OutlierFilter + Send> = Box::new(());
        let metric: Part<dyn ErrorMetric + Send> = Box::new(metric);
        let stop: Part<dyn StopRule + Send> = Box::new((
            Box::new(Divergence::strict()) as Part<dyn StopRule + Send>,
            Box::new(Convergence::default()) as Part<dyn StopRule + Send>,
            Box::new(IterationLimit::default()) as Part<dyn StopRule + Send>,
        ));
        Box::new(Icp {
            selection,
            association,
            filter,
            metric,
            stop,
        })
    }
    let score: Part<dyn Score + Send> = Box::new(MeanVsd::default());
    let switcher: Part<dyn Switcher + Send> = Box::new(Threshold { score, alpha: 0.4 });
    Box::new(Repeat {
        times: 2,
        stage: Switch {
            switcher,
            aligned: Cascade(vec![
                icp(VisibleSurface::default(), Projective, PointToPoint),
                icp(VisibleSurface::default(), Projective, PointToPlane),
            ]),
            misaligned: icp(AllSamples, NearestNeighbor::default(), PointToPoint),
        },
    })
}

#[test]
fn boxed_parts_give_the_same_bits_as_static_ones() {
    let cases = cases();
    let expected = run(&mut Refiner::boxed(presets::hybrid()), &cases);
    assert_eq!(run(&mut Refiner::boxed(boxed_hybrid()), &cases), expected);
    assert_eq!(run(&mut Refiner::preset(Preset::Hybrid), &cases), expected);
    // The cases must differ, or the comparison proves nothing.
    assert!(expected.iter().any(|r| r.mve < 0.1) && expected.iter().any(|r| r.mve_initial > 0.4));
}

#[test]
fn preset_functions_build_the_presets_of_their_names() {
    let cases = cases();
    let stages: [BoxedStage; Preset::ALL.len()] = [
        Box::new(presets::hybrid()),
        Box::new(presets::projective_point_to_point()),
        Box::new(presets::projective_point_to_plane()),
        Box::new(presets::projective_cascade_point_plane()),
        Box::new(presets::projective_cascade_plane_point()),
        Box::new(presets::nn_point_to_point()),
        Box::new(presets::nn_point_to_plane()),
        Box::new(presets::nn_cascade_point_plane()),
        Box::new(presets::nn_cascade_plane_point()),
        Box::new(presets::hybrid_visible()),
        Box::new(presets::local()),
        Box::new(presets::search()),
        Box::new(presets::auto()),
        Box::new(presets::color()),
    ];
    let mut results = Vec::new();
    for (preset, stage) in Preset::ALL.into_iter().zip(stages) {
        let found = run(&mut Refiner::new(stage), &cases);
        assert_eq!(found, run(&mut Refiner::preset(preset), &cases), "{preset}");
        // `auto` equals `local` if the local pose is good, and `color` equals it without colors.
        let own = !matches!(preset, Preset::Auto | Preset::Color);
        assert!(
            !own || !results.contains(&found),
            "{preset} gives the results of another preset"
        );
        results.push(found);
    }
    // The stages of the presets have the paper's stop rules.
    let by_hand = Icp {
        selection: VisibleSurface::default(),
        association: Projective,
        filter: (),
        metric: PointToPlane,
        stop: presets::paper_stop(),
    };
    assert_eq!(run(&mut Refiner::boxed(by_hand), &cases), results[2]);
}

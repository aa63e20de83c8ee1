//! Checks that a warm run makes no heap allocation, whatever the preset.

use std::collections::BTreeMap;

use hicp_sim::{Household, perturb, rng};
use hicp_tests::allocations::allocations;
use hicp_tests::{perturbed_scene, scene};
use hybrid_icp::core::{Isometry3, Vector3};
use hybrid_icp::fusion::{CameraMotion, FusionMethod};
use hybrid_icp::pipeline::PipelineFile;
use hybrid_icp::pipeline::{Catalog, Part, PartKind};
use hybrid_icp::{Preset, Refiner, SequentialEstimator};

#[test]
fn a_warm_run_allocates_nothing() {
    let mut rng = rng(3);
    let scene = scene(Household::Mug, 1.0, &mut rng);
    // The first start is nearly right and the second far off, so that `hybrid` runs both of its
    // branches. The third is upside down, so that a search finds something better.
    let starts = [
        perturb(&mut rng, &scene.truth, 0.004, 0.08),
        perturb(&mut rng, &scene.truth, 0.08, 0.6),
        scene.truth * Isometry3::rotation(Vector3::x() * std::f64::consts::PI),
    ];
    let mut evaluations = BTreeMap::new();
    for preset in Preset::ALL {
        let mut refiner = Refiner::preset(preset);
        for init in &starts {
            refiner.refine(&scene.model, &scene.observation, init);
        }
        for init in &starts {
            let before = allocations();
            let refined = refiner.refine(&scene.model, &scene.observation, init);
            let count = allocations() - before;
            assert_eq!(count, 0, "{preset}: {refined:?}");
            *evaluations.entry(preset.name()).or_insert(0) += refined.outcome.iterations;
        }
    }
    for global in ["search", "auto"] {
        assert!(
            evaluations[global] > evaluations["local"],
            "{global} never searched"
        );
    }
    counter_works();
}

/// Returns an ICP stage with a part, or `None` if the part is not a component of a stage.
fn stage_with(part: &Part) -> Option<String> {
    let own = match part.name {
        "schedule" => "{ type = \"schedule\", filters = [\"max-distance\", \"trimmed\"] }".to_owned(),
        "joined" => "{ type = \"joined\", associations = [\"rendered-surface\", \"contour\"] }".to_owned(),
        "weighted-sum" => {
            "{ type = \"weighted-sum\", metrics = [\"point-to-plane\", \"point-to-point\"], weights = [1.0, 0.1] }".to_owned()
        }
        "metric-schedule" => {
            "{ type = \"metric-schedule\", metrics = [\"point-to-point\", \"pose-prior\"] }".to_owned()
        }
        "time-limit" => "{ type = \"time-limit\", milliseconds = 1000 }".to_owned(),
        name => format!("\"{name}\""),
    };
    let or = |kind, usual: &str| {
        if part.kind == kind {
            own.clone()
        } else {
            format!("\"{usual}\"")
        }
    };
    let component = matches!(
        part.kind,
        PartKind::Selection
            | PartKind::Association
            | PartKind::Filter
            | PartKind::Metric
            | PartKind::Stop
    );
    component.then(|| {
        format!(
            "type = \"icp\"\nselection = {}\nassociation = {}\nfilter = [{}]\nmetric = {}\nstop = [{}, \"iteration-limit\"]",
            or(PartKind::Selection, "visible-surface"),
            or(PartKind::Association, "nearest-neighbor"),
            or(PartKind::Filter, "max-normal-angle"),
            or(PartKind::Metric, "point-to-plane"),
            or(PartKind::Stop, "divergence"),
        )
    })
}

#[test]
fn every_warm_component_of_the_catalog_allocates_nothing() {
    let (scene, init) = perturbed_scene(Household::Mug, 1.0, &mut rng(5), (0.004, 0.08));
    let mut tried = 0;
    for part in Catalog::built_in().parts() {
        let Some(text) = stage_with(part) else {
            continue;
        };
        let file = PipelineFile::parse(&text, part.name).expect("valid TOML");
        let mut refiner = Refiner::boxed(file.build().expect("a valid pipeline"));
        for _ in 0..2 {
            refiner.refine(&scene.model, &scene.observation, &init);
        }
        let before = allocations();
        refiner.refine(&scene.model, &scene.observation, &init);
        assert_eq!(allocations() - before, 0, "{}", part.name);
        tried += 1;
    }
    assert!(tried > 50, "{tried}");
}

#[test]
fn a_warm_step_of_the_sequential_estimator_allocates_nothing() {
    // A bottle has symmetries, which the estimator also uses.
    let (scene, init) = perturbed_scene(Household::Bottle, 1.0, &mut rng(7), (0.004, 0.08));
    let uncertain = CameraMotion::none()
        .with_covariance(&(hybrid_icp::core::Matrix6::identity() * 1e-8))
        .expect("a covariance");
    for method in FusionMethod::ALL {
        let stage = Preset::Hybrid.build();
        let mut estimator =
            SequentialEstimator::for_object(stage, method, &scene.model, &init).expect("valid");
        let mut steps = |init: &Isometry3<f64>| {
            estimator.restart(init).expect("valid");
            for motion in [CameraMotion::none(), uncertain, CameraMotion::none()] {
                estimator.step(&scene.model, &scene.observation, &motion);
            }
        };
        steps(&init);
        let before = allocations();
        steps(&init);
        assert_eq!(allocations() - before, 0, "{method}");
    }
    counter_works();
}

fn counter_works() {
    let before = allocations();
    std::hint::black_box(vec![1_u8]);
    assert_eq!(allocations() - before, 1);
}

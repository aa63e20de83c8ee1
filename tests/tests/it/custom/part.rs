//! A custom part with a name in pipeline files.

use hicp_sim::{Household, rng};
use hicp_tests::perturbed_scene;
use hybrid_icp::association::{AllSamples, Projective};
use hybrid_icp::core::Pair;
use hybrid_icp::icp::Icp;
use hybrid_icp::metric::{ErrorMetric, NormalEquations};
use hybrid_icp::pipeline::{Catalog, Range};
use hybrid_icp::pipeline::{PipelineFile, PipelineLimits};
use hybrid_icp::{Refiner, presets};

/// Point-to-plane with a gain, such as a program may add.
#[derive(Clone, Debug)]
struct Gained {
    gain: f64,
}

impl ErrorMetric for Gained {
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        let point = pair.source.point.cast::<f64>();
        let normal = pair.target.normal.cast::<f64>().into_inner();
        let residual = normal.dot(&(point - pair.target.point.cast::<f64>()));
        system.add_row(
            &point,
            &normal,
            self.gain * residual,
            f64::from(pair.weight),
        );
    }
}

#[test]
fn a_program_can_add_its_own_parts_under_a_name() {
    let mut catalog = Catalog::built_in().clone();
    catalog.add_metric("gained", |p| {
        p.about = "Minimizes point-to-plane distances times a gain. Cost: O(n).";
        let gain = p.number("gain", Range::new(0.5, 2.0, "m"), 1.0, "the gain")?;
        Ok(Gained { gain })
    });
    let text = |metric: &str| {
        format!(
            "type = \"icp\"\nselection = \"all-samples\"\nassociation = \"projective\"\nmetric = {metric}\n"
        )
    };
    let build = |metric: &str, catalog: &Catalog| {
        let file = PipelineFile::parse(&text(metric), "mine.toml").unwrap();
        file.build_from(catalog, &PipelineLimits::DEFAULT)
            .map(Refiner::new)
    };
    let message = |metric: &str| build(metric, &catalog).map(|_| ()).unwrap_err().to_string();

    let (scene, init) = perturbed_scene(Household::Mug, 0.5, &mut rng(8), (0.003, 0.05));
    for (metric, gain) in [
        ("\"gained\"", 1.0),
        ("{ type = \"gained\", gain = 1.5 }", 1.5),
    ] {
        let mut refiner = build(metric, &catalog).unwrap();
        let found = refiner.refine(&scene.model, &scene.observation, &init);
        let stage = Icp {
            selection: AllSamples,
            association: Projective,
            filter: (),
            metric: Gained { gain },
            stop: presets::paper_stop(),
        };
        let expected = Refiner::new(stage).refine(&scene.model, &scene.observation, &init);
        assert_eq!(found, expected);
    }
    // It is accepted wherever a metric is, with the same error messages.
    assert!(build("{ type = \"robust\", metric = \"gained\" }", &catalog).is_ok());
    for (metric, wanted) in [
        (
            "{ type = \"gained\", gain = 3 }",
            "mine.toml:4: metric.gain: found 3, expected a number from 0.5 to 2",
        ),
        (
            "{ type = \"gained\", gian = 1 }",
            "mine.toml:4: metric.gian: gained has no such field; did you mean \"gain\"?",
        ),
        (
            "\"gianed\"",
            "mine.toml:4: metric: no metric is named \"gianed\"; did you mean \"gained\"?",
        ),
    ] {
        assert!(message(metric).starts_with(wanted), "{}", message(metric));
    }
    assert!(build("\"gained\"", Catalog::built_in()).is_err());
    assert!(catalog.page().contains(
        "### gained (`Gained`)\n\nMinimizes point-to-plane distances times a gain. Cost: O(n).\n"
    ));
    assert!(
        catalog
            .page()
            .contains("| `gain` | a number from 0.5 to 2; m | 1 | the gain |")
    );
}

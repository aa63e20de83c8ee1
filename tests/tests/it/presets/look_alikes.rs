//! The poses at which a model looks the same.

use hicp_sim::{Household, rng};
use hicp_tests::scene;
use hybrid_icp::core::{Model, ModelConfig};
use hybrid_icp::{Preset, Refiner};

/// A carton has three half turns, and the image shows none of them.
#[test]
fn every_twin_of_a_carton_counts_however_its_surface_is_sampled() {
    for seed in 1..4 {
        let scene = scene(Household::Carton, 0.0, &mut rng(seed));
        for samples in [500, 1000, 2000] {
            let config = ModelConfig {
                samples,
                ..ModelConfig::default()
            };
            let undeclared = Model::with_config(scene.model.mesh().clone(), config);
            let mut refiner = Refiner::preset(Preset::Auto);
            let judged = refiner.judge(&undeclared, &scene.observation, &scene.truth);
            let twins = judged.look_alikes;
            assert!((twins - 3.0).abs() < 0.1, "{seed}, {samples}: {twins}");
        }
    }
}

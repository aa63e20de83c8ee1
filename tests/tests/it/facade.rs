//! Everything public below the façade is reachable through it.

use std::path::Path;

use hybrid_icp::core::Quaternion;
use hybrid_icp::nalgebra::Quaternion as ThroughNalgebra;
use hybrid_icp::raster::{Culling, RasterConfig};

/// A crate is re-exported as a whole, so no name of it can be missing; this test finds a crate that is not.
#[test]
fn every_library_below_is_a_module_of_the_facade() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/hybrid-icp");
    let manifest = std::fs::read_to_string(root.join("Cargo.toml")).unwrap();
    let source = std::fs::read_to_string(root.join("src/lib.rs")).unwrap();
    let dependencies = manifest.split("[dependencies]").nth(1).unwrap();
    let dependencies = dependencies.split("\n[").next().unwrap();
    let mut n_crates = 0;
    for line in dependencies.lines() {
        let Some(module) = line.strip_prefix("hicp-") else {
            continue;
        };
        let module = module.split(['.', ' ']).next().unwrap();
        let export = format!("pub use hicp_{module} as {module};");
        assert!(source.contains(&export), "{export} is missing");
        n_crates += 1;
    }
    assert_eq!(
        n_crates, 9,
        "core, association, metric, score, fusion, icp, switch, raster, pipeline"
    );
}

/// A ROS pose is x, y, z, w; a renderer has a configuration: both were out of reach of the façade's names once.
#[test]
fn a_quaternion_and_the_configuration_of_the_rasterizer_are_within_reach() {
    let (w, x, y, z) = (0.5, 0.5, -0.5, 0.5);
    let quaternion: ThroughNalgebra<f64> = Quaternion::new(w, x, y, z);
    assert_eq!(quaternion.w, w);
    let config = RasterConfig {
        culling: Culling::Auto,
        ..RasterConfig::default()
    };
    let _ = hybrid_icp::raster::Rasterizer::new(config);
}

//! Checks that everything public in the lower crates is reachable through the facade.

use std::path::Path;

use hybrid_icp::core::Quaternion;
use hybrid_icp::nalgebra::Quaternion as ThroughNalgebra;
use hybrid_icp::raster::{Culling, RasterConfig};

/// Each crate is re-exported as a whole, so no name in it can be missing. This test finds a missing
/// crate.
#[test]
fn every_lower_crate_is_a_module_of_the_facade() {
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

/// Quaternions (for ROS poses) and configurations of renderers were once missing from the facade.
#[test]
fn the_facade_reaches_quaternions_and_the_rasterizer_configuration() {
    let (w, x, y, z) = (0.5, 0.5, -0.5, 0.5);
    let quaternion: ThroughNalgebra<f64> = Quaternion::new(w, x, y, z);
    assert_eq!(quaternion.w, w);
    let config = RasterConfig {
        culling: Culling::Auto,
        ..RasterConfig::default()
    };
    let _ = hybrid_icp::raster::Rasterizer::new(config);
}

//! Serialization of cameras, configurations and results as JSON, with the feature `serde`.

use hicp_sim::{Household, rng};
use hicp_tests::scene;
use hybrid_icp::core::{
    Isometry3, ModelConfig, PinholeCamera, Point3, Symmetries, SymmetryAxis, Vector3,
};
use hybrid_icp::{Calibration, Preset, Refiner, SequentialConfig, Trace};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Asserts that a value is equal after a round trip through JSON.
fn round_trip<T: Serialize + DeserializeOwned + PartialEq + std::fmt::Debug>(value: &T) {
    let text = serde_json::to_string(value).unwrap();
    assert_eq!(&serde_json::from_str::<T>(&text).unwrap(), value, "{text}");
}

#[test]
fn cameras_and_configurations_round_trip_through_json() {
    round_trip(&PinholeCamera::new(600.5, 601.0, 319.5, 239.5, 640, 480).unwrap());
    round_trip(&ModelConfig {
        diameter: Some(0.1),
        symmetries: Symmetries {
            discrete: vec![Isometry3::translation(0.0, 0.1, 0.0)],
            continuous: vec![SymmetryAxis::new(Vector3::z(), Point3::origin()).unwrap()],
        },
        ..ModelConfig::default()
    });
    round_trip(&SequentialConfig::default());
    round_trip(&Calibration::HYBRID);
}

#[test]
fn impossible_cameras_and_axes_are_refused() {
    let camera = r#"{"fx":0,"fy":1,"cx":1,"cy":1,"width":2,"height":2}"#;
    let error = serde_json::from_str::<PinholeCamera>(camera).unwrap_err();
    assert!(
        error.to_string().contains("focal length fx is 0"),
        "{error}"
    );
    let axis = r#"{"direction":[0,0,0],"offset":[0,0,0]}"#;
    let error = serde_json::from_str::<SymmetryAxis>(axis).unwrap_err();
    assert!(error.to_string().contains("no direction"), "{error}");
}

#[test]
fn results_are_serialized_with_their_names_and_numbers() {
    let scene = scene(Household::Mug, 0.5, &mut rng(31));
    let mut trace = Trace::default();
    let mut refiner = Refiner::new(Preset::Hybrid.build());
    let result =
        refiner.refine_observed(&scene.model, &scene.observation, &scene.truth, &mut trace);
    let json = serde_json::to_value(result).unwrap();
    assert_eq!(json["mve"], result.mve);
    assert_eq!(json["evidence"]["agrees"], result.evidence.agrees);
    round_trip(&result.evidence);
    // The list of names follows the fields.
    let fields = json["evidence"].as_object().unwrap();
    assert_eq!(fields.len(), result.evidence.named().len());
    for (name, value) in result.evidence.named() {
        assert_eq!(fields[name].as_f64(), Some(value), "{name}");
    }
    assert_eq!(
        json["outcome"]["termination"],
        result.outcome.termination.name()
    );
    let information = result.outcome.quality.unwrap().information().unwrap();
    let written = &json["outcome"]["quality"]["information"];
    assert_eq!(*written, serde_json::to_value(information).unwrap());
    let stages = &serde_json::to_value(&trace).unwrap()["stages"];
    assert_eq!(stages[0]["association"], trace.stages[0].association);
}

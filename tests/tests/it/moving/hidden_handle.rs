//! A mug whose handle is hidden: nothing else shows its rotation.

use std::sync::Arc;

use hicp_sim::{Household, RelativeGaussian, rng};
use hybrid_icp::core::{
    Isometry3, Observation, PinholeCamera, Translation3, UnitQuaternion, Vector3, se3,
};
use hybrid_icp::fusion::{CameraMotion, FusionMethod};
use hybrid_icp::score::mssd;
use hybrid_icp::{Calibration, Preset, SequentialEstimator, TrackState, Tracker, TrackerConfig};

pub(super) const SECONDS: f64 = 1.0 / 30.0;

pub(super) fn camera() -> PinholeCamera {
    PinholeCamera::new(285.0, 285.0, 159.5, 119.5, 320, 240).unwrap()
}

/// Returns the rotation at which the handle, on the axis x of the object, points away from the
/// camera.
pub(super) fn handle_behind() -> UnitQuaternion<f64> {
    UnitQuaternion::from_basis_unchecked(&[Vector3::z(), -Vector3::x(), -Vector3::y()])
}

/// Returns a pose with that rotation, seen from above by a tilt in radians.
fn mug(tilt: f64) -> Isometry3<f64> {
    let tilted = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), tilt);
    Isometry3::from_parts(Translation3::new(0.0, 0.0, 0.6), tilted * handle_behind())
}

/// Returns a rotation around the axis of the mug.
fn turned(angle: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle)
}

#[test]
fn a_mug_that_turns_with_its_handle_behind_is_doubtful() {
    let model = Household::Mug.model().unwrap();
    let pose = |degrees: f64| mug(0.0) * turned(degrees.to_radians());
    let points: Vec<_> = model.samples().iter().map(|s| s.point).collect();
    let mut tracker = Tracker::new(model.clone(), camera(), TrackerConfig::default());
    tracker.start(&pose(-30.0));
    let mut states = Vec::new();
    for frame in 0..21 {
        let truth = pose(3.0 * f64::from(frame) - 30.0);
        let (depth, _) = hicp_tests::render(&model, &camera(), &truth);
        let tracked = tracker.step(depth, SECONDS, None).unwrap();
        let off = mssd(&tracked.camera_from_object, &truth, &points, &[]) / model.diameter();
        let sure = tracked.state == TrackState::Tracking;
        assert!(!sure || off < 0.1, "{frame}: {off}");
        states.push(tracked.state);
    }
    assert_eq!(states[20], TrackState::Doubtful);
}

/// Images that do not show the handle must not add up to a known rotation.
#[test]
fn a_slow_mug_that_hides_its_handle_stays_doubtful() {
    let model = Household::Mug.model().unwrap();
    let truth = mug(0.0);
    let config = TrackerConfig {
        meters_per_second: 0.02,
        degrees_per_second: 1.0,
        ..TrackerConfig::default()
    };
    let mut tracker = Tracker::new(model.clone(), camera(), config);
    tracker.start(&(truth * turned(0.4)));
    let depth = Arc::new(hicp_tests::render(&model, &camera(), &truth).0);
    for frame in 0..300 {
        let tracked = tracker.step(Arc::clone(&depth), SECONDS, None).unwrap();
        let deviation = tracked.deviation_meters / model.diameter();
        let place = format!("{frame}: {deviation} d");
        assert_eq!(tracked.state, TrackState::Doubtful, "{place}");
    }
}

/// The local registration does not find the handle, because it is far from that of the pose.
#[test]
fn a_handle_that_comes_into_view_ends_the_doubt() {
    let model = Household::Mug.model().unwrap();
    let pose = |angle| mug(0.4) * turned(angle);
    for direction in [-1.0, 1.0] {
        let mut tracker = Tracker::new(model.clone(), camera(), TrackerConfig::default());
        tracker.start(&pose(-0.6 * direction));
        for frame in 0..75 {
            let truth = pose(direction * 0.03 * f64::from(frame));
            let depth = hicp_tests::render(&model, &camera(), &truth).0;
            let tracked = tracker.step(depth, SECONDS, None).unwrap();
            let off = se3::pose_distance(&tracked.camera_from_object, &truth).0;
            let expected = if off < 0.1 {
                TrackState::Tracking
            } else {
                TrackState::Doubtful
            };
            assert_eq!(tracked.state, expected, "{frame}: {off}");
            assert!(off < 0.1 || frame < 50, "{frame}: {off}");
        }
    }
}

/// Images that hide the handle must not add up to a known rotation. The first one with it does.
#[test]
fn a_sequence_that_hides_the_handle_states_an_unknown_rotation() {
    let model = Household::Mug.model().unwrap();
    let camera = hicp_tests::camera();
    let hidden = mug(0.0);
    let visible = hidden * turned(1.3);
    for preset in [
        Preset::Hybrid,
        Preset::HybridVisible,
        Preset::ProjectiveCascadePlanePoint,
        Preset::Local,
    ] {
        let (method, calibration) = (FusionMethod::WeightedAverage, Calibration::of(preset));
        let init = hidden * turned(0.4);
        let mut estimator =
            SequentialEstimator::calibrated(preset.build(), method, &calibration, &model, &init)
                .unwrap();
        let mut step = |truth: &Isometry3<f64>, seed, motion: &CameraMotion| {
            let (depth, mask) = hicp_tests::render(&model, &camera, truth);
            let depth = RelativeGaussian { percent: 0.5 }.apply(&mut rng(seed), &depth);
            let observation = Observation::new(depth, mask, camera).unwrap();
            let step = estimator.step(&model, &observation, motion);
            let stated = estimator.estimate().unwrap();
            assert_eq!(step.covariance, Some(*stated.covariance()));
            let rotations = stated.covariance().fixed_view::<3, 3>(3, 3);
            let axis = step.camera_from_object.rotation * Vector3::z();
            let error = se3::pose_distance(&step.camera_from_object, truth).0;
            (axis.dot(&(rotations * axis)).sqrt(), error)
        };
        for seed in 0..20 {
            let (deviation, _) = step(&hidden, seed, &CameraMotion::none());
            assert!(
                (1.0..1.6).contains(&deviation),
                "{preset} {seed}: {deviation}"
            );
        }
        let mut motion = CameraMotion::new(visible * hidden.inverse()).unwrap();
        for seed in 0..3 {
            let (deviation, error) = step(&visible, seed, &motion);
            // `hybrid-visible` is lost by then.
            let known = deviation < 0.03 || preset == Preset::HybridVisible;
            assert!(
                known && error < 3.0 * deviation,
                "{preset} {seed}: {deviation}, {error}"
            );
            motion = CameraMotion::none();
        }
    }
}

//! The tracker on simulated sequences.

use std::sync::Arc;

use hicp_io::bop::Dataset;
use hicp_sim::{DepthSensor, Hand, Household, MovingConfig, MovingScene, stream};
use hicp_tests::tabletop::Tabletop;
use hicp_tests::ycbv;
use hybrid_icp::core::{
    DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, Point3, Translation3, TriMesh,
    UnitQuaternion, Vector3, se3, so3,
};
use hybrid_icp::score::ModelPoints;
use hybrid_icp::{Preset, Refiner, TrackState, Tracked, Tracker, TrackerConfig};

use super::hidden_handle::{SECONDS, camera, handle_behind};

struct Sequence {
    model: Model,
    scene: MovingScene,
    depths: Vec<Arc<DepthImage>>,
}

fn sequence(object: Household, hand: Hand, frames: usize) -> Sequence {
    let models = [object.model().unwrap(), Household::Carton.model().unwrap()];
    let mut rng = stream(4, &["tracker", object.name()], 0);
    let config = MovingConfig {
        frames,
        hand,
        standing: 1,
        ..MovingConfig::default()
    };
    let scene = MovingScene::draw(&mut rng, &models, 0, &config).unwrap();
    let mut image = |frame| {
        let sensor = DepthSensor::default();
        let view = scene.view(&mut rng, frame, &models, &camera(), &sensor);
        Arc::new(view.unwrap().depth)
    };
    Sequence {
        depths: (0..frames).map(&mut image).collect(),
        model: models[0].clone(),
        scene,
    }
}

impl Sequence {
    fn track(&self) -> Vec<Tracked> {
        self.track_every(SECONDS)
    }

    /// Tracks the object with a time between two images, which may be wrong.
    fn track_every(&self, seconds: f64) -> Vec<Tracked> {
        let mut tracker = Tracker::new(self.model.clone(), camera(), TrackerConfig::default());
        tracker.start(&self.scene.poses[0]);
        let depths = self.depths.iter();
        depths
            .map(|depth| tracker.step(Arc::clone(depth), seconds, None).unwrap())
            .collect()
    }

    /// Returns the distance of the object's center from the truth in diameters, and the angle.
    fn errors(&self, frame: usize, tracked: &Tracked) -> (f64, f64) {
        let truth = self.scene.poses[frame];
        let center = self.model.center();
        let away = tracked.camera_from_object * center - truth * center;
        let (angle, _) = se3::pose_distance(&tracked.camera_from_object, &truth);
        (away.norm() / self.model.diameter(), angle.to_degrees())
    }
}

#[test]
fn a_moving_object_is_tracked_without_masks() {
    let sequence = sequence(Household::Teapot, Hand::Absent, 40);
    let tracked = sequence.track();
    for (frame, tracked) in tracked.iter().enumerate() {
        let (shift, angle) = sequence.errors(frame, tracked);
        assert_eq!(tracked.state, TrackState::Tracking, "{frame}");
        assert!(shift < 0.03 && angle < 5.0, "{frame}: {shift} {angle}");
    }
    let poses = &sequence.scene.poses;
    let center = sequence.model.center();
    let moved = (poses[39] * center - poses[0] * center).norm();
    assert!(moved > 0.04, "{moved}");
    let [mut speeds, mut errors] = [[0.0; 2]; 2];
    for frame in 10..39 {
        let [before, now] = [poses[frame - 1], poses[frame]];
        let shift = (now * center - before * center) / SECONDS;
        let turn = so3::log(&(now.rotation * before.rotation.inverse())) / SECONDS;
        let tracked = &tracked[frame];
        speeds[0] += shift.norm();
        speeds[1] += turn.norm();
        errors[0] += (shift - tracked.meters_per_second).norm();
        errors[1] += (turn - tracked.radians_per_second).norm();
        assert!(tracked.confidence > 0.7, "{frame}");
    }
    let [shift, turn] = [0, 1].map(|k| errors[k] / speeds[k]);
    assert!(shift < 0.1 && turn < 0.1, "{shift} {turn}");
    assert_eq!(tracked, sequence.track());
}

/// Duplicate time stamps, or a wrong unit: a filter of constant velocity lags behind the object.
#[test]
fn the_evidence_belongs_to_the_pose_even_if_the_time_is_wrong() {
    let sequence = sequence(Household::Teapot, Hand::Absent, 20);
    let mut refiner = Refiner::preset(Preset::Hybrid);
    for seconds in [0.0, 1e-4, 1e-3, 0.1 * SECONDS, 10.0 * SECONDS] {
        for (frame, tracked) in sequence.track_every(seconds).iter().enumerate() {
            let (shift, angle) = sequence.errors(frame, tracked);
            let pose = &tracked.camera_from_object;
            let (_, silhouette) = hicp_tests::render(&sequence.model, &camera(), pose);
            let depth = Arc::clone(&sequence.depths[frame]);
            let observation = Observation::new(depth, silhouette, camera()).unwrap();
            let confidence = refiner
                .judge(&sequence.model, &observation, pose)
                .confidence;
            let place = format!("{seconds} s, frame {frame}: {shift} d, {angle}°, {confidence}");
            assert_eq!(tracked.state, TrackState::Tracking, "{place}");
            assert!(shift < 0.03 && angle < 10.0 && confidence > 0.8, "{place}");
        }
    }
}

#[test]
fn times_before_the_previous_image_are_refused() {
    let sequence = sequence(Household::Teapot, Hand::Absent, 1);
    let mut tracker = Tracker::new(sequence.model, camera(), TrackerConfig::default());
    for seconds in [-SECONDS, f64::NAN, f64::INFINITY] {
        let error = tracker
            .step(Arc::clone(&sequence.depths[0]), seconds, None)
            .unwrap_err();
        let text = format!("seconds is {seconds}, expected the seconds since the previous image");
        assert!(error.to_string().starts_with(&text), "{error}");
    }
}

#[test]
fn a_hidden_object_is_lost_and_found_again() {
    let sequence = sequence(Household::Teapot, Hand::Covering(1.0..1.1), 80);
    let tracked = sequence.track();
    let hidden = sequence.scene.hidden.clone();
    for found in &tracked[hidden.clone()] {
        assert_ne!(found.state, TrackState::Tracking);
    }
    assert_eq!(tracked[hidden.end - 1].state, TrackState::Lost);
    // The hand leaves within nine frames.
    for (frame, found) in tracked.iter().enumerate().skip(hidden.end + 10) {
        let (shift, angle) = sequence.errors(frame, found);
        assert_eq!(found.state, TrackState::Tracking, "{frame}");
        assert!(shift < 0.03 && angle < 5.0, "{frame}: {shift} {angle}");
    }
}

/// The guess for a lost object starts from the pose that was followed last.
#[test]
fn an_object_that_was_found_and_followed_is_not_guessed_where_it_was_lost_before() {
    let model = Household::Mug.model().unwrap();
    let pose = |x| Isometry3::from_parts(Translation3::new(x, 0.0, 0.7), handle_behind());
    let nothing = Arc::new(DepthImage::from_meters(320, 240, vec![0.0; 320 * 240]).unwrap());
    let mut tracker = Tracker::new(model.clone(), camera(), TrackerConfig::default());
    tracker.start(&pose(-0.15));
    for frame in 0..90 {
        // The handle is hidden, so the mug stays doubtful after it was found.
        let x = -0.15 + 0.004 * f64::from((frame - 15).clamp(0, 70));
        let depth = match frame {
            3..15 | 85.. => Arc::clone(&nothing),
            _ => Arc::new(hicp_tests::render(&model, &camera(), &pose(x)).0),
        };
        let tracked = tracker.step(depth, SECONDS, None).unwrap();
        let expected = match frame {
            6..15 | 88.. => TrackState::Lost,
            _ => TrackState::Doubtful,
        };
        assert_eq!(tracked.state, expected, "{frame}");
        let away = tracked.camera_from_object.translation.x - x;
        assert!(away.abs() < 0.03, "{frame}: {away}");
    }
}

#[test]
fn an_object_that_shows_a_flat_side_is_followed() {
    let corners = [
        [0.0, 0.0, 0.0],
        [0.1, 0.0, 0.0],
        [0.0, 0.08, 0.0],
        [0.0, 0.0, 0.06],
    ];
    let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let mesh = TriMesh::new(corners.map(Point3::from).to_vec(), triangles).unwrap();
    let model = Model::new(mesh);
    let pose = |x| Isometry3::translation(x, 0.0, 0.5);
    let mut tracker = Tracker::new(model.clone(), camera(), TrackerConfig::default());
    tracker.start(&pose(0.0));
    for frame in 1..4 {
        let truth = pose(0.004 * f64::from(frame));
        let (depth, _) = hicp_tests::render(&model, &camera(), &truth);
        let wall = |z: &f32| if *z > 0.0 { *z } else { 0.8 };
        let depths = depth.pixels().iter().map(wall).collect();
        let depth = DepthImage::from_meters(320, 240, depths).unwrap();
        let tracked = tracker.step(depth, SECONDS, None).unwrap();
        let (angle, distance) = se3::pose_distance(&tracked.camera_from_object, &truth);
        assert!(
            distance < 0.003 && angle < 0.01,
            "{frame}: {distance} {angle}"
        );
    }
}

#[test]
fn images_without_the_object_and_starts_that_are_not_finite_are_never_tracked() {
    let model = Household::Mug.model().unwrap();
    let empty = Arc::new(DepthImage::from_meters(320, 240, vec![0.0; 320 * 240]).unwrap());
    let wall = Arc::new(DepthImage::from_meters(320, 240, vec![0.7; 320 * 240]).unwrap());
    let nothing = Mask::new(320, 240, vec![false; 320 * 240]).unwrap();
    for (start, depth, mask) in [
        (Isometry3::translation(0.0, 0.0, 0.7), &empty, None),
        (Isometry3::translation(0.0, 0.0, 0.7), &wall, None),
        (Isometry3::translation(0.0, 0.0, 0.7), &wall, Some(&nothing)),
        (Isometry3::translation(0.0, 0.0, -0.7), &wall, None),
        (Isometry3::translation(1e9, 0.0, 1e9), &wall, None),
        (Isometry3::translation(f64::NAN, 0.0, 0.7), &wall, None),
    ] {
        for value in [SECONDS, 0.0, 1e9, -1.0, f64::NAN] {
            // The times that `step` accepts.
            let seconds = if value >= 0.0 { value } else { SECONDS };
            let config = TrackerConfig {
                meters_per_second: value,
                memory_seconds: value,
                ..TrackerConfig::default()
            };
            for config in [config, TrackerConfig::default()] {
                let mut tracker = Tracker::new(model.clone(), camera(), config);
                tracker.start(&start);
                for _ in 0..4 {
                    let tracked = tracker.step(Arc::clone(depth), seconds, mask).unwrap();
                    assert_ne!(tracked.state, TrackState::Tracking, "{start:?} {value}");
                    assert!(se3::is_finite(&tracked.camera_from_object));
                    assert!(tracked.meters_per_second.norm().is_finite());
                }
            }
        }
    }
}

/// Counts the states of objects that stand still: tracked, doubtful and lost, and those that are
/// tracked at a wrong pose.
#[derive(Debug, Default)]
struct Standing {
    states: [usize; 3],
    wrong: usize,
}

impl Standing {
    fn track(
        &mut self,
        model: &Arc<Model>,
        (depth, camera): (&Arc<DepthImage>, PinholeCamera),
        truth: &Isometry3<f64>,
        start: &Isometry3<f64>,
        seconds: f64,
    ) {
        let mut tracker = Tracker::new(Arc::clone(model), camera, TrackerConfig::default());
        tracker.start(start);
        let steps = (0..6).map(|_| tracker.step(Arc::clone(depth), seconds, None).unwrap());
        let last = steps.last().unwrap();
        let off = ModelPoints::new(model).mssd(&last.camera_from_object, truth);
        let tracking = last.state == TrackState::Tracking;
        self.wrong += usize::from(tracking && off > 0.1 * model.diameter());
        self.states[match last.state {
            TrackState::Tracking => 0,
            TrackState::Doubtful => 1,
            TrackState::Lost => 2,
        }] += 1;
    }
}

#[test]
fn an_object_among_others_on_a_table_is_followed() {
    let tabletop = Tabletop::new(&Household::TUNING).unwrap();
    // At two images per second, the object might be anywhere near, and only sure poses count.
    for (seconds, most_lost) in [(SECONDS, 1), (0.5, 4)] {
        let mut standing = Standing::default();
        for (seed, distorted) in [(0, false), (4, false), (5, true), (12, true)] {
            let scene = match distorted {
                true => tabletop.distorted_scene(seed).unwrap(),
                false => tabletop.scene(seed).unwrap(),
            };
            for (index, seen) in (0..).zip(scene) {
                let model = Arc::new(tabletop.objects[seen.model].1.clone());
                let start = seen.near(&mut stream(seed, &["standing"], index), 1.0);
                let image = (&seen.depth, seen.camera);
                standing.track(&model, image, &seen.truth, &start, seconds);
            }
        }
        let [tracked, doubtful, lost] = standing.states;
        assert!(lost <= most_lost && tracked > 2 * doubtful, "{standing:?}");
        assert_eq!(standing.wrong, 0, "{standing:?}");
    }
}

/// A search does not separate it from the table, whose surface it continues.
#[test]
fn an_object_on_a_table_is_found_again_where_it_was_hidden() {
    let tabletop = Tabletop::new(&Household::TUNING).unwrap();
    let (mut hidden, mut found) = (0, 0);
    for seen in [0, 4]
        .into_iter()
        .flat_map(|seed| tabletop.scene(seed).unwrap())
    {
        let model = tabletop.objects[seen.model].1.clone();
        let near = 0.5 * seen.truth.translation.z as f32;
        let (width, height) = seen.depth.size();
        let covered = DepthImage::collect(width, height, seen.depth.pixels().iter().map(|_| near));
        let covered = Arc::new(covered.unwrap());
        let mut tracker = Tracker::new(model.clone(), seen.camera, TrackerConfig::default());
        tracker.start(&seen.truth);
        let mut steps = |depth: &Arc<DepthImage>, count: usize| {
            let steps = (0..count).map(|_| tracker.step(Arc::clone(depth), SECONDS, None).unwrap());
            steps.last().unwrap()
        };
        if steps(&seen.depth, 5).state != TrackState::Tracking {
            continue;
        }
        hidden += 1;
        assert_eq!(steps(&covered, 45).state, TrackState::Lost);
        let last = steps(&seen.depth, 3);
        let off = ModelPoints::new(&model).mssd(&last.camera_from_object, &seen.truth);
        let right = off < 0.1 * model.diameter();
        found += usize::from(right && last.state == TrackState::Tracking);
    }
    assert!(hidden > 5 && found + 1 >= hidden, "{found} of {hidden}");
}

/// A hand that touches the object continues its surface, and hides a part of it.
#[test]
fn an_object_in_a_hand_is_not_lost() {
    for (object, grip) in [
        (Household::Bracket, Vector3::new(0.6, 0.1, 0.0)),
        (Household::Car, Vector3::new(0.3, 0.4, 0.0)),
    ] {
        let model = object.model().unwrap();
        let (center, radius) = (model.center().coords, model.radius());
        let fist = Household::Carton.model().unwrap();
        let grip = center + radius * grip - fist.center().coords;
        let mut tracker = Tracker::new(model.clone(), camera(), TrackerConfig::default());
        for frame in 0..30 {
            let time = f64::from(frame) * SECONDS;
            let rotation = UnitQuaternion::from_euler_angles(0.4, 0.8 * time, 0.5 * time);
            let truth =
                Isometry3::from_parts(Translation3::new(0.15 * time - 0.05, 0.0, 0.6), rotation);
            if frame == 0 {
                tracker.start(&truth);
            }
            let held = hicp_tests::render(&model, &camera(), &truth).0;
            let hand = truth * Translation3::from(grip);
            let hand = hicp_tests::render(&fist, &camera(), &hand).0;
            let nearest = held.pixels().iter().zip(hand.pixels());
            let nearest = nearest.map(|(a, b)| match (*a > 0.0, *b > 0.0) {
                (true, true) => a.min(*b),
                _ => a.max(*b),
            });
            let depth = DepthImage::collect(320, 240, nearest).unwrap();
            let tracked = tracker.step(depth, SECONDS, None).unwrap();
            let off = ModelPoints::new(&model).mssd(&tracked.camera_from_object, &truth);
            let place = format!("{} {frame}: {off} m", object.name());
            assert_ne!(tracked.state, TrackState::Lost, "{place}");
            assert!(off < 0.1 * model.diameter(), "{place}");
        }
    }
}

/// The edges of real sensors are not measured, or off by pixels, and a table and other objects are
/// always near.
#[test]
fn an_object_in_a_real_image_is_followed() {
    let Some(root) = ycbv::root() else {
        println!("no ycbv dataset; set BOP_PATH to its folder");
        return;
    };
    let mut standing = Standing::default();
    for instance in ycbv::instances(&Dataset::open(root).unwrap()) {
        let (truth, observation) = (&instance.truth, instance.observe());
        let image = (observation.shared_depth(), *observation.camera());
        standing.track(&instance.model, image, truth, truth, SECONDS);
    }
    let [tracked, _, lost] = standing.states;
    assert!(tracked >= 8 && lost <= 2, "{standing:?}");
    assert_eq!(standing.wrong, 0, "{standing:?}");
}

#[test]
fn images_of_another_size_are_refused() {
    let model = Household::Mug.model().unwrap();
    let mut tracker = Tracker::new(model, camera(), TrackerConfig::default());
    let small = Arc::new(DepthImage::from_meters(8, 8, vec![0.7; 64]).unwrap());
    tracker.start(&Isometry3::translation(0.0, 0.0, 0.7));
    let error = tracker.step(small, SECONDS, None).unwrap_err();
    assert!(error.to_string().contains("8x8"), "{error}");
}

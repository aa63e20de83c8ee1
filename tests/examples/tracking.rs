//! Measures the tracker on simulated sequences of moving objects, with noise of 0 to 3 % of the
//! depth and hands that pass in front.
//!
//! `cargo run --release -p hicp-tests --example tracking -- [tuning|mugs] [still] [SEQUENCES]
//! [trace]`
//!
//! - `tuning`: the tuning objects instead of the test objects.
//! - `mugs`: two public mugs and a pitcher, of the shared data.
//! - `still`: instead of moving objects, those that stand among others on a table, in twelve equal
//!   images: simulated ones with noise of 0 to 3 %, with the systematic errors of a sensor, and on
//!   the real frames. With `tuning`, the tuning objects.
//! - `SEQUENCES`: their number, 200 if not given. Every third has no hand, a passing one, and one
//!   that hides the object for 1 to 3 s.
//! - `trace`: one line per frame.

use std::sync::Arc;
use std::time::Instant;

use hicp_io::bop::Dataset;
use hicp_sim::{
    ClutterView, DepthNoise, DepthSensor, Hand, MovingConfig, MovingScene, RelativeGaussian,
    Trajectory, perturb, stream,
};
use hicp_tests::household;
use hicp_tests::mugs::public_mugs;
use hicp_tests::tabletop::Tabletop;
use hicp_tests::ycbv;
use hybrid_icp::core::{DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, Point3};
use hybrid_icp::score::{ModelPoints, mssd};
use hybrid_icp::{Preset, Refiner, TrackState, Tracked, Tracker, TrackerConfig};
use rand::RngExt;

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Share of the object that is visible when it has reappeared.
const REAPPEARED: f64 = 0.5;
/// Number of frames in which an object that reappeared has to be found.
const FRAMES_TO_FIND: usize = 3;
/// Noise below and above which sequences are counted apart, percent.
const NOISE_PERCENT: f64 = 1.0;
/// Number of equal images of an object that stands still.
const STILL_FRAMES: usize = 12;

/// The counts of one kind of sequence.
#[derive(Default)]
struct Counts {
    frames: usize,
    lost: usize,
    tracking: usize,
    wrong: usize,
    reappeared: usize,
    found: usize,
    tracker_ms: Vec<f64>,
    lost_ms: Vec<f64>,
    hybrid_ms: Vec<f64>,
}

struct Bench {
    names: Vec<&'static str>,
    models: Vec<Model>,
    camera: PinholeCamera,
    trace: bool,
}

fn main() -> Result<(), Failure> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let has = |word: &str| words.iter().any(|w| w == word);
    let sequences = words.iter().find_map(|w| w.parse().ok()).unwrap_or(200);
    if has("still") {
        let set = household(if has("tuning") { "tuning" } else { "test" })?;
        return still(&Tabletop::new(&set)?, sequences as usize, has("trace"));
    }
    let objects = if has("mugs") {
        public_mugs()?
    } else {
        let set = household(if has("tuning") { "tuning" } else { "test" })?;
        let models = set.map(|object| object.model().map(|model| (object.name(), model)));
        models.into_iter().collect::<Result<_, _>>()?
    };
    let (names, models) = objects.into_iter().unzip();
    let bench = Bench {
        names,
        models,
        camera: PinholeCamera::new(570.0, 570.0, 319.5, 239.5, 640, 480)?,
        trace: has("trace"),
    };
    // A sequence of 60 frames has 2 s, or 4 s where the object is hidden for up to 3 s.
    let kinds = [
        ("no hand", Hand::Absent, 30.0),
        ("a hand passes", Hand::Passing, 30.0),
        ("hidden for 1 to 3 s", Hand::Covering(1.0..3.0), 15.0),
    ];
    let mut counts: Vec<[Counts; 2]> = kinds.iter().map(|_| <[Counts; 2]>::default()).collect();
    for index in 0..sequences {
        let kind = (index % 3) as usize;
        let (_, hand, fps) = &kinds[kind];
        bench.sequence(index, hand, *fps, &mut counts[kind])?;
    }
    print_head();
    for (counts, (name, ..)) in counts.into_iter().zip(kinds) {
        for (counts, noise) in counts.into_iter().zip(["0 to 1 %", "1 to 3 %"]) {
            counts.print(name, noise);
        }
    }
    Ok(())
}

/// Tracks objects that stand still among others.
fn still(tabletop: &Tabletop, cases: usize, trace: bool) -> Result<(), Failure> {
    let points = hicp_tests::points_of(tabletop);
    print_head();
    for (distorted, noise) in [(false, "0 to 3 %"), (true, "systematic errors")] {
        let mut counts = Counts::default();
        for seed in 0.. {
            if counts.frames >= cases * STILL_FRAMES {
                break;
            }
            let scene = match distorted {
                true => tabletop.distorted_scene(seed)?,
                false => tabletop.scene(seed)?,
            };
            for (index, seen) in (0..).zip(scene) {
                if seen.visible_share < REAPPEARED {
                    continue;
                }
                let start = seen.near(&mut stream(seed, &["still"], index), 1.0);
                let object = (&tabletop.objects[seen.model].1, &points[seen.model]);
                let image = (&seen.depth, seen.camera);
                counts.still(object, image, &seen.truth, &start, trace)?;
            }
        }
        counts.print("on a table", noise);
    }
    let Some(root) = ycbv::root() else {
        println!("no ycbv dataset; set BOP_PATH to its folder");
        return Ok(());
    };
    let mut counts = Counts::default();
    for (index, instance) in (0..).zip(ycbv::instances(&Dataset::open(root)?)) {
        let (truth, observation) = (&instance.truth, instance.observe());
        let mut random = stream(index, &["still"], 0);
        let start = perturb(&mut random, truth, 0.0062, 9.5_f64.to_radians());
        let object = (&*instance.model, &ModelPoints::new(&instance.model));
        let image = (observation.shared_depth(), *observation.camera());
        counts.still(object, image, truth, &start, trace)?;
    }
    counts.print("on a table, YCB-Video", "real");
    Ok(())
}

fn print_head() {
    println!(
        "| sequences | noise | frames | lost | tracking | wrong while tracking | found again | ms | lost, ms | `hybrid`, ms |"
    );
    println!("|---|---|---:|---:|---:|---:|---:|---:|---:|---:|");
}

impl Bench {
    /// Tracks the object of a sequence, and counts into one of the two levels of noise.
    fn sequence(
        &self,
        index: u64,
        hand: &Hand,
        fps: f64,
        counts: &mut [Counts; 2],
    ) -> Result<(), Failure> {
        let mut rng = stream(21, &["tracking"], index);
        let moving = (index / 3) as usize % self.models.len();
        let config = MovingConfig {
            trajectory: Trajectory {
                frames_per_second: fps,
                ..Trajectory::default()
            },
            hand: hand.clone(),
            ..MovingConfig::default()
        };
        let scene = MovingScene::draw(&mut rng, &self.models, moving, &config)?;
        let percent = 3.0 * rng.random::<f64>();
        let counts = &mut counts[usize::from(percent > NOISE_PERCENT)];
        let sensor = DepthSensor {
            noise: DepthNoise::Relative(RelativeGaussian { percent }),
            quantization_meters: Some(0.001),
            ..DepthSensor::default()
        };
        let model = &self.models[moving];
        let points: Vec<Point3<f32>> = model.samples().iter().map(|s| s.point).collect();
        let motions = model.symmetries().motions();
        let mut hybrid = Refiner::preset(Preset::Hybrid);
        let mut tracker = Tracker::new(model.clone(), self.camera, TrackerConfig::default());
        let start = perturb(&mut rng, &scene.poses[0], 0.0062, 9.5_f64.to_radians());
        tracker.start(&start);
        let mut state = TrackState::Tracking;
        let mut reappeared = None;
        for (frame, truth) in scene.poses.iter().enumerate() {
            let view = scene.view(&mut rng, frame, &self.models, &self.camera, &sensor)?;
            let depth = Arc::new(view.depth.clone());
            let clock = Instant::now();
            let tracked = tracker.step(depth, 1.0 / fps, None)?;
            let ms = 1e3 * clock.elapsed().as_secs_f64();
            counts.tracker_ms.push(ms);
            if tracked.state == TrackState::Lost {
                counts.lost_ms.push(ms);
            }
            let pose = &tracked.camera_from_object;
            let off = mssd(pose, truth, &points, &motions) / model.diameter();
            counts.frame(&tracked, off, state);
            state = tracked.state;
            let visible = visible_share(&view);
            let after = !scene.hidden.is_empty() && frame >= scene.hidden.end;
            if after && visible >= REAPPEARED && reappeared.is_none() {
                reappeared = Some(frame + FRAMES_TO_FIND);
                counts.reappeared += 1;
            }
            if reappeared.is_some_and(|end| frame < end)
                && state == TrackState::Tracking
                && off <= 0.1
            {
                counts.found += 1;
                reappeared = Some(0);
            }
            if frame % 6 == 1 && visible > REAPPEARED {
                counts.hybrid_ms.push(self.hybrid(
                    &mut hybrid,
                    model,
                    &view,
                    &scene.poses[frame - 1],
                )?);
            }
            if self.trace {
                println!(
                    "{index} {} {percent:.1} % {frame} {off:.3} d, visible {visible:.2}, \
                     {ms:.2} ms: {tracked:?}",
                    self.names[moving]
                );
            }
        }
        Ok(())
    }

    /// Returns the time of `hybrid` with the exact mask, from the pose in the frame before.
    fn hybrid(
        &self,
        refiner: &mut Refiner,
        model: &Model,
        view: &ClutterView,
        init: &Isometry3<f64>,
    ) -> Result<f64, Failure> {
        let (depth, mask) = (
            Arc::new(view.depth.clone()),
            view.instances[0].visible.clone(),
        );
        let clock = Instant::now();
        let observation = Observation::new(depth, mask, self.camera)?;
        refiner.refine(model, &observation, init);
        Ok(1e3 * clock.elapsed().as_secs_f64())
    }
}

impl Counts {
    /// Tracks an object that stands still.
    fn still(
        &mut self,
        (model, points): (&Model, &ModelPoints),
        (depth, camera): (&Arc<DepthImage>, PinholeCamera),
        truth: &Isometry3<f64>,
        start: &Isometry3<f64>,
        trace: bool,
    ) -> Result<(), Failure> {
        let mut tracker = Tracker::new(model.clone(), camera, TrackerConfig::default());
        tracker.start(start);
        let mut state = TrackState::Tracking;
        for frame in 0..STILL_FRAMES {
            let clock = Instant::now();
            let tracked = tracker.step(Arc::clone(depth), 1.0 / 30.0, None)?;
            let ms = 1e3 * clock.elapsed().as_secs_f64();
            self.tracker_ms.push(ms);
            let lost = tracked.state == TrackState::Lost;
            self.lost_ms.extend(Some(ms).filter(|_| lost));
            let off = points.mssd(&tracked.camera_from_object, truth) / model.diameter();
            self.frame(&tracked, off, state);
            state = tracked.state;
            if trace {
                println!("{frame} {off:.3} d: {tracked:?}");
            }
        }
        Ok(())
    }

    fn frame(&mut self, tracked: &Tracked, off: f64, before: TrackState) {
        let lost = |state| state == TrackState::Lost;
        self.frames += 1;
        self.lost += usize::from(lost(tracked.state) && !lost(before));
        let tracking = tracked.state == TrackState::Tracking;
        self.tracking += usize::from(tracking);
        self.wrong += usize::from(tracking && off > 0.1);
    }

    fn print(mut self, name: &str, noise: &str) {
        let percent = |n: usize| 100.0 * n as f64 / self.frames.max(1) as f64;
        let found = match self.reappeared {
            0 => "–".to_owned(),
            reappeared => format!("{} of {reappeared}", self.found),
        };
        let lost = match median(&mut self.lost_ms) {
            0.0 => "–".to_owned(),
            middle => format!("{middle:.0}, {:.0}", self.lost_ms[self.lost_ms.len() - 1]),
        };
        println!(
            "| {name} | {noise} | {} | {} | {:.1} % | {:.2} % | {found} | {:.2} | {lost} | {} |",
            self.frames,
            self.lost,
            percent(self.tracking),
            percent(self.wrong),
            median(&mut self.tracker_ms),
            match median(&mut self.hybrid_ms) {
                0.0 => "–".to_owned(),
                middle => format!("{middle:.2}"),
            },
        );
    }
}

fn visible_share(view: &ClutterView) -> f64 {
    let count = |mask: &Mask| mask.n_set() as f64;
    let moving = &view.instances[0];
    count(&moving.visible) / count(&moving.silhouette).max(1.0)
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

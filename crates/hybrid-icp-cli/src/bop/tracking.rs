//! The steps of a tracker through images, and their lines of JSON.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use anyhow::bail;
use clap::Args;
use hicp_bop::Fault;
use hybrid_icp::core::{DepthImage, Isometry3, Model, PinholeCamera};
use hybrid_icp::{TrackState, Tracked, Tracker, TrackerConfig};
use serde_json::{Value, json};

use super::faults;
use super::statistics::{count, median};
use crate::options::positive;
use crate::pose_json::add_pose;
use crate::terminal::warn;

/// The largest plausible rate of images. Higher ones are probably in other units.
const MAX_FPS: f64 = 1000.0;

/// The rate of the images.
#[derive(Debug, Args)]
pub(crate) struct Rate {
    /// Number of images per second.
    #[arg(long, value_name = "N", default_value_t = 30.0, value_parser = positive, allow_negative_numbers = true)]
    fps: f64,
}

/// The result of an image.
#[derive(Debug)]
pub(crate) struct Line {
    pub(crate) tracked: Tracked,
    seconds: f64,
}

/// An image: its camera and depth.
pub(crate) type Image = (PinholeCamera, Arc<DepthImage>);

/// The results of all images, and the reasons why some could not be read.
pub(crate) struct Lines {
    pub(crate) lines: Vec<Line>,
    faults: Vec<Fault>,
}

impl Rate {
    /// Tracks the object through numbered images, in which unreadable ones show nothing.
    pub(crate) fn track(
        &self,
        model: &Model,
        start: &Isometry3<f64>,
        images: impl Iterator<Item = (u32, Result<Image, Fault>)>,
    ) -> anyhow::Result<Lines> {
        // The camera of the first readable image replaces it.
        let unknown = PinholeCamera::new(1.0, 1.0, 0.0, 0.0, 1, 1)?;
        let mut tracker = Tracker::new(model.clone(), unknown, TrackerConfig::default());
        tracker.start(start);
        let (mut lines, mut faults) = (Vec::new(), Vec::new());
        let mut nothing = Arc::new(DepthImage::from_meters(1, 1, vec![0.0])?);
        let mut before = None;
        for (number, image) in images {
            let depth = match image {
                Ok((camera, depth)) => {
                    tracker.set_camera(camera);
                    let (width, height) = camera.size();
                    if nothing.size() != camera.size() {
                        let pixels = vec![0.0; camera.region().area()];
                        nothing = Arc::new(DepthImage::from_meters(width, height, pixels)?);
                    }
                    depth
                }
                Err(fault) => {
                    faults.push(fault);
                    Arc::clone(&nothing)
                }
            };
            let clock = Instant::now();
            let passed = number - before.replace(number).unwrap_or(number);
            let tracked = tracker.step(depth, f64::from(passed) / self.fps, None)?;
            lines.push(Line {
                tracked,
                seconds: clock.elapsed().as_secs_f64(),
            });
        }
        Ok(Lines { lines, faults })
    }

    /// Warns of a rate that is not plausible.
    pub(crate) fn check(&self) {
        let fps = self.fps;
        if fps > MAX_FPS {
            warn(format_args!(
                "--fps is {fps}, expected the number of images per second, at most {MAX_FPS}: the \
                 motion of the object is not predicted"
            ));
        }
    }
}

impl Line {
    pub(crate) fn is_tracking(&self) -> bool {
        self.tracked.state == TrackState::Tracking
    }

    /// Returns a line of JSON that includes the keys of `image`.
    pub(crate) fn json(&self, image: Value) -> Value {
        let tracked = &self.tracked;
        let shares: BTreeMap<_, _> = tracked.evidence.named().into_iter().collect();
        let degrees_per_second = tracked.radians_per_second.map(f64::to_degrees);
        let mut line = image;
        line["state"] = json!(tracked.state.name());
        line["score"] = json!(tracked.confidence);
        line["time"] = json!(self.seconds);
        line["evidence"] = json!(shares);
        line["deviation_mm"] = json!(1e3 * tracked.deviation_meters);
        line["velocity_mm_per_s"] = json!((1e3 * tracked.meters_per_second).as_slice());
        line["angular_velocity_deg_per_s"] = json!(degrees_per_second.as_slice());
        add_pose(&mut line, &tracked.camera_from_object);
        line
    }
}

impl Lines {
    /// Counts the images by state, and adds the median time.
    pub(crate) fn summary(&self) -> String {
        let mut text = count(self.lines.iter().map(|line| line.tracked.state.name()));
        let mut times: Vec<f64> = self.lines.iter().map(|line| 1e3 * line.seconds).collect();
        if let Some(median) = median(&mut times) {
            text.push_str(&format!("\n  median time {median:.1} ms"));
        }
        text
    }

    /// Reports images that could not be read, and a run that never tracked the object.
    ///
    /// `advice` names the things to check in that case.
    pub(crate) fn report(&self, output: &Path, advice: &str) -> anyhow::Result<()> {
        let damaged = faults::report(self.faults.iter(), [].iter());
        if self.faults.len() == self.lines.len() {
            bail!(
                "the depth of no image could be read: all poses in {} are guesses",
                output.display()
            );
        }
        if !self.lines.iter().any(Line::is_tracking) {
            distrust(output, "the object is tracked", self.lines.len(), advice);
        }
        if let Some(damaged) = damaged {
            bail!(
                "{damaged}; in their images, {} has a predicted pose",
                output.display()
            );
        }
        Ok(())
    }
}

/// Warns that all poses are guesses, because no image had the success that `failed` names.
pub(crate) fn distrust(output: &Path, failed: &str, images: usize, advice: &str) {
    warn(format_args!(
        "{}: {failed} in none of its {images} images: do not trust its poses, and check {advice}",
        output.display()
    ));
}

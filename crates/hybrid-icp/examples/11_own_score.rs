//! A custom score: judges a pose from the image alone.
//!
//! `cargo run --release -p hybrid-icp --example 11_own_score`

use std::error::Error;

use hybrid_icp::Preset;
use hybrid_icp::core::{Context, Isometry3};
use hybrid_icp::icp::KeepBest;
use hybrid_icp::score::Score;

mod scene;

/// The mean difference of depth over the masked pixels.
///
/// The limit bounds each difference. It is also the value of a pixel without a render.
struct DepthError {
    limit_meters: f32,
}

impl Score for DepthError {
    fn score(&mut self, context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> f64 {
        let problem = context.problem;
        let (Some(observation), Some(view)) =
            (problem.observation(), context.view(camera_from_object))
        else {
            return 1.0;
        };
        let (mut sum, mut count) = (0.0, 0_u32);
        for (u, v) in observation.region().pixels() {
            let measured = observation.depth().get(u, v).unwrap_or(0.0);
            if observation.mask().get(u, v) == Some(true) && measured > 0.0 {
                let difference = (view.depth_at(u, v) - measured).abs();
                sum += f64::from(difference.min(self.limit_meters));
                count += 1;
            }
        }
        // A score is never NaN: where nothing was measured, nothing speaks for the pose.
        if count == 0 {
            f64::from(self.limit_meters)
        } else {
            sum / f64::from(count)
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    scene::Scene::new()?.refine(KeepBest {
        times: 3,
        stage: Preset::ProjectiveCascadePointPlane.build(),
        score: DepthError { limit_meters: 0.02 },
    })
}

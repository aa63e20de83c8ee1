//! A custom stop rule: ends a stage.
//!
//! `cargo run --release -p hybrid-icp --example 07_own_stop_rule`

use std::error::Error;

use hybrid_icp::core::Iteration;
use hybrid_icp::icp::{Judgment, Progress, StopRule, Termination};
use hybrid_icp::prelude::*;

mod scene;

/// Ends a stage when two increments in a row would move the image of the object by less than some
/// pixels.
struct SubPixel {
    pixels: f64,
    focal_length: f64,
    radius_meters: f64,
    quiet: usize,
}

impl StopRule for SubPixel {
    fn start(&mut self) {
        self.quiet = 0; // A rule is used again and again.
    }

    fn check(&mut self, _iteration: &Iteration<'_>, progress: &Progress<'_>) -> Judgment {
        // The increment turns about the camera; what counts is how far it moves the object.
        let position = progress.camera_from_object.translation.vector;
        let moved = (progress.increment * progress.camera_from_object)
            .translation
            .vector;
        let turned = progress.increment.rotation.angle() * self.radius_meters;
        let motion = self.focal_length * ((moved - position).norm() + turned) / position.z.abs();
        self.quiet = if motion < self.pixels {
            self.quiet + 1
        } else {
            0
        };
        if self.quiet >= 2 {
            Judgment::Accept(Termination::Custom("sub_pixel"))
        } else {
            Judgment::Continue
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let given = scene::Scene::new()?;
    let sub_pixel = SubPixel {
        pixels: 1.0,
        focal_length: given.camera.fx(),
        radius_meters: given.problem()?.0.radius(),
        quiet: 0,
    };
    given.refine(Icp {
        selection: VisibleSurface::default(),
        association: Projective,
        filter: (),
        metric: PointToPlane,
        stop: (sub_pixel, IterationLimit(50)),
    })
}

//! A custom fuser: how the estimates from a moving camera become one.
//!
//! `cargo run --release -p hybrid-icp --example 14_own_fuser`

#![allow(clippy::print_stdout)]

use std::error::Error;

use hicp_sim::{RelativeGaussian, rng};
use hybrid_icp::core::{Model, Observation, Vector6, se3};
use hybrid_icp::fusion::{
    CameraMotion, Failure, Fuser, Fusion, PoseEstimate, Solution, Transport, Update,
};
use hybrid_icp::raster::render_depth_image;
use hybrid_icp::{Preset, SequentialEstimator};

mod scene;

/// A filter that forgets: the uncertainty grows by a factor with every image, so that newer images
/// count more.
///
/// It rejects estimates that are too far from the current one.
struct Forgetting {
    factor: f64,
    max_jump_meters: f64,
    held: Option<PoseEstimate>,
    fusion: Fusion,
}

impl Fuser for Forgetting {
    fn propagate(&mut self, motion: &CameraMotion) {
        self.held = self
            .held
            .map(|held| motion.carry(&held, Transport::Adjoint));
    }

    fn update(&mut self, estimate: &PoseEstimate) -> Update {
        let Some(held) = self.held else {
            self.held = Some(*estimate);
            return Update::Accepted(Solution::NONE);
        };
        let (pose, new_pose) = (held.camera_from_object(), estimate.camera_from_object());
        if (pose.translation.vector - new_pose.translation.vector).norm() > self.max_jump_meters {
            return Update::Rejected(Failure::Custom("too far from the held estimate"));
        }
        // The covariance is refused once it is absurdly large; then it has grown enough.
        let held = PoseEstimate::new(*pose, held.covariance() * self.factor).unwrap_or(held);
        self.fusion.clear();
        self.fusion.push(&held);
        self.fusion.push(estimate);
        match self.fusion.solve(held.camera_from_object()) {
            Some(fused) => {
                self.held = Some(fused.estimate);
                Update::Accepted(fused.solution)
            }
            None => Update::Rejected(Failure::Custom("the held pose is not finite")),
        }
    }

    fn estimate(&self) -> Option<PoseEstimate> {
        self.held
    }

    fn reset(&mut self) {
        self.held = None;
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let given = scene::Scene::new()?;
    let model = Model::new(given.mesh.clone());
    let fuser = Forgetting {
        factor: 1.5,
        max_jump_meters: 0.05,
        held: None,
        fusion: Fusion::default(),
    };
    // With the covariances, symmetries and gate of an object. The gate resets the fuser when it
    // replaces everything held. `SequentialEstimator::new` has the covariances of its
    // configuration, no symmetries and no gate.
    let mut estimator =
        SequentialEstimator::for_object(Preset::Hybrid.build(), fuser, &model, &given.detected)?;
    // The camera moves around the object by 5 mm and half a degree per image.
    let motion = CameraMotion::new(se3::exp(&Vector6::new(0.005, 0.0, 0.0, 0.0, 0.009, 0.0)))?;
    let (mut rng, mut truth, mut moved) = (rng(2), given.truth, CameraMotion::none());
    let mut errors = vec![se3::pose_distance(&given.detected, &truth).1];
    for image in 1..=5 {
        let clean = render_depth_image(&given.mesh, &given.camera, &truth);
        let mask = hybrid_icp::core::Mask::measured(&clean);
        let depth = RelativeGaussian { percent: 0.5 }.apply(&mut rng, &clean);
        let observation = Observation::new(depth, mask, given.camera)?;
        let step = estimator.step(&model, &observation, &moved);
        let (angle, distance) = se3::pose_distance(&step.camera_from_object, &truth);
        println!(
            "image {image}: {:?}, {:.3} degrees and {:.3} mm off",
            step.event,
            angle.to_degrees(),
            distance * 1e3
        );
        errors.push(distance);
        truth = motion.apply(&truth);
        moved = motion;
    }
    match errors[..] {
        [detected, .., fused] if fused < detected => Ok(()),
        _ => Err("the fused pose is not nearer the truth".into()),
    }
}

//! The scene of the examples: a clothes iron in a simulated depth image, and a rough pose.

#![allow(dead_code)] // Not every example uses everything.

use std::error::Error;

use hicp_sim::{Household, RelativeGaussian, perturb, rng};
use hybrid_icp::Refiner;
use hybrid_icp::core::{
    DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, Translation3, TriMesh,
    UnitQuaternion, Vector3, se3,
};
use hybrid_icp::icp::Stage;
use hybrid_icp::raster::render_depth_image;

/// A simulated image with its ground truth and a detected pose (meters, camera from object).
pub(crate) struct Scene {
    pub(crate) mesh: TriMesh,
    pub(crate) camera: PinholeCamera,
    pub(crate) depth: DepthImage,
    pub(crate) mask: Mask,
    /// 5 mm and 6° off.
    pub(crate) detected: Isometry3<f64>,
    pub(crate) truth: Isometry3<f64>,
}

impl Scene {
    pub(crate) fn new() -> Result<Self, Box<dyn Error>> {
        let mut rng = rng(1);
        let mesh = Household::Iron.model()?.mesh().clone();
        let camera = PinholeCamera::new(572.4, 573.6, 325.3, 242.0, 640, 480)?;
        let truth = Isometry3::from_parts(
            Translation3::new(0.01, -0.02, 0.55),
            UnitQuaternion::new(Vector3::new(-2.0, 0.6, 0.3)),
        );
        let clean = render_depth_image(&mesh, &camera, &truth);
        let mask = Mask::measured(&clean);
        Ok(Self {
            depth: RelativeGaussian { percent: 0.5 }.apply(&mut rng, &clean),
            detected: perturb(&mut rng, &truth, 0.005, 6.0_f64.to_radians()),
            mesh,
            camera,
            mask,
            truth,
        })
    }

    /// Returns the two sides of a registration.
    pub(crate) fn problem(&self) -> Result<(Model, Observation), Box<dyn Error>> {
        let observation = Observation::new(self.depth.clone(), self.mask.clone(), self.camera)?;
        Ok((Model::new(self.mesh.clone()), observation))
    }

    /// Refines the detected pose with a stage and prints the result.
    ///
    /// Fails if the result is not nearer to the truth.
    #[allow(clippy::print_stdout)]
    pub(crate) fn refine(&self, stage: impl Stage + Send + 'static) -> Result<(), Box<dyn Error>> {
        let (model, observation) = self.problem()?;
        let refined = Refiner::new(stage).refine(&model, &observation, &self.detected);
        let outcome = refined.outcome;
        println!(
            "{:?}: {} after {} iterations",
            outcome.verdict, outcome.termination, outcome.iterations
        );
        println!("MVE {:.3} -> {:.3}", refined.mve_initial, refined.mve);
        let (angle_before, distance_before) = se3::pose_distance(&self.detected, &self.truth);
        let (angle, distance) = se3::pose_distance(&outcome.camera_from_object, &self.truth);
        println!(
            "rotation error {:.2} -> {:.2} degrees",
            angle_before.to_degrees(),
            angle.to_degrees()
        );
        println!(
            "translation error {:.2} -> {:.2} mm",
            distance_before * 1e3,
            distance * 1e3
        );
        if angle < angle_before && distance < distance_before {
            Ok(())
        } else {
            Err("the refined pose is not nearer the truth".into())
        }
    }
}

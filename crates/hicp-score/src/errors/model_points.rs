//! A model prepared for BOP's errors.

use hicp_core::{Isometry3, Model, PinholeCamera, Point3};

use crate::errors::nearest::NearestPoints;
use crate::errors::pose_error::{add, mspd, mssd};

/// The vertices of a model with its symmetries expanded and a search tree, for many pairs of poses.
///
/// BOP defines its errors over the vertices of the meshes in `models_eval`. Building costs O(n log
/// n) and O(symmetries). Threads share it by reference.
#[derive(Debug)]
pub struct ModelPoints {
    points: Vec<Point3<f32>>,
    nearest: NearestPoints,
    symmetries: Vec<Isometry3<f64>>,
    diameter: f64,
}

impl ModelPoints {
    /// Uses all vertices of a model, in a triangle or not, its declared symmetries and its
    /// diameter.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let points = model.mesh().vertices().to_vec();
        Self {
            nearest: NearestPoints::new(&points),
            points,
            symmetries: model.symmetries().motions(),
            diameter: model.diameter(),
        }
    }

    /// The vertices, in meters in the object frame.
    #[must_use]
    pub fn points(&self) -> &[Point3<f32>] {
        &self.points
    }

    /// The motions that do not change the object's appearance, the identity first.
    #[must_use]
    pub fn symmetries(&self) -> &[Isometry3<f64>] {
        &self.symmetries
    }

    /// The diameter, meters.
    #[must_use]
    pub fn diameter(&self) -> f64 {
        self.diameter
    }

    /// Returns whether the object has a symmetry apart from the identity.
    #[must_use]
    pub fn is_symmetric(&self) -> bool {
        self.symmetries.len() > 1
    }

    /// Returns [`add`], in meters.
    #[must_use]
    pub fn add(&self, estimate: &Isometry3<f64>, truth: &Isometry3<f64>) -> f64 {
        add(estimate, truth, &self.points)
    }

    /// Returns [`adi`](crate::adi), in meters. Cost: O(n log n), without building the tree.
    #[must_use]
    pub fn adi(&self, estimate: &Isometry3<f64>, truth: &Isometry3<f64>) -> f64 {
        self.nearest.adi(estimate, truth, &self.points)
    }

    /// Returns [`mssd`] over the declared symmetries, in meters.
    #[must_use]
    pub fn mssd(&self, estimate: &Isometry3<f64>, truth: &Isometry3<f64>) -> f64 {
        mssd(estimate, truth, &self.points, &self.symmetries)
    }

    /// Returns [`mspd`] over the declared symmetries, in pixels of this camera.
    #[must_use]
    pub fn mspd(
        &self,
        estimate: &Isometry3<f64>,
        truth: &Isometry3<f64>,
        camera: &PinholeCamera,
    ) -> f64 {
        mspd(estimate, truth, &self.points, &self.symmetries, camera)
    }
}

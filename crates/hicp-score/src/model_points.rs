//! A model made ready for BOP's errors.

use hicp_core::{Isometry3, Model, PinholeCamera, Point3};

use crate::nearest::NearestPoints;
use crate::pose_error::{add, mspd, mssd};

/// The vertices of a model with its symmetries expanded and a search tree built, for many pairs of
/// poses.
///
/// BOP states its errors over the vertices of the meshes in `models_eval`. Building costs O(n log
/// n) and O(symmetries); share it between threads by reference.
#[derive(Debug)]
pub struct ModelPoints {
    points: Vec<Point3<f32>>,
    nearest: NearestPoints,
    symmetries: Vec<Isometry3<f64>>,
    diameter: f64,
}

impl ModelPoints {
    /// Takes all vertices of a model, used by a triangle or not, its declared symmetries and its
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

    /// The vertices, metres, object frame.
    #[must_use]
    pub fn points(&self) -> &[Point3<f32>] {
        &self.points
    }

    /// The motions that leave the object looking the same, the identity first.
    #[must_use]
    pub fn symmetries(&self) -> &[Isometry3<f64>] {
        &self.symmetries
    }

    /// The diameter, metres.
    #[must_use]
    pub fn diameter(&self) -> f64 {
        self.diameter
    }

    /// Returns whether the object has a symmetry besides the identity.
    #[must_use]
    pub fn is_symmetric(&self) -> bool {
        self.symmetries.len() > 1
    }

    /// Returns [`add`], metres.
    #[must_use]
    pub fn add(&self, estimate: &Isometry3<f64>, truth: &Isometry3<f64>) -> f64 {
        add(estimate, truth, &self.points)
    }

    /// Returns [`crate::adi`], metres. Cost: O(n log n), without the tree.
    #[must_use]
    pub fn adi(&self, estimate: &Isometry3<f64>, truth: &Isometry3<f64>) -> f64 {
        self.nearest.adi(estimate, truth, &self.points)
    }

    /// Returns [`mssd`] over the declared symmetries, metres.
    #[must_use]
    pub fn mssd(&self, estimate: &Isometry3<f64>, truth: &Isometry3<f64>) -> f64 {
        mssd(estimate, truth, &self.points, &self.symmetries)
    }

    /// Returns [`mspd`] over the declared symmetries, pixels of this camera.
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

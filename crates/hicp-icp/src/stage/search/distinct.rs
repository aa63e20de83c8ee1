//! The difference between two poses of an object, up to its declared symmetries.

use std::sync::Arc;

use hicp_core::{Isometry3, Model, Point3, Vector3, so3};
use hicp_score::mssd;

/// The share of the diameter by which distinct poses differ (MSSD).
const APART: f64 = 0.1;
/// The largest distance (MSSD), as a share of the diameter, between an initial pose that was nearly
/// right and the right one.
const NEAR: f64 = 0.25;

/// The extreme points of an object with its expanded symmetries. Computed once per model.
#[derive(Debug)]
pub(crate) struct Distinct {
    points: Vec<Point3<f32>>,
    symmetries: Vec<Isometry3<f64>>,
    diameter: f64,
}

/// Returns whether two poses of a model are so near that one can be the refinement of the other.
///
/// Their MSSD is then below a quarter of the diameter, up to declared symmetries. Cost: some
/// hundred multiplications per symmetry.
///
/// ```
/// # use hicp_core::{Isometry3, Model, Point3, TriMesh};
/// let corners = [[0., 0., 0.], [0.1, 0., 0.], [0., 0.1, 0.]].map(Point3::from);
/// let model = Model::new(TriMesh::new(corners.to_vec(), vec![[0, 1, 2]])?);
/// let moved = |meters| Isometry3::translation(meters, 0.0, 0.0);
/// assert!(hicp_icp::is_near(&model, &moved(0.0), &moved(0.03)));
/// assert!(!hicp_icp::is_near(&model, &moved(0.0), &moved(0.04)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn is_near(model: &Model, a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
    Distinct::of(model).near(a, b)
}

impl Distinct {
    pub(crate) fn of(model: &Model) -> Arc<Self> {
        model.derived().get_or_build(0, || Self {
            points: extremes(model),
            symmetries: model.symmetries().motions(),
            diameter: model.diameter(),
        })
    }

    /// Returns the MSSD of two poses up to the declared symmetries, meters.
    pub(crate) fn mssd(&self, a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
        mssd(a, b, &self.points, &self.symmetries)
    }

    /// Returns the smallest angle between two poses up to the declared symmetries, degrees.
    pub(crate) fn degrees(&self, a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
        let back = a.rotation.inverse() * b.rotation;
        let angles = self.symmetries.iter();
        let angles = angles.map(|motion| so3::angle(&(back * motion.rotation)));
        angles.fold(f64::INFINITY, f64::min).to_degrees()
    }

    /// Returns the diameter of the model, meters.
    pub(crate) fn diameter(&self) -> f64 {
        self.diameter
    }

    /// Returns whether two poses differ by more than a tenth of the diameter.
    pub(crate) fn apart(&self, a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
        self.mssd(a, b) > APART * self.diameter
    }

    /// Returns whether two poses are so near that one can be the refinement of the other.
    pub(crate) fn near(&self, a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
        self.mssd(a, b) < NEAR * self.diameter
    }
}

/// Returns the samples, or the vertices if there are none, that are farthest along 26 directions.
///
/// The largest distance between two poses is that of a point of the convex hull.
fn extremes(model: &Model) -> Vec<Point3<f32>> {
    let samples = model.samples();
    let step = |index: i32| (index.rem_euclid(3) - 1) as f32;
    let directions = (0..27).map(|i| Vector3::new(step(i), step(i / 3), step(i / 9)));
    let mut points: Vec<Point3<f32>> = Vec::new();
    for direction in directions.filter(|d| *d != Vector3::zeros()) {
        let along = |point: &Point3<f32>| point.coords.dot(&direction);
        let vertices = samples.is_empty().then(|| model.mesh().used_points());
        let vertices = vertices.into_iter().flatten();
        let candidates = samples.iter().map(|s| s.point).chain(vertices);
        let farthest = candidates.max_by(|a, b| along(a).total_cmp(&along(b)));
        points.extend(farthest.filter(|point| !points.contains(point)));
    }
    points
}

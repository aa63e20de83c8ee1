//! Distances between model points at two poses: the errors of BOP that do not need an image.

use hicp_core::{Isometry3, Matrix3, PinholeCamera, Point2, Point3, Vector3};

use crate::errors::nearest::NearestPoints;

/// Returns ADD: the mean distance between corresponding model points at two poses, in meters.
///
/// ADD = mean |T_est x − T_gt x| (Hinterstoisser et al. 2012). Without points it is 0. Cost:
/// O(points).
#[must_use]
pub fn add(estimate: &Isometry3<f64>, truth: &Isometry3<f64>, points: &[Point3<f32>]) -> f64 {
    if points.is_empty() {
        return 0.0;
    }
    let sum: f64 = points
        .iter()
        .map(|p| {
            let p = p.cast::<f64>();
            (estimate * p - truth * p).norm()
        })
        .sum();
    sum / points.len() as f64
}

/// Returns ADI (also ADD-S), in meters: the mean distance to the *closest* model point.
///
/// ADI = mean over x of min over y |T_est y − T_gt x|. Without points it is 0. It is never above
/// ADD. If the points are symmetric, it does not depend on symmetries of the pose. With points
/// sampled on the surface, an equivalent pose maps each between others, and ADI stays at about half
/// of their spacing. [`mssd`] over the symmetries does not have such a floor.
///
/// Cost: O(n log n) for the search tree over the points and for the search.
/// [`ModelPoints::adi`](crate::ModelPoints::adi) builds the tree once.
#[must_use]
pub fn adi(estimate: &Isometry3<f64>, truth: &Isometry3<f64>, points: &[Point3<f32>]) -> f64 {
    NearestPoints::new(points).adi(estimate, truth, points)
}

/// Returns MSSD, the maximum symmetry-aware surface distance, in meters.
///
/// MSSD = min over S of max over x |T_est x − T_gt S x| (BOP'19). Without points it is 0.
/// `symmetries` are motions in the object frame, as [`hicp_core::Symmetries::motions`] expands
/// them. The identity always counts.
///
/// Cost: at most O(points × symmetries). A symmetry is abandoned at the first point with a larger
/// distance than the maximum of the best symmetry.
#[must_use]
pub fn mssd(
    estimate: &Isometry3<f64>,
    truth: &Isometry3<f64>,
    points: &[Point3<f32>],
    symmetries: &[Isometry3<f64>],
) -> f64 {
    least_maximum(symmetries, |symmetry, limit| {
        let difference = Difference::new(estimate, &(truth * symmetry));
        let squares = points
            .iter()
            .map(|x| difference.at(&x.cast::<f64>()).norm_squared());
        maximum(squares, limit)
    })
    .sqrt()
}

/// Returns MSPD, the maximum symmetry-aware projection distance, in pixels of this camera.
///
/// MSPD = min over S of max over x |proj(T_est x) − proj(T_gt S x)| (BOP'19), over all points,
/// visible or not, and inside the image or not. Without points it is 0. If a point at either pose
/// is not in front of the camera, it is infinite. Symmetries and cost are as for [`mssd`].
#[must_use]
pub fn mspd(
    estimate: &Isometry3<f64>,
    truth: &Isometry3<f64>,
    points: &[Point3<f32>],
    symmetries: &[Isometry3<f64>],
    camera: &PinholeCamera,
) -> f64 {
    let projected: Option<Vec<Point2<f64>>> = points
        .iter()
        .map(|x| camera.project(&(estimate * x.cast::<f64>())))
        .collect();
    let Some(projected) = projected else {
        return f64::INFINITY;
    };
    least_maximum(symmetries, |symmetry, limit| {
        let truth = truth * symmetry;
        let squares = points.iter().zip(&projected).map(|(x, estimated)| {
            let true_place = camera.project(&(truth * x.cast::<f64>()));
            true_place.map_or(f64::INFINITY, |p| (p - estimated).norm_squared())
        });
        maximum(squares, limit)
    })
    .sqrt()
}

/// The linear map T_est x − T_gt x, exactly zero for equal poses and precise far from the camera.
struct Difference {
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
}

impl Difference {
    fn new(a: &Isometry3<f64>, b: &Isometry3<f64>) -> Self {
        let matrix = |pose: &Isometry3<f64>| pose.rotation.to_rotation_matrix().into_inner();
        Self {
            rotation: matrix(a) - matrix(b),
            translation: a.translation.vector - b.translation.vector,
        }
    }

    fn at(&self, point: &Point3<f64>) -> Vector3<f64> {
        self.rotation * point.coords + self.translation
    }
}

/// Returns the smallest of the maxima of the identity and the symmetries.
///
/// `maximum_of` may return any value ≥ the limit once the limit is reached.
fn least_maximum(
    symmetries: &[Isometry3<f64>],
    maximum_of: impl Fn(&Isometry3<f64>, f64) -> f64,
) -> f64 {
    let identity = Isometry3::identity();
    let mut least = maximum_of(&identity, f64::INFINITY);
    for symmetry in symmetries {
        if *symmetry != identity {
            least = least.min(maximum_of(symmetry, least));
        }
    }
    least
}

/// Returns the largest value, or the first that reaches the limit. NaN counts as infinite.
fn maximum(values: impl Iterator<Item = f64>, limit: f64) -> f64 {
    let mut largest = 0.0;
    for value in values {
        if value.is_nan() || value >= limit {
            return if value.is_nan() { f64::INFINITY } else { value };
        }
        largest = f64::max(largest, value);
    }
    largest
}

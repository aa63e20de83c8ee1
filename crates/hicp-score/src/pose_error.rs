//! Distances between model points at two poses: the errors of BOP that need no image.

use hicp_core::{Isometry3, Matrix3, PinholeCamera, Point2, Point3, Vector3};

use crate::nearest::NearestPoints;

/// Returns ADD: the mean distance between corresponding model points at two poses, metres. 0
/// without points.
///
/// ADD = mean |T_est x − T_gt x| (Hinterstoisser et al. 2012). Cost: O(points).
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

/// Returns ADI (also ADD-S): the mean distance from a model point at the true pose to the *closest*
/// model point at the estimate, metres.
///
/// ADI = mean over x of min over y |T_est y − T_gt x|; 0 without points. Never above ADD, and blind
/// to symmetries, as far as the points are symmetric: of points sampled on the surface, an
/// equivalent pose maps each between others, and ADI stays at about half their spacing. [`mssd`]
/// over the symmetries has no such floor. Cost: O(n log n) for the search tree over the points and
/// for the search; [`crate::ModelPoints::adi`] builds the tree once.
#[must_use]
pub fn adi(estimate: &Isometry3<f64>, truth: &Isometry3<f64>, points: &[Point3<f32>]) -> f64 {
    NearestPoints::new(points).adi(estimate, truth, points)
}

/// Returns MSSD, the maximum symmetry-aware surface distance, metres. 0 without points.
///
/// MSSD = min over S of max over x |T_est x − T_gt S x| (BOP'19). `symmetries` are motions of the
/// object frame, as [`hicp_core::Symmetries::motions`] expands them; the identity always counts.
/// Cost: O(points × symmetries) at most; a symmetry is given up at the first point that lies
/// farther off than the best symmetry's farthest.
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

/// Returns MSPD, the maximum symmetry-aware projection distance, pixels of this camera. 0 without
/// points.
///
/// MSPD = min over S of max over x |proj(T_est x) − proj(T_gt S x)| (BOP'19), over points seen or
/// not, in the image or not. Infinite when a point at either pose is not in front of the camera.
/// Symmetries and cost as for [`mssd`].
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

/// T_est x − T_gt x as one linear map, which is exactly zero for equal poses and loses nothing far
/// from the camera.
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

/// Returns the least of the identity's and the symmetries' maxima. `maximum_of` may return any
/// value ≥ the limit once it is reached.
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

/// Returns the largest value, or the first that reaches the limit. What is not a number is
/// infinite.
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

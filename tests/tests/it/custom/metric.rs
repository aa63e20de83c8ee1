//! A custom error metric: the depth along the viewing ray, as the sensor measures it.

use super::icp;
use hicp_testkit::{MetricLaws, check_metric, check_minimize};
use hicp_tests::starts::{measure_stage, starts};
use hybrid_icp::association::{Projective, VisibleSurface};
use hybrid_icp::core::Pair;
use hybrid_icp::icp::Stage;
use hybrid_icp::metric::{ErrorMetric, Minimize, NormalEquations, PointToPlane, WeightedSum};

// --- The component ---

/// The distance of the model from the observed tangent plane *along the viewing ray*.
///
/// r = nᵀ(p − c) / nᵀd, where d is the unit ray to c. Dense trackers align depth images this way:
/// noise of a sensor adds to the length of the ray, not to the distance from a plane. The cosine
/// between ray and normal is at least `min_cosine`, which bounds the quotient.
#[derive(Clone, Copy, Debug)]
pub struct AlongRay {
    /// Smallest cosine between ray and normal, above 0.
    pub min_cosine: f64,
}

impl ErrorMetric for AlongRay {
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        let point = pair.source.point.cast::<f64>();
        let target = pair.target.point.cast::<f64>();
        let normal = pair.target.normal.cast::<f64>().into_inner();
        // Observed normals face the camera, so the cosine is negative.
        let cosine = normal.dot(&target.coords) / target.coords.norm();
        let direction = normal / cosine.min(-self.min_cosine);
        let residual = direction.dot(&(point - target));
        system.add_row(&point, &direction, residual, f64::from(pair.weight));
    }
}

// --- Its tests ---

const ALONG_RAY: AlongRay = AlongRay { min_cosine: 0.2 };

fn with_planes() -> impl Minimize {
    WeightedSum {
        terms: ((1.0, PointToPlane), (0.5, ALONG_RAY)),
    }
}

fn projective<M: Minimize>(metric: M) -> impl Stage {
    icp(VisibleSurface::default(), Projective, metric)
}

#[test]
fn it_keeps_the_laws() {
    // The rays start at the camera, so moving model and image together gives another measurement.
    let laws = MetricLaws {
        frame: false,
        ..MetricLaws::default()
    };
    check_metric(|| ALONG_RAY, laws);
    check_minimize(with_planes, laws);
}

#[test]
fn alone_and_beside_planes_it_ends_nearer_the_truth_than_planes_alone() {
    let starts = starts(3, 0.5);
    let planes = measure_stage(&mut projective(PointToPlane), &starts);
    let mine = measure_stage(&mut projective(ALONG_RAY), &starts);
    let both = measure_stage(&mut projective(with_planes()), &starts);
    mine.assert_below(0.7, &planes);
    both.assert_below(1.0, &planes);
}

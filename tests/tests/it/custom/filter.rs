//! A custom filter: weights that grow stricter from iteration to iteration.

use hicp_sim::MEAN_ROTATION_ERROR_DEGREES;
use hicp_testkit::{FilterLaws, check_filter};
use hicp_tests::starts::{Start, measure_stage, starts};
use hybrid_icp::association::{OutlierFilter, Projective, VisibleSurface};
use hybrid_icp::core::Correspondences;
use hybrid_icp::core::Iteration;
use hybrid_icp::icp::{Icp, IterationLimit, SmallMotion, Stage};
use hybrid_icp::metric::PointToPlane;

// --- The component ---

/// Graduated non-convexity (Yang, Antonante, Tzoumas & Carlone 2020).
///
/// Multiplies weights by w = (μσ²/(r² + μσ²))², where r is the distance to the observed tangent
/// plane. The Geman–McClure kernel is nearly quadratic at first and reaches its true width over the
/// iterations.
#[derive(Clone, Copy, Debug)]
struct Graduated {
    /// σ: standard deviation of a correct pair, meters.
    sigma_meters: f32,
    /// μ of the first iteration.
    start: f32,
    /// Divisor of μ from one iteration to the next, until μ is 1.
    rate: f32,
}

impl OutlierFilter for Graduated {
    fn filter(&mut self, iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        let index = i32::try_from(iteration.index).unwrap_or(i32::MAX);
        let mu = (self.start / self.rate.powi(index)).max(1.0);
        let width = mu * self.sigma_meters.powi(2);
        for pair in pairs.as_mut_slice() {
            let offset = pair.source.point - pair.target.point;
            let residual = pair.target.normal.dot(&offset);
            pair.weight *= (width / (residual * residual + width)).powi(2);
        }
    }
}

// --- Its tests ---

fn graduated() -> Graduated {
    Graduated {
        sigma_meters: 0.002,
        start: 30.0,
        rate: 1.4,
    }
}

fn projective<F: OutlierFilter>(filter: F) -> impl Stage {
    Icp {
        selection: VisibleSurface::default(),
        association: Projective,
        filter,
        metric: PointToPlane,
        stop: (SmallMotion::default(), IterationLimit(50)),
    }
}

#[test]
fn it_keeps_the_laws() {
    check_filter(graduated, FilterLaws::default());
}

#[test]
fn it_finds_the_object_where_the_mask_holds_something_else_too() {
    let mut starts = starts(3, 0.5);
    for Start { scene, .. } in &mut starts {
        scene.observation = scene.behind_a_bar(0.3, 0.02, true);
    }
    let plain = measure_stage(&mut projective(()), &starts);
    let mine = measure_stage(&mut projective(graduated()), &starts);
    mine.assert_below(0.5, &plain);
    assert!(mine.degrees < 0.5 * MEAN_ROTATION_ERROR_DEGREES, "{mine:?}");
}

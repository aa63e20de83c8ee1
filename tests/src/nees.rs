//! Monte-Carlo consistency of covariances: the normalized estimation error squared (NEES).

use hicp_sim::{Household, RelativeGaussian, object_pose, perturb, rng};
use hybrid_icp::association::{BoundaryTargets, DataAssociation, OutlierFilter, PointSelection};
use hybrid_icp::core::Iteration;
use hybrid_icp::core::{
    Context, Correspondences, Observation, Pair, PinholeCamera, Problem, Surfel, Vector6, se3,
};
use hybrid_icp::icp::{Icp, IterationLimit, Repeat, Session, SmallMotion, Stage, Workspace};
use hybrid_icp::metric::ErrorMetric;
use hybrid_icp::metric::{Minimize, sandwich_covariance};
use hybrid_icp::raster::Rasterizer;

use crate::render;

/// The results of a set of runs.
#[derive(Clone, Copy, Debug)]
pub struct Nees {
    /// Number of runs with a covariance.
    pub runs: usize,
    /// Mean of ξᵀΣ⁻¹ξ. It is 6 for a consistent covariance.
    pub mean: f64,
    /// Part of `mean` that comes from the mean error: x̄ᵀ x̄ of the whitened errors x.
    pub bias: f64,
    /// Mean of ξᵀΣ⁻¹ξ with the sandwich covariance, which allows residuals of different variance.
    pub sandwich: f64,
    /// Mean number of pairs.
    pub pairs: f64,
    /// Root mean square translation error of the object's center, millimeters.
    pub millimeters: f64,
}

impl Nees {
    /// Returns the 99 % band of the mean of χ²₆ over the runs (normal approximation).
    #[must_use]
    pub fn band(&self) -> (f64, f64) {
        let half = 2.5758 * (12.0 / self.runs as f64).sqrt();
        (6.0 - half, 6.0 + half)
    }
}

/// Origin of the pairs of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pairs {
    /// Pairs of ICP from an initial error.
    ///
    /// The points are those visible at the initial pose. They are associated again at the returned
    /// pose.
    Icp,
    /// Like `Icp`, but in five stages, each with points selected at its initial pose.
    ///
    /// The points are also selected again at the returned pose.
    Reselected,
    /// Like `Reselected`, without pairs at the edges of the mask and the depth.
    ReselectedInside,
    /// Pairs of the true pose, over which one metric is minimized.
    FixedAtTruth,
    /// Like `FixedAtTruth`, with the model's exact normals as those of the observation.
    ///
    /// The weights are inverse to the variance of a residual.
    FixedExactNormals,
}

/// Returns a camera with a quarter of the resolution of the other scenes.
pub fn small_camera() -> PinholeCamera {
    PinholeCamera::new(143.1, 143.4, 80.1, 59.8, 160, 120).expect("a valid camera")
}

/// Registers an object `runs` times under new noise and compares the errors with the covariances.
///
/// # Panics
///
/// Never for the objects that ship.
pub fn measure<P, A, M>(
    object: Household,
    (percent, init_error): (f64, (f64, f64)),
    runs: usize,
    made: Pairs,
    (selection, association, metric): (P, A, M),
) -> Nees
where
    P: PointSelection + Clone + Send + 'static,
    A: DataAssociation + Clone + Send + 'static,
    M: ErrorMetric + Clone + Send + 'static,
{
    let model = object.model().expect("the objects that ship are valid");
    let camera = small_camera();
    let mut rng = rng(object as u64 + 50);
    let truth = object_pose(&mut rng, &model.center(), 0.35..0.45, 0.02);
    let (clean, mask) = render(&model, &camera, &truth);
    let mut workspace = Workspace::new(Rasterizer::default());
    let mut filter = (made == Pairs::ReselectedInside).then(BoundaryTargets::default);
    let stage = Icp {
        selection: selection.clone(),
        association: association.clone(),
        filter: filter.iter().copied().collect::<Vec<_>>(),
        metric: metric.clone(),
        stop: (
            SmallMotion {
                translation_meters: 1e-6,
                rotation_degrees: 1e-4,
            },
            IterationLimit(30),
        ),
    };
    let times = if made == Pairs::Icp { 1 } else { 5 };
    let mut stage = Repeat { times, stage };
    let (mut selection, mut association, mut metric) = (selection, association, metric);
    let mut totals = (0_u32, 0.0, 0.0, 0.0, 0.0);
    let mut mean_error = Vector6::zeros();
    for _ in 0..runs {
        let depth = RelativeGaussian { percent }.apply(&mut rng, &clean);
        let observation = Observation::new(depth, mask.clone(), camera).expect("sizes agree");
        let problem = Problem::new(&model, &observation);
        let init = perturb(&mut rng, &truth, init_error.0, init_error.1.to_radians());
        let mut pairs = Correspondences::new();
        let mut source: Vec<Surfel> = Vec::new();
        let pose = if matches!(
            made,
            Pairs::Icp | Pairs::Reselected | Pairs::ReselectedInside
        ) {
            let outcome = stage.run(&problem, &init, &mut Session::new(&mut workspace, &mut ()));
            let pose = outcome.camera_from_object;
            let mut context: Context<'_> = workspace.context(&problem);
            let seen_from = if made == Pairs::Icp { init } else { pose };
            selection.select(&mut context, &seen_from, &mut source);
            pairs.begin(&pose, source.len());
            association.associate(&mut context, &source, &pose, &mut pairs);
            if let Some(filter) = &mut filter {
                filter.filter(&Iteration::new(0, &init, problem), &mut pairs);
            }
            pose
        } else {
            let mut context: Context<'_> = workspace.context(&problem);
            selection.select(&mut context, &truth, &mut source);
            pairs.begin(&truth, source.len());
            association.associate(&mut context, &source, &truth, &mut pairs);
            if made == Pairs::FixedExactNormals {
                for pair in pairs.as_mut_slice() {
                    // The noise moves a point along its ray by a share of its depth. In the
                    // residual, that is the same share of n·p.
                    let normal = pair.source.normal;
                    let scale = normal.dot(&pair.source.point.coords);
                    pair.target.normal = normal;
                    pair.weight = 1.0 / (scale * scale).max(1e-8);
                }
            }
            let mut pose = truth;
            for _ in 0..4 {
                let step = metric
                    .minimize(&Iteration::default(), &pairs)
                    .expect("enough pairs");
                pose = step.increment * pose;
                let moved = |pair: &Pair| Pair {
                    source: Surfel {
                        point: (step.increment * pair.source.point.cast::<f64>()).cast(),
                        normal: pair.source.normal,
                    },
                    ..*pair
                };
                let all: Vec<Pair> = pairs.as_slice().iter().map(moved).collect();
                pairs.begin(&pose, source.len());
                pairs.extend(all);
            }
            pose
        };
        let Some(covariance) = metric
            .system(&Iteration::default(), &pairs)
            .and_then(|s| s.covariance())
        else {
            continue;
        };
        let error = se3::log(&(pose * truth.inverse()));
        let factor = covariance.cholesky().expect("positive definite");
        let white = factor.l().solve_lower_triangular(&error).expect("regular");
        let robust = sandwich_covariance(&metric, &pairs);
        totals.0 += 1;
        totals.1 += white.norm_squared();
        let inverse = robust.and_then(|covariance| covariance.try_inverse());
        totals.2 += inverse.map_or(f64::NAN, |inverse| error.dot(&(inverse * error)));
        totals.3 += pairs.len() as f64;
        totals.4 += (pose * model.center() - truth * model.center()).norm_squared();
        mean_error += white;
    }
    let n = f64::from(totals.0);
    Nees {
        runs: totals.0 as usize,
        mean: totals.1 / n,
        bias: (mean_error / n).norm_squared(),
        sandwich: totals.2 / n,
        pairs: totals.3 / n,
        millimeters: (totals.4 / n).sqrt() * 1e3,
    }
}

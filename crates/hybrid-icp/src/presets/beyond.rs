//! The presets that go beyond the paper, composed of the same public parts.
//!
//! [`hybrid_visible`] and [`local`] refine the pose that they are given. [`search`] and [`auto`]
//! search for another one when that fails: they can end far from it, also at a pose that is
//! equivalent by symmetry. Their numbers were chosen on the ten tuning objects of `hicp-sim`;
//! `docs/presets.md` states the effect of each change.

use hicp_association::{
    AllSamples, Contour, Length, MaxDistance, MaxNormalAngle, NearestNeighbor, ObservationToModel,
    Projective, RenderedSurface, Stride, VisibleSide, VisibleSurface,
};
use hicp_icp::{
    Cascade, ColorChoice, Convergence, Descent, Divergence, Guard, HypothesisSearch, Icp,
    IterationLimit, LookAlikeCount, Repeat, SearchOptions, Stage, Start,
};
use hicp_metric::{Conditioned, Degeneracy, Photometric, PointToPlane, PointToPoint, Symmetric};
use hicp_score::{Doubt, MeanVsd, SampledMve};
use hicp_switch::{PAPER_ALPHA, Switch, SwitchUntilStall, Threshold};

use super::PaperStop;

/// A projective stage whose pairs are at most a quarter of the diameter apart.
pub type GatedIcp<M> = Icp<VisibleSurface, Projective, MaxDistance, M, PaperStop>;
/// A stage that pairs observed points with points of the model.
pub type CloudToModelIcp<M> = Icp<AllSamples, ObservationToModel, (), M, PaperStop>;
/// The stage of estimates that agree with the image.
pub type Near<M = PointToPlane> = Cascade<(GatedIcp<PointToPoint>, GatedIcp<M>)>;
/// The stage of estimates that do not.
pub type Far = Cascade<(CloudToModelIcp<PointToPoint>, CloudToModelIcp<Symmetric>)>;
/// The type of [`hybrid_visible`].
pub type HybridVisible = Repeat<
    Switch<
        Threshold<MeanVsd>,
        Near<Symmetric>,
        Icp<VisibleSurface, NearestNeighbor, MaxNormalAngle, PointToPoint, PaperStop>,
    >,
>;
/// The stage that fits the rendered surface and its silhouette to the image.
pub type Fit = Icp<
    (),
    (RenderedSurface, Contour),
    (),
    Conditioned<PointToPlane>,
    (Convergence, IterationLimit),
>;
/// The steps of [`local`] from doubtful poses.
pub type Steps = SwitchUntilStall<Threshold<MeanVsd>, Cascade<(Near, Fit)>, Cascade<(Far, Fit)>>;
/// The type of [`local`].
pub type Local = Cascade<(
    Guard<Fit, MeanVsd>,
    Switch<Threshold<Doubt>, Cascade<()>, Cascade<(Guard<Fit, MeanVsd>, Steps)>>,
)>;
/// The stage that aligns hypotheses.
pub type Align = Icp<VisibleSide, Projective, MaxDistance, Symmetric, PaperStop>;
/// The stage that refines hypotheses.
pub type Explore = Descent<SampledMve>;
/// The type of [`by_color`].
pub type ByColor<S> = ColorChoice<S, GatedIcp<Conditioned<Photometric<PointToPlane>>>, MeanVsd>;
/// The type of [`search`], [`auto`] and [`search_with`].
pub type Search = SearchFrom<Local>;
/// A search that ends with the stage `S`.
pub type SearchFrom<S> = HypothesisSearch<S, Align, Explore, Fit, SampledMve, MeanVsd, Doubt>;

/// τ_max of projective pairs, as a fraction of the diameter.
const TAU_DIAMETERS: f64 = 0.25;
/// Largest difference of depth in the fit of doubtful poses, which may be farther from the surface.
const WIDE_DIAMETERS: f64 = 0.25;
/// θ_max of nearest neighbors, degrees.
const THETA_DEGREES: f64 = 90.0;
/// Observability below which a direction stays as it is, relative to the best determined one. Noise
/// and contours raise that of a can's axis above the default of 0.001.
const UNDETERMINED: f64 = 0.005;

/// Returns the paper's rules, except that a loss that rises with new pairs is not a divergence.
fn stop(iterations: usize) -> PaperStop {
    (
        Divergence::count_aware(),
        Convergence::default(),
        IterationLimit(iterations),
    )
}

/// Creates a projective stage of about `points` points.
fn projective<M>(metric: M, points: usize, iterations: usize) -> GatedIcp<M> {
    Icp {
        selection: VisibleSurface::with_stride(Stride::AboutPoints(points)),
        association: Projective,
        filter: MaxDistance::diameters(TAU_DIAMETERS),
        metric,
        stop: stop(iterations),
    }
}

/// Creates the near stage: the projective cascade of point-to-point and another metric.
fn near<M>(metric: M, points: usize) -> Near<M> {
    Cascade((
        projective(PointToPoint, points, 50),
        projective(metric, points, 50),
    ))
}

/// Creates a stage that pairs observed points with points of the model.
///
/// Hidden points of the model are included: to exclude them costs time, and far from the truth it
/// is not known which they are.
fn observed<M>(
    (points, samples): (usize, usize),
    metric: M,
    convergence: Convergence,
) -> CloudToModelIcp<M> {
    Icp {
        // The association ignores the selection. `()` would do, but work counts and traces of the
        // preset list the selected points.
        selection: AllSamples,
        association: ObservationToModel {
            stride: Stride::AboutPoints(points),
            samples,
            visible_only: false,
        },
        filter: (),
        metric,
        stop: (Divergence::count_aware(), convergence, IterationLimit(50)),
    }
}

/// Returns the convergence at which point-to-point far from the truth has done its part.
fn coarse() -> Convergence {
    Convergence {
        relative_change: 1e-2,
        ..Convergence::default()
    }
}

/// `hybrid-visible`: [`super::hybrid`] with the better reading of the paper's O.
///
/// - O is the visible surface for nearest neighbors too, and the normals of their pairs differ by
///   at most 90°.
/// - The second projective stage minimizes the symmetric metric.
/// - Projective pairs are at most a quarter of the diameter apart.
/// - Divergence rule 3 is count-aware.
#[must_use]
pub fn hybrid_visible() -> HybridVisible {
    Repeat {
        times: 2,
        stage: Switch {
            switcher: Threshold {
                score: MeanVsd::default(),
                alpha: PAPER_ALPHA,
            },
            aligned: near(Symmetric, 2000),
            misaligned: Icp {
                selection: VisibleSurface::default(),
                association: NearestNeighbor::default(),
                filter: MaxNormalAngle::degrees(THETA_DEGREES),
                metric: PointToPoint,
                stop: stop(50),
            },
        },
    }
}

/// Creates a stage that fits the rendered surface and its silhouette to the image.
///
/// Rotations that the image does not determine stay as they are. It ends after some `iterations`,
/// and with 1 it keeps the pose.
pub(crate) fn fit_of(iterations: usize) -> Fit {
    Icp {
        selection: (),
        association: (RenderedSurface::default(), Contour::default()),
        filter: (),
        metric: Conditioned {
            metric: PointToPlane,
            policy: Degeneracy::FreezeRotations,
            threshold: UNDETERMINED,
        },
        stop: (Convergence::default(), IterationLimit(iterations)),
    }
}

/// Creates the fit of the presets, [`fit_of`] eight iterations.
pub(crate) fn fit() -> Fit {
    fit_of(8)
}

/// Creates the fit of doubtful poses.
fn wide_fit() -> Fit {
    let mut wide = fit();
    wide.association.0.limit = Length::Diameters(WIDE_DIAMETERS);
    wide
}

/// Creates a fit that is accepted only if the score improves.
fn guarded(stage: Fit) -> Guard<Fit, MeanVsd> {
    Guard {
        stage,
        score: MeanVsd::imperfect_mask(),
    }
}

/// Creates the stage of estimates that do not agree with the image.
pub(crate) fn far() -> Far {
    let sizes = (300, 5000);
    Cascade((
        observed(sizes, PointToPoint, coarse()),
        observed(sizes, Symmetric, Convergence::default()),
    ))
}

/// `local`: local refinement that never returns a pose with a higher score than the initial one.
///
/// The score is the MVE for the masks of detectors ([`MeanVsd::imperfect_mask`]).
///
/// 1. **Fit**: up to eight iterations pair the rendered model with the image, by the depth along
///    the rays ([`RenderedSurface`], differences up to 0.12 diameters) and across the silhouette
///    ([`Contour`]). Rotations with little information are frozen, unless they explain the
///    residuals. If the [`Doubt`] is then below 0.05, the pipeline ends.
/// 2. **Wide fit**: differences up to 0.25 diameters count, and rotations with little information
///    stay frozen, also in later fits.
/// 3. **Steps**: [`SwitchUntilStall`] runs up to six steps until the score stalls, and keeps the
///    pose with the lowest score. A step runs the projective cascade if the pose agrees with the
///    image. Otherwise it pairs observed points with the model, first with point-to-point and then
///    with the symmetric metric. Each step ends with four iterations of the fit.
#[must_use]
pub fn local() -> Local {
    let mut first = fit();
    // Only here: with it in the fits of doubtful poses, a search missed more mugs.
    first.metric.policy = Degeneracy::FreezeUnexplained;
    let short = fit_of(4);
    let steps = SwitchUntilStall {
        switcher: Threshold {
            score: MeanVsd::imperfect_mask(),
            alpha: PAPER_ALPHA,
        },
        aligned: Cascade((near(PointToPlane, 2000), short.clone())),
        misaligned: Cascade((far(), short)),
        max_steps: 6,
        min_gain: 0.01,
        good_enough: 0.1,
    };
    Cascade((
        guarded(first),
        Switch {
            switcher: Threshold {
                score: Doubt,
                alpha: 0.05,
            },
            aligned: Cascade(()),
            misaligned: Cascade((guarded(wide_fit()), steps)),
        },
    ))
}

/// Creates the count of poses that look alike, by the scores of the search.
pub(crate) fn look_alikes() -> LookAlikeCount<SampledMve, MeanVsd> {
    LookAlikeCount::new(SampledMve::imperfect_mask(), MeanVsd::imperfect_mask())
}

/// Creates the stage that moves many hypotheses to the image: few points, and no render.
fn align() -> Align {
    Icp {
        selection: VisibleSide { count: 100 },
        association: Projective,
        filter: MaxDistance::diameters(TAU_DIAMETERS),
        metric: Symmetric,
        stop: (Divergence::count_aware(), coarse(), IterationLimit(10)),
    }
}

/// Creates the stage that refines hypotheses. It lowers the ranking score directly.
fn explore() -> Explore {
    Descent {
        score: SampledMve::imperfect_mask(),
        good_enough: 0.0,
        first_step: 0.1,
        last_step: 0.0125,
        min_gain: 0.0,
        evaluations: 120,
    }
}

/// Creates a search that ends with `stage`.
fn search_from<S>(stage: S, options: SearchOptions) -> SearchFrom<S> {
    let scores = (
        SampledMve::imperfect_mask(),
        MeanVsd::imperfect_mask(),
        Doubt,
    );
    let stages = (align(), explore(), wide_fit());
    HypothesisSearch::new(stage, stages, scores, options)
}

/// A search without an initial pose that ends with `stage`, as in
/// [`Refiner::estimate`](crate::Refiner::estimate). It has the time limit of the stage.
#[must_use]
pub fn estimate_with<S: Stage>(stage: S) -> SearchFrom<S> {
    let options = SearchOptions {
        start: Start::Ignored,
        time_limit: stage.time_limit(),
        ..SearchOptions::default()
    };
    search_from(stage, options)
}

/// [`local`], followed by a search if the product of its doubt and its score stays above a
/// threshold.
///
/// The search scores poses with the MVE for the masks of detectors
/// ([`MeanVsd::imperfect_mask`]). To change the options, for example to set a bound:
///
/// ```
/// use hybrid_icp::icp::{Bound, SearchOptions};
/// use hybrid_icp::{Refiner, presets};
/// let bound = Bound { translation_meters: 0.05, rotation_degrees: 60.0 };
/// let options = SearchOptions { bound: Some(bound), ..SearchOptions::default() };
/// let refiner = Refiner::new(presets::search_with(options));
/// # let _ = refiner;
/// ```
#[must_use]
pub fn search_with(options: SearchOptions) -> Search {
    search_from(local(), options)
}

/// `search`: [`local`], followed by a search if the returned pose is doubtful.
///
/// The search starts if the product of doubt and score is above 0.002, or above 0.001 if the local
/// pose is far from the initial one. It ranks 1000 rotations, aligns the best 256 and refines 24.
/// If the local pose is near the initial one, it aligns and refines a quarter of these. Otherwise,
/// if the best pose is still bad, it once aligns all ranked rotations and refines twice as many. A
/// hypothesis must beat the local pose by a gain ([`SearchOptions::near_gain`],
/// [`SearchOptions::far_gain`]). The result can be far from the initial pose, also at a pose that
/// is equivalent by symmetry.
#[must_use]
pub fn search() -> Search {
    search_with(SearchOptions::default())
}

/// Lets color decide among the poses of a stage that depth cannot tell apart.
#[must_use]
pub fn by_color<S>(stage: S) -> ByColor<S> {
    // A rotation that the depth does not determine is the choice of the colors.
    let metric = Conditioned {
        metric: Photometric {
            weight_diameters: 0.02,
            samples: 1000,
            ..Photometric::default()
        },
        threshold: 5e-3,
        ..Conditioned::default()
    };
    let mut polish = projective(metric, 1000, 10);
    // Places that come into view may raise the loss of the colors.
    polish.stop.0.rise_tolerance = 0.5;
    ColorChoice::new(stage, polish, MeanVsd::imperfect_mask())
}

/// `color`: [`auto`], with the choice by color among the poses that depth cannot tell apart.
///
/// Without a color image or a colored model it is `auto`.
#[must_use]
pub fn color() -> ByColor<Search> {
    by_color(auto())
}

/// `auto`: as [`search()`], but near the initial pose the product of doubt and score must be above
/// 0.03.
#[must_use]
pub fn auto() -> Search {
    search_with(SearchOptions {
        threshold: 0.03,
        ..SearchOptions::default()
    })
}

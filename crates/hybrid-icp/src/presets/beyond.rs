//! The presets that go beyond the paper, composed of the same public parts.
//!
//! [`hybrid_visible`] and [`local`] refine the pose that they are given. [`search`] and [`auto`]
//! search for another one when that fails: they can end far from it, also at a pose that is
//! equivalent by symmetry. Their numbers were chosen on the ten tuning objects of `hicp-sim`;
//! `docs/presets.md` states the effect of each change.

use hicp_association::{
    AllSamples, MaxDistance, MaxNormalAngle, NearestNeighbor, ObservationToModel, Projective,
    Stride, VisibleSurface,
};
use hicp_icp::{
    Cascade, Convergence, Divergence, Guard, HypothesisSearch, Icp, IterationLimit, Repeat,
    SearchOptions,
};
use hicp_metric::{PointToPoint, Symmetric};
use hicp_score::{MeanVsd, SampledMve};
use hicp_switch::{PAPER_ALPHA, Switch, SwitchUntilStall, Threshold};

use super::PaperStop;

/// A projective stage whose pairs are at most a quarter of the diameter apart.
pub type GatedIcp<M> = Icp<VisibleSurface, Projective, MaxDistance, M, PaperStop>;
/// A stage that pairs observed points with points of the model.
pub type CloudToModelIcp<M> = Icp<AllSamples, ObservationToModel, (), M, PaperStop>;
/// The stage of estimates that agree with the image.
pub type Near = Cascade<(GatedIcp<PointToPoint>, GatedIcp<Symmetric>)>;
/// The stage of estimates that do not.
pub type Far = Cascade<(CloudToModelIcp<PointToPoint>, CloudToModelIcp<Symmetric>)>;
/// The type of [`hybrid_visible`].
pub type HybridVisible = Repeat<
    Switch<
        Threshold<MeanVsd>,
        Near,
        Icp<VisibleSurface, NearestNeighbor, MaxNormalAngle, PointToPoint, PaperStop>,
    >,
>;
/// The type of [`local`].
pub type Local = Cascade<(
    SwitchUntilStall<MeanVsd, Near, Far>,
    Guard<GatedIcp<Symmetric>, MeanVsd>,
)>;
/// The stage that refines hypotheses.
pub type Explore = SwitchUntilStall<MeanVsd, Near, CloudToModelIcp<PointToPoint>>;
/// The type of [`search`], [`auto`] and [`search_with`].
pub type Search = HypothesisSearch<Local, Explore, SampledMve, MeanVsd>;

/// τ_max of projective pairs, as a fraction of the diameter.
const TAU_DIAMETERS: f32 = 0.25;
/// θ_max of nearest neighbours, degrees.
const THETA_DEGREES: f32 = 90.0;

/// The paper's rules, but that a loss that rises with new pairs is no divergence.
fn stop(iterations: usize) -> PaperStop {
    (
        Divergence::count_aware(),
        Convergence::default(),
        IterationLimit(iterations),
    )
}

/// A projective stage of about so many points.
fn projective<M>(metric: M, points: usize, iterations: usize) -> GatedIcp<M> {
    Icp {
        selection: VisibleSurface {
            stride: Stride::AboutPoints(points),
        },
        association: Projective,
        filter: MaxDistance::diameters(TAU_DIAMETERS),
        metric,
        stop: stop(iterations),
    }
}

/// The near stage: the projective cascade with the symmetric metric in the place of point-to-plane.
fn near(points: usize) -> Near {
    Cascade((
        projective(PointToPoint, points, 50),
        projective(Symmetric, points, 50),
    ))
}

/// A stage that pairs so many observed points with points of the model, hidden ones too: passing those over costs time and,
/// from afar, where they hide is not known.
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

/// Where point-to-point from afar has done its part.
fn coarse() -> Convergence {
    Convergence {
        relative_change: 1e-2,
        ..Convergence::default()
    }
}

/// `hybrid-visible`: [`super::hybrid`] with the better reading of the paper's O.
///
/// O is the visible surface for nearest neighbours too, whose pairs are at most 90° apart; the second projective stage
/// minimises the symmetric metric, projective pairs are at most a quarter of the diameter apart, and rule 3 is count-aware.
#[must_use]
pub fn hybrid_visible() -> HybridVisible {
    Repeat {
        times: 2,
        stage: Switch {
            switcher: Threshold {
                score: MeanVsd::default(),
                alpha: PAPER_ALPHA,
            },
            aligned: near(2000),
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

/// `local`: local refinement that never returns a pose with a higher MVE than the initial one.
///
/// Up to six steps by [`SwitchUntilStall`] until the MVE stalls or is at most 0.1, the best pose by it kept: the projective cascade where
/// the estimate agrees with the image, else observed points matched to the model, point-to-point and then the symmetric metric. A
/// polish of twice as many points follows, which is accepted only if the MVE improves.
#[must_use]
pub fn local() -> Local {
    let far = (300, 5000);
    Cascade((
        SwitchUntilStall {
            score: MeanVsd::default(),
            alpha: PAPER_ALPHA,
            aligned: near(2000),
            misaligned: Cascade((
                observed(far, PointToPoint, coarse()),
                observed(far, Symmetric, Convergence::default()),
            )),
            max_steps: 6,
            min_gain: 0.01,
            good_enough: 0.1,
        },
        Guard {
            stage: projective(Symmetric, 4000, 5),
            score: MeanVsd::default(),
        },
    ))
}

/// What hypotheses are refined by: two steps of fewer points.
fn explore() -> Explore {
    SwitchUntilStall {
        score: MeanVsd::default(),
        alpha: PAPER_ALPHA,
        aligned: near(1000),
        misaligned: observed((150, 2000), PointToPoint, coarse()),
        max_steps: 2,
        min_gain: 0.01,
        good_enough: 0.02,
    }
}

/// [`local`], and a search where its MVE stays above a threshold. The search judges by an MVE that is lenient with masks that
/// miss a part of the object ([`MeanVsd::lenient`]). To change the options, such as to set a bound:
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
    HypothesisSearch::new(
        local(),
        explore(),
        SampledMve::lenient(),
        MeanVsd::lenient(),
        options,
    )
}

/// `search`: [`local`], and where its MVE stays above 0.15 a search over 256 rotations, of which 12 are refined.
///
/// Not local refinement: it can end anywhere, also at a pose that is equivalent by symmetry.
#[must_use]
pub fn search() -> Search {
    search_with(SearchOptions::default())
}

/// `auto`: [`local`], and where its MVE stays above 0.2 a search over 128 rotations, of which 6 are refined.
///
/// A hypothesis must beat the local pose by 0.05. Where that happens it is no local refinement any more.
#[must_use]
pub fn auto() -> Search {
    search_with(SearchOptions {
        threshold: 0.2,
        good_enough: 0.15,
        min_gain: 0.05,
        hypotheses: 128,
        refined: 6,
        ..SearchOptions::default()
    })
}

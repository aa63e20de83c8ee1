//! The presets as functions: Hybrid ICP, the eight baselines of the paper, and presets beyond it.
//!
//! Each is a plain composition of public components. The baselines are those of Table I. The
//! presets beyond the paper are [`hybrid_visible`], [`local`], [`search`], [`auto`] and [`color`].
//!
//! The sections of the paper: §III-A for the parts, §IV-B for the cascade and its divergence rules,
//! §IV-C for Hybrid ICP, §VI-B for the baselines. The paper leaves some choices open; its variants
//! share these:
//!
//! - O is the whole surface for nearest neighbors ([`AllSamples`]) and the visible one for
//!   projective association ([`VisibleSurface`], V_O rendered at the stage's initial pose).
//! - τ_max and θ_max are off.
//! - Every stage ends by the same rules: [`Divergence::strict`], convergence of the loss, 50
//!   iterations.
//!
//! Each preset has a named type whose fields are public, so that a program can change it:
//!
//! ```
//! use hybrid_icp::icp::LossRule;
//! use hybrid_icp::{Refiner, presets};
//! let mut stage = presets::hybrid();
//! stage.times = 3;
//! stage.stage.switcher.alpha = 0.3;
//! let (divergence, _, limit) = &mut stage.stage.misaligned.stop;
//! divergence.loss_rule = LossRule::CountAware;
//! limit.0 = 20;
//! let refiner = Refiner::new(stage);
//! # let _ = refiner;
//! ```
//!
//! To replace a part with one of another type, move the others over:
//!
//! ```
//! use hybrid_icp::metric::{Kernel, PointToPlane, Robust, Scale};
//! use hybrid_icp::icp::{Icp, Repeat};
//! use hybrid_icp::switch::Switch;
//! use hybrid_icp::{Refiner, presets};
//! let Repeat { times, stage: Switch { switcher, aligned, misaligned } } = presets::hybrid();
//! let metric = Robust::new(PointToPlane, Kernel::TUKEY, Scale::Mad { floor_meters: 1e-3 });
//! let Icp { selection, association, filter, stop, .. } = misaligned;
//! let misaligned = Icp { selection, association, filter, metric, stop };
//! let refiner = Refiner::new(Repeat { times, stage: Switch { switcher, aligned, misaligned } });
//! # let _ = refiner;
//! ```

mod beyond;

pub use beyond::{
    Align, ByColor, CloudToModelIcp, Explore, Far, Fit, GatedIcp, HybridVisible, Local, Near,
    Search, SearchFrom, Steps, auto, by_color, color, estimate_with, hybrid_visible, local, search,
    search_with,
};
pub(crate) use beyond::{far, fit, fit_of, look_alikes};

use hicp_association::{AllSamples, NearestNeighbor, Projective, VisibleSurface};
use hicp_icp::{Cascade, Convergence, Divergence, Icp, IterationLimit, Repeat};
use hicp_metric::{PointToPlane, PointToPoint};
use hicp_score::MeanVsd;
use hicp_switch::{PAPER_ALPHA, Switch, Threshold};

/// The stop rules of the paper's variants (§IV-B).
pub type PaperStop = (Divergence, Convergence, IterationLimit);

// Deviation: divergence rules of the baselines: §IV-B.2 states them for Cascading ICP. Here they
// end the single-metric baselines too, so that all variants differ in association and metric alone.
// It favors the baselines.
/// Returns the paper's rules: strict divergence, convergence of the loss, 50 iterations.
#[must_use]
pub fn paper_stop() -> PaperStop {
    (
        Divergence::strict(),
        Convergence::default(),
        IterationLimit::default(),
    )
}

/// An ICP stage as the paper's variants use it: no gates, the paper's stop rules.
pub type PaperIcp<P, A, M> = Icp<P, A, (), M, PaperStop>;
/// A stage of the paper with projective association.
pub type ProjectiveIcp<M> = PaperIcp<VisibleSurface, Projective, M>;
/// A stage of the paper with nearest neighbors.
pub type NearestIcp<M> = PaperIcp<AllSamples, NearestNeighbor, M>;
/// Cascading ICP with projective association, in either order.
pub type ProjectiveCascade<M, N> = Cascade<(ProjectiveIcp<M>, ProjectiveIcp<N>)>;
/// Cascading ICP with nearest neighbors, in either order.
pub type NearestCascade<M, N> = Cascade<(NearestIcp<M>, NearestIcp<N>)>;
/// The type of [`hybrid`].
pub type Hybrid = Repeat<
    Switch<
        Threshold<MeanVsd>,
        ProjectiveCascade<PointToPoint, PointToPlane>,
        NearestIcp<PointToPoint>,
    >,
>;

fn projective<M>(metric: M) -> ProjectiveIcp<M> {
    Icp {
        selection: VisibleSurface::default(),
        association: Projective,
        // Open: τ_max and θ_max: §III-A.1 mentions such limits and does not say whether the
        // variants use them. They are off, so that no limit has to be chosen.
        filter: (),
        metric,
        stop: paper_stop(),
    }
}

fn nearest<M>(metric: M) -> NearestIcp<M> {
    Icp {
        selection: AllSamples,
        association: NearestNeighbor::default(),
        filter: (),
        metric,
        stop: paper_stop(),
    }
}

/// `projective-point-to-point`: the visible surface, projective association, point-to-point.
#[must_use]
pub fn projective_point_to_point() -> ProjectiveIcp<PointToPoint> {
    projective(PointToPoint)
}

/// `projective-point-to-plane`: the visible surface, projective association, point-to-plane.
#[must_use]
pub fn projective_point_to_plane() -> ProjectiveIcp<PointToPlane> {
    projective(PointToPlane)
}

/// `projective-cascade-point-plane`: the paper's Cascading ICP (§IV-B) with projective association.
#[must_use]
pub fn projective_cascade_point_plane() -> ProjectiveCascade<PointToPoint, PointToPlane> {
    Cascade((projective(PointToPoint), projective(PointToPlane)))
}

/// `projective-cascade-plane-point`: the cascade in the other order.
#[must_use]
pub fn projective_cascade_plane_point() -> ProjectiveCascade<PointToPlane, PointToPoint> {
    Cascade((projective(PointToPlane), projective(PointToPoint)))
}

/// `nn-point-to-point`: the whole surface, nearest neighbors, point-to-point.
#[must_use]
pub fn nn_point_to_point() -> NearestIcp<PointToPoint> {
    nearest(PointToPoint)
}

/// `nn-point-to-plane`: the whole surface, nearest neighbors, point-to-plane.
#[must_use]
pub fn nn_point_to_plane() -> NearestIcp<PointToPlane> {
    nearest(PointToPlane)
}

/// `nn-cascade-point-plane`: Cascading ICP with nearest neighbors.
#[must_use]
pub fn nn_cascade_point_plane() -> NearestCascade<PointToPoint, PointToPlane> {
    Cascade((nearest(PointToPoint), nearest(PointToPlane)))
}

/// `nn-cascade-plane-point`: that cascade in the other order.
#[must_use]
pub fn nn_cascade_plane_point() -> NearestCascade<PointToPlane, PointToPoint> {
    Cascade((nearest(PointToPlane), nearest(PointToPoint)))
}

/// `hybrid`: Hybrid ICP (§IV-C), two passes of a switch between two stages.
///
/// A pass scores the pose by the MVE. Below α = 0.4 it runs the projective cascade, and otherwise
/// nearest-neighbor point-to-point.
#[must_use]
// Deviation: occluded pixels in the MVE: §IV-A.2 counts every pixel of both masks. Here a rendered
// pixel behind a measured surface outside the mask does not count. If nothing stands in front of
// the object, it is exactly the paper's MVE.
pub fn hybrid() -> Hybrid {
    Repeat {
        times: 2,
        stage: Switch {
            switcher: Threshold {
                score: MeanVsd::default(),
                alpha: PAPER_ALPHA,
            },
            aligned: projective_cascade_point_plane(),
            misaligned: nn_point_to_point(),
        },
    }
}

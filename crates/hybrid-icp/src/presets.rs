//! Hybrid ICP and the eight baselines of the paper's Table I, each a plain composition of public parts; and what goes beyond
//! the paper ([`hybrid_visible`], [`local`], [`search`], [`auto`]), in a file of its own.
//!
//! Read beside the paper: §III-A for the parts, §IV-B for the cascade and its divergence rules, §IV-C for Hybrid ICP,
//! §VI-B for the baselines. What those of the paper share where the paper leaves it open:
//!
//! - O is the whole surface for nearest neighbours ([`AllSamples`]) and the visible one for projective association
//!   ([`VisibleSurface`], V_O rendered at the stage's initial estimate).
//! - τ_max and θ_max are off.
//! - Every stage ends by the same rules: the paper's divergence rules as written, convergence of the loss, 50 iterations.

mod beyond;

pub use beyond::{auto, hybrid_visible, local, search, search_with};

use hicp_association::{
    AllSamples, DataAssociation, PointSelection, Projective, VisibleSurface, WarmNearestNeighbor,
};
use hicp_icp::{Cascade, Convergence, Divergence, Icp, IterationLimit, Repeat, Stage};
use hicp_metric::{ErrorMetric, PointToPlane, PointToPoint};
use hicp_score::MeanVsd;
use hicp_switch::{PAPER_ALPHA, Switch, Threshold};

/// When a stage of the paper's variants ends (§IV-B).
pub type PaperStop = (Divergence, Convergence, IterationLimit);

// Deviation: §IV-B states the divergence rules for Cascading ICP; here they end the single-metric baselines too, so that all
// variants differ in association and metric alone.
/// Returns the paper's rules: divergence as written, convergence of the loss, at most 50 iterations.
#[must_use]
pub fn paper_stop() -> PaperStop {
    (
        Divergence::strict(),
        Convergence::default(),
        IterationLimit::default(),
    )
}

/// An ICP stage as the paper's variants use it: no gates, the paper's stop rules.
type PaperIcp<P, A, M> = Icp<P, A, (), M, PaperStop>;

fn icp<P, A, M>(selection: P, association: A, metric: M) -> PaperIcp<P, A, M>
where
    P: PointSelection,
    A: DataAssociation,
    M: ErrorMetric,
{
    Icp {
        selection,
        association,
        filter: (),
        metric,
        stop: paper_stop(),
    }
}

fn projective<M: ErrorMetric>(metric: M) -> PaperIcp<VisibleSurface, Projective, M> {
    icp(VisibleSurface::default(), Projective, metric)
}

fn nearest<M: ErrorMetric>(metric: M) -> PaperIcp<AllSamples, WarmNearestNeighbor, M> {
    icp(AllSamples, WarmNearestNeighbor::default(), metric)
}

/// `projective-point-to-point`: the visible surface, projective association, point-to-point.
#[must_use]
pub fn projective_point_to_point() -> impl Stage + Send + Clone {
    projective(PointToPoint)
}

/// `projective-point-to-plane`: the visible surface, projective association, point-to-plane.
#[must_use]
pub fn projective_point_to_plane() -> impl Stage + Send + Clone {
    projective(PointToPlane)
}

/// `projective-cascade-point-plane`: the paper's Cascading ICP (§IV-B) with projective association.
#[must_use]
pub fn projective_cascade_point_plane() -> impl Stage + Send + Clone {
    Cascade((projective(PointToPoint), projective(PointToPlane)))
}

/// `projective-cascade-plane-point`: the cascade in the other order.
#[must_use]
pub fn projective_cascade_plane_point() -> impl Stage + Send + Clone {
    Cascade((projective(PointToPlane), projective(PointToPoint)))
}

/// `nn-point-to-point`: the whole surface, nearest neighbours, point-to-point.
#[must_use]
pub fn nn_point_to_point() -> impl Stage + Send + Clone {
    nearest(PointToPoint)
}

/// `nn-point-to-plane`: the whole surface, nearest neighbours, point-to-plane.
#[must_use]
pub fn nn_point_to_plane() -> impl Stage + Send + Clone {
    nearest(PointToPlane)
}

/// `nn-cascade-point-plane`: Cascading ICP with nearest neighbours.
#[must_use]
pub fn nn_cascade_point_plane() -> impl Stage + Send + Clone {
    Cascade((nearest(PointToPoint), nearest(PointToPlane)))
}

/// `nn-cascade-plane-point`: that cascade in the other order.
#[must_use]
pub fn nn_cascade_plane_point() -> impl Stage + Send + Clone {
    Cascade((nearest(PointToPlane), nearest(PointToPoint)))
}

/// `hybrid`: Hybrid ICP (§IV-C). Twice: score the estimate by the MVE; below α = 0.4 run the projective cascade, else
/// nearest-neighbour point-to-point.
// Deviation: occluded pixels do not count toward the MVE; where nothing stands in front of the object it is the paper's MVE exactly.
#[must_use]
pub fn hybrid() -> impl Stage + Send + Clone {
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

//! Custom components, which keep the laws of their trait.

mod allocations;
mod association;
mod filter;
mod fuser;
mod metric;
mod observer;
mod part;
mod renderer;
mod score;
mod selection;
mod stage;
mod stop_rule;
mod switcher;

use hybrid_icp::association::{DataAssociation, PointSelection};
use hybrid_icp::icp::{Divergence, Icp, IterationLimit, SmallMotion, Stage};
use hybrid_icp::metric::Minimize;

/// Returns a stage of the given parts, without a filter.
fn icp(
    selection: impl PointSelection,
    association: impl DataAssociation,
    metric: impl Minimize,
) -> impl Stage {
    Icp {
        selection,
        association,
        filter: (),
        metric,
        stop: (
            Divergence::count_aware(),
            SmallMotion::default(),
            IterationLimit(50),
        ),
    }
}

//! The ICP engine: the trait [`Stage`], generic ICP ([`Icp`], Algorithm 1 of the paper), stop rules with rollback, and stages made of stages.
//!
//! **Should you use this crate?** To compose an ICP variant without the presets, yes. To refine poses with one call, use `hybrid-icp`.
//!
//! ```
//! use hicp_association::{AllSamples, NearestNeighbor, Projective, VisibleSurface};
//! use hicp_icp::{Cascade, Convergence, Divergence, Icp, IterationLimit, Stage};
//! use hicp_metric::{PointToPlane, PointToPoint};
//!
//! fn projective_cascade() -> impl Stage {
//!     let stop = (Divergence::strict(), Convergence::default(), IterationLimit(50));
//!     let visible = VisibleSurface::default();
//!     Cascade((
//!         Icp { selection: visible, association: Projective, filter: (), metric: PointToPoint, stop },
//!         Icp { selection: visible, association: Projective, filter: (), metric: PointToPlane, stop },
//!     ))
//! }
//! # let _ = projective_cascade();
//! ```
//!
//! Modules in reading order: `stage` (trait), `icp` (the engine), `outcome`, `stop`, `divergence`, `motion` and `limits` (stop
//! rules), `compose` (cascade, repeat), `guard` (stages that answer to a score), `search` (from `hypotheses`), `resolution`, `anderson`, `session` (workspace), `observer`.

mod anderson;
mod compose;
mod divergence;
mod guard;
mod hypotheses;
mod icp;
mod limits;
mod motion;
mod observer;
mod outcome;
mod resolution;
mod search;
mod session;
mod stage;
mod stop;

pub use anderson::Anderson;
pub use compose::{Cascade, Repeat};
pub use divergence::{Divergence, LossRule};
pub use guard::{Guard, KeepBest};
pub use hypotheses::Rotations;
pub use icp::{Icp, MAX_ITERATIONS};
pub use limits::{AbsoluteLoss, Deadline, TimeLimit};
pub use motion::{Bound, Motion, Oscillation};
pub use observer::{IterationEvent, Observer, Regime, RegimeEvent, StageEvent};
pub use outcome::{Evaluation, Outcome, Quality, Termination, Verdict};
pub use resolution::AtResolution;
pub use search::{HypothesisSearch, SearchOptions};
pub use session::{Session, Workspace};
pub use stage::Stage;
pub use stop::{Convergence, IterationLimit, Progress, StopRule};

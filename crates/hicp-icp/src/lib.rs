//! The ICP engine: the trait [`Stage`], generic ICP, stop rules, and stages made of stages.
//!
//! Generic ICP is [`Icp`], Algorithm 1 of the paper. Its stop rules can reject a candidate, so that
//! a stage returns the pose before it. An [`Observer`] receives iterations, choices of switchers,
//! decisions about scored poses, and ends of stages.
//!
//! **Should you use this crate?** Yes, to compose an ICP variant without the presets. To refine
//! poses with one call, use `hybrid-icp`.
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

mod alternative;
mod observer;
mod outcome;
mod session;
mod stage;
mod stop;

pub use alternative::Alternative;
pub use observer::{DecisionEvent, IterationEvent, Observer, Regime, RegimeEvent, StageEvent};
pub use outcome::{Evaluation, Outcome, Quality, Termination, Verdict};
pub use session::{Session, Workspace};
pub use stage::*;
pub use stop::*;

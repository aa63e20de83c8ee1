//! The ICP engine: the trait [`Stage`], generic ICP, stop rules, and stages made of stages.
//!
//! - **Generic ICP** is [`Icp`], Algorithm 1 of the paper.
//! - **Composition**: [`Cascade`] and [`Repeat`] run stages in sequence. [`Guard`] and [`KeepBest`]
//!   keep a pose only if a score improves. [`AtResolution`] runs a stage on fewer pixels, and
//!   [`Anderson`] accelerates one.
//! - **Other refiners**: [`Descent`] lowers a score directly. [`RayShift`] is the baseline that
//!   shifts the object along its ray.
//! - **Search**: [`HypothesisSearch`] tries other poses, [`ColorChoice`] lets color decide among
//!   them, and [`LookAlikeCount`] counts those that depth cannot tell apart.
//! - **Stop rules**: [`Divergence`], [`Convergence`], [`AbsoluteLoss`], [`SmallMotion`], [`Bound`],
//!   [`Oscillation`], [`IterationLimit`], [`TimeLimit`] and [`Deadline`]. A rule can reject a
//!   candidate, so that a stage returns the pose before it.
//! - **Observers**: an [`Observer`] receives iterations, choices of switchers, decisions about
//!   scored poses, and ends of stages.
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

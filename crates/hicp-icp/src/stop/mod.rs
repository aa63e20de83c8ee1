//! Stop rules: when an ICP stage ends, and whether its last candidate is accepted.

pub(crate) mod convergence;
pub(crate) mod divergence;
pub(crate) mod limits;
pub(crate) mod motion;
pub(crate) mod stop_rule;

pub use convergence::{AbsoluteLoss, Convergence};
pub use divergence::{Divergence, LossRule};
pub use limits::{Deadline, IterationLimit, TimeLimit};
pub use motion::{Bound, Oscillation, SmallMotion};
pub use stop_rule::{Judgment, Progress, StopRule};

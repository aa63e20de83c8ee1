//! Stop rules: when an ICP stage ends, and whether its last candidate is accepted.

pub(crate) mod divergence;
pub(crate) mod limits;
pub(crate) mod motion;
pub(crate) mod stop_rule;

pub use divergence::{Divergence, LossRule};
pub use limits::{AbsoluteLoss, Deadline, TimeLimit};
pub use motion::{Bound, Oscillation, SmallMotion};
pub use stop_rule::{Convergence, IterationLimit, Progress, StopRule};

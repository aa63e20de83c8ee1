//! Means of a study with intervals, and differences between its variants.

mod bootstrap;
mod cell;
mod interval;
mod metric;

pub use bootstrap::{Analysis, REPLICATES};
pub use cell::Cell;
pub(crate) use interval::percent;
pub use interval::{Interval, never_seen, quantile};
pub use metric::{ADD_SHARE, FAILURE_VSD, Metric, WORSE_VSD};

//! Decorators: metrics that wrap another metric.

pub(crate) mod conditioned;
pub(crate) mod frozen;
pub(crate) mod gauss_newton;
pub(crate) mod kernel;
pub(crate) mod levenberg_marquardt;
pub(crate) mod metric_schedule;
pub(crate) mod moved;
pub(crate) mod photometric;
pub(crate) mod pose_prior;
pub(crate) mod robust;

pub use conditioned::Conditioned;
pub use frozen::{Frame, Frozen};
pub use gauss_newton::GaussNewton;
pub use kernel::{Kernel, RobustKernel};
pub use levenberg_marquardt::LevenbergMarquardt;
pub use metric_schedule::MetricSchedule;
pub use photometric::Photometric;
pub use pose_prior::{PosePrior, Prior};
pub use robust::{Robust, Scale};

//! Error metrics: the functions that are minimized over the pairs.

pub(crate) mod error_metric;
pub(crate) mod generalized;
pub(crate) mod minimize;
pub(crate) mod plane_to_point;
pub(crate) mod point_to_plane;
pub(crate) mod point_to_point;
pub(crate) mod symmetric;
pub(crate) mod weighted_sum;

pub use error_metric::{ErrorMetric, NO_ROWS, Step};
pub use generalized::Generalized;
pub use minimize::Minimize;
pub use plane_to_point::PlaneToPoint;
pub use point_to_plane::PointToPlane;
pub use point_to_point::PointToPoint;
pub use symmetric::Symmetric;
pub use weighted_sum::{Terms, WeightedSum};

//! Error metrics: the trait [`ErrorMetric`], [`PointToPoint`] and [`PointToPlane`], and the [`NormalEquations`] that
//! iterative metrics share.
//!
//! **Should you use this crate?** To write a metric of your own, or to align pairs that you already have. To refine poses,
//! use `hybrid-icp`.
//!
//! ```
//! use hicp_core::{Correspondences, Pair, Point3, Surfel, UnitVector3, Vector3};
//! use hicp_metric::{ErrorMetric, PointToPoint};
//!
//! let surfel = |x, y, z| Surfel { point: Point3::new(x, y, z), normal: UnitVector3::new_normalize(Vector3::z()) };
//! // Three points and their counterparts, half a metre further along x.
//! let pairs: Correspondences = [(0.0, 0.0, 1.0), (0.2, 0.0, 1.0), (0.0, 0.1, 1.0)]
//!     .into_iter()
//!     .map(|(x, y, z)| Pair::new(0, surfel(x, y, z), 0, surfel(x + 0.5, y, z)))
//!     .collect();
//! let step = PointToPoint.minimize(&pairs).ok_or("undetermined").unwrap();
//! assert!((step.increment.translation.vector - Vector3::new(0.5, 0.0, 0.0)).norm() < 1e-6);
//! assert!((step.mean_loss - 0.25).abs() < 1e-6);
//! ```
//!
//! Modules in reading order: `metric` (trait), `point_to_point`, `point_to_plane`, `normal_equations`.

mod metric;
mod normal_equations;
mod point_to_plane;
mod point_to_point;

pub use metric::{ErrorMetric, Step};
pub use normal_equations::NormalEquations;
pub use point_to_plane::PointToPlane;
pub use point_to_point::PointToPoint;

//! The traits [`ErrorMetric`] (of one pair) and [`Minimize`] (of all pairs), metrics, and
//! decorators.
//!
//! Decorators make a metric robust, constrain it, or iterate it.
//!
//! **Should you use this crate?** Yes, to write a custom metric, or to align pairs that you already
//! have. To refine poses, use `hybrid-icp`.
//!
//! ```
//! use hicp_core::{Correspondences, Pair, Point3, Surfel, UnitVector3, Vector3};
//! use hicp_metric::{ErrorMetric, PointToPoint};
//!
//! let surfel = |x, y, z| Surfel { point: Point3::new(x, y, z), normal: UnitVector3::new_normalize(Vector3::z()) };
//! // Three points and their counterparts, half a meter farther along x.
//! let pairs: Correspondences = [(0.0, 0.0, 1.0), (0.2, 0.0, 1.0), (0.0, 0.1, 1.0)]
//!     .into_iter()
//!     .map(|(x, y, z)| Pair::new(0, surfel(x, y, z), 0, surfel(x + 0.5, y, z)))
//!     .collect();
//! let step = PointToPoint.step(&pairs).ok_or("undetermined").unwrap();
//! assert!((step.increment.translation.vector - Vector3::new(0.5, 0.0, 0.0)).norm() < 1e-6);
//! assert!((step.mean_loss - 0.25).abs() < 1e-6);
//! ```
//!
//! **Metrics**: [`PointToPoint`], [`PointToPlane`], [`PlaneToPoint`] (the model's normals),
//! [`Symmetric`] (both normals, exact in one step), [`Generalized`] (both normals, and a small
//! influence of tangential offsets), and [`WeightedSum`] of several.
//!
//! **Decorators**, which implement [`Minimize`]:
//!
//! - [`Robust`]: a [`Kernel`] against outliers.
//! - [`PosePrior`]: a Gaussian prior of the pose.
//! - [`Photometric`]: the colors of the image.
//! - [`Conditioned`]: a policy for [`Degeneracy`].
//! - [`Frozen`]: fixed degrees of freedom.
//! - [`GaussNewton`] and [`LevenbergMarquardt`]: iterations over fixed pairs.
//! - [`MetricSchedule`]: one metric per iteration.
//!
//! Nest them in this order, from the inside out. A kernel then weighs the data and not the prior,
//! and a solver respects frozen degrees of freedom:
//!
//! ```
//! use hicp_metric::{Frame, Frozen, Kernel, LevenbergMarquardt, PointToPlane, Robust, Scale};
//!
//! let robust = Robust::new(PointToPlane, Kernel::TUKEY, Scale::Mad { floor_meters: 0.001 });
//! // A bottle: do not refine the rotation around its axis.
//! let metric = LevenbergMarquardt::new(Frozen {
//!     metric: robust,
//!     frame: Frame::Object,
//!     translation: [false; 3],
//!     rotation: [false, false, true],
//! });
//! # let _ = metric;
//! ```
//!
//! [`Minimize::system`] shows which motions the pairs determine: see
//! [`NormalEquations::observability`],
//! [`NormalEquations::information`] and [`NormalEquations::covariance`].

mod decorator;
mod metric;
mod system;

pub use decorator::*;
pub use metric::*;
pub use system::*;

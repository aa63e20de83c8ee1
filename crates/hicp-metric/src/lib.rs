//! Error metrics: the traits [`ErrorMetric`] (of one pair) and [`Minimize`] (of all pairs), the metrics, and the decorators
//! that make them robust, constrain them or iterate them.
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
//! let step = PointToPoint.step(&pairs).ok_or("undetermined").unwrap();
//! assert!((step.increment.translation.vector - Vector3::new(0.5, 0.0, 0.0)).norm() < 1e-6);
//! assert!((step.mean_loss - 0.25).abs() < 1e-6);
//! ```
//!
//! **Metrics**: [`PointToPoint`], [`PointToPlane`], [`PlaneToPoint`] (the model's normals), [`Symmetric`] (both normals, exact in
//! one step), [`Generalized`] (both normals, tangential offsets count a little), [`WeightedSum`] of several.
//!
//! **Decorators**, each a [`Minimize`] again: [`Robust`] (a [`Kernel`] against outliers), [`PosePrior`], [`Conditioned`] (a policy for
//! [`Degeneracy`]), [`Frozen`] (degrees of freedom held), [`GaussNewton`] and [`LevenbergMarquardt`] (iterations over fixed
//! pairs), [`MetricSchedule`] (one metric per iteration). From the inside out, that is the order in which they make sense: a kernel weighs data and not the prior, and a
//! solver heeds what was held:
//!
//! ```
//! use hicp_metric::{Frame, Frozen, Kernel, LevenbergMarquardt, PointToPlane, Robust, Scale};
//!
//! let robust = Robust::new(PointToPlane, Kernel::TUKEY, Scale::Mad { floor_meters: 0.001 });
//! // A bottle: the turn about its own axis is not to be refined.
//! let metric = LevenbergMarquardt::new(Frozen {
//!     metric: robust,
//!     frame: Frame::Object,
//!     translation: [false; 3],
//!     rotation: [false, false, true],
//! });
//! # let _ = metric;
//! ```
//!
//! **What the pairs determine** is read from [`Minimize::system`]: [`NormalEquations::observability`],
//! [`NormalEquations::information`] and [`NormalEquations::covariance`].

mod decorator;
mod metric;
mod system;

pub use decorator::*;
pub use metric::*;
pub use system::*;

//! The result of an iterative fusion, and its limits.

use crate::estimate::PoseEstimate;

/// The limits of the iteration of [`Fusion`](crate::Fusion).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FusionLimits {
    /// Largest number of evaluations of the cost.
    pub max_iterations: usize,
    /// Norm |ε| of a step, in meters and radians, below which the solver has converged.
    pub tolerance: f64,
}

impl Default for FusionLimits {
    /// 50 evaluations and 10⁻¹⁰.
    ///
    /// Estimates that spread over 0.1 rad need about 6 evaluations, and over 0.4 rad about 9.
    fn default() -> Self {
        Self {
            // Open: evaluations of a fusion: §V. Estimates that spread over 0.4 rad need about 9.
            max_iterations: 50,
            // Open: last step of a fusion: §V. Meters and radians together, far below any pose
            // error.
            tolerance: 1e-10,
        }
    }
}

/// The convergence report of an iterative fusion: evaluations, cost, and whether it converged.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Solution {
    /// Number of evaluations of the cost; 0 if nothing was solved.
    pub iterations: usize,
    /// V = ½ Σ ξₖᵀ Σₖ⁻¹ ξₖ at the last evaluated pose.
    ///
    /// For K estimates whose covariances are right, it is about 3(K − 1).
    pub cost: f64,
    /// `true` if the last step was shorter than the tolerance.
    ///
    /// Otherwise the pose is the best evaluated one.
    pub converged: bool,
}

impl Solution {
    /// The result of a method that solves nothing, such as [`LastEstimate`](crate::LastEstimate).
    pub const NONE: Self = Self {
        iterations: 0,
        cost: 0.0,
        converged: true,
    };

    /// Creates the result of a custom iteration; see the fields.
    #[must_use]
    pub fn new(iterations: usize, cost: f64, converged: bool) -> Self {
        Self {
            iterations,
            cost,
            converged,
        }
    }
}

/// Several estimates fused into one.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Fused {
    /// The fused pose, without an MVE.
    ///
    /// Its covariance is A⁻¹ at the minimum (Laplace). It is valid if the covariances of the
    /// estimates are right and their errors independent.
    pub estimate: PoseEstimate,
    /// The convergence of the solver.
    pub solution: Solution,
}

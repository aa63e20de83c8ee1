//! The result of an iterative fusion, and its limits.

use crate::estimate::PoseEstimate;

/// When the iteration of [`Fusion`](crate::Fusion) ends.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FusionLimits {
    /// Largest number of evaluations of the cost.
    pub max_iterations: usize,
    /// Length |ε| of a step, meters and radians in one, below which it is the last.
    pub tolerance: f64,
}

impl Default for FusionLimits {
    /// 50 evaluations, 10⁻¹⁰. Estimates that spread over 0.1 rad need about 6 evaluations, over 0.4
    /// rad about 9.
    fn default() -> Self {
        Self {
            max_iterations: 50,
            tolerance: 1e-10,
        }
    }
}

/// How an iteration ended.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Solution {
    /// Evaluations of the cost; 0 if nothing was solved.
    pub iterations: usize,
    /// V = ½ Σ ξₖᵀ Σₖ⁻¹ ξₖ at the pose evaluated last: about 3(K − 1) for K estimates whose
    /// covariances are right.
    pub cost: f64,
    /// Whether the last step was shorter than the tolerance. Otherwise the pose is the best one
    /// evaluated.
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
    /// The fused pose, without an MVE. Its covariance is A⁻¹ at the minimum (Laplace), which holds
    /// if the covariances of the estimates are right and their errors independent.
    pub estimate: PoseEstimate,
    /// How the iteration ended.
    pub solution: Solution,
}

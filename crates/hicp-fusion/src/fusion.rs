//! Barfoot & Furgale's fusion of any number of pose estimates.

use hicp_core::internal::small::{blocks, cholesky6, inverse_of, solve6};
use hicp_core::{Isometry3, Matrix3, Matrix6, Vector3, Vector6, se3};

use crate::estimate::{FusionError, PoseEstimate};
use crate::information::{information, symmetrized};
use crate::solution::{Fused, FusionLimits, Solution};

/// The fusion of Barfoot & Furgale (T-RO 2014, §V), by Gauss–Newton on SE(3).
///
/// It minimizes V(T) = ½ Σ ξₖᵀ Σₖ⁻¹ ξₖ with ξₖ = ln(T Tₖ⁻¹)^∨. With Gₖ = 𝓙(ξₖ)⁻¹ (the *left*
/// Jacobian for this sign of ξ), an evaluation computes A = Σ Gₖᵀ Σₖ⁻¹ Gₖ and b = Σ Gₖᵀ Σₖ⁻¹ ξₖ.
/// The step is ε = −A⁻¹ b, T ← exp(ε^) T. A step that raises V is halved until it does not.
/// Estimates scattered over half turns, between which V has several minima, therefore end in one of
/// them.
///
/// The workspace reuses its memory: pushing at most as many estimates as before allocates nothing.
/// Cost: an inversion per estimate, and per evaluation and estimate a logarithm, a Jacobian and two
/// products of 6×6 matrices.
#[derive(Clone, Debug, Default)]
pub struct Fusion {
    /// The limits of the iteration.
    pub limits: FusionLimits,
    terms: Vec<Term>,
}

#[derive(Clone, Copy, Debug)]
struct Term {
    object_from_camera: Isometry3<f64>,
    information: Matrix6<f64>,
    /// The blocks of the information: ρρ, ρφ, φφ.
    blocks: [Matrix3<f64>; 3],
}

/// V, its Gauss–Newton Hessian and half of its gradient at a pose.
struct Linearization {
    cost: f64,
    hessian: Matrix6<f64>,
    gradient: Vector6<f64>,
}

impl Fusion {
    /// Creates an empty workspace.
    #[must_use]
    pub fn new(limits: FusionLimits) -> Self {
        Self {
            limits,
            terms: Vec::new(),
        }
    }

    /// Removes the estimates and keeps the memory.
    pub fn clear(&mut self) {
        self.terms.clear();
    }

    /// Adds an estimate.
    ///
    /// Directions without variance get the standard deviation
    /// [`MIN_STANDARD_DEVIATION`](crate::MIN_STANDARD_DEVIATION).
    pub fn push(&mut self, estimate: &PoseEstimate) {
        self.push_weighted(&estimate.camera_from_object, &estimate.covariance);
    }

    /// Adds a pose with the covariance for its weight.
    pub(crate) fn push_weighted(
        &mut self,
        camera_from_object: &Isometry3<f64>,
        weight_covariance: &Matrix6<f64>,
    ) {
        let information = information(weight_covariance);
        let block = |i, j| information.fixed_view::<3, 3>(i, j).into_owned();
        self.terms.push(Term {
            object_from_camera: camera_from_object.inverse(),
            information,
            blocks: [block(0, 0), block(0, 3), block(3, 3)],
        });
    }

    /// Removes the estimate that was added first.
    pub(crate) fn remove_first(&mut self) {
        if !self.terms.is_empty() {
            self.terms.remove(0);
        }
    }

    /// Number of estimates.
    #[must_use]
    pub fn len(&self) -> usize {
        self.terms.len()
    }

    /// Returns whether there are no estimates.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.terms.is_empty()
    }

    /// Returns V, which has no unit, at a pose `camera_from_object`.
    #[must_use]
    pub fn cost(&self, camera_from_object: &Isometry3<f64>) -> f64 {
        let half_square = |term: &Term| {
            let xi = se3::log(&(camera_from_object * term.object_from_camera));
            0.5 * xi.dot(&(term.information * xi))
        };
        self.terms.iter().map(half_square).sum()
    }

    /// Minimizes V from a start pose, `camera_from_object`.
    ///
    /// Returns a single estimate up to rounding, and `None` without estimates, or if the start is
    /// not finite.
    #[must_use]
    pub fn solve(&self, start: &Isometry3<f64>) -> Option<Fused> {
        if !se3::is_finite(start) {
            return None;
        }
        let mut pose = *start;
        let mut at = self.linearize(&pose);
        let mut iterations = 1;
        let mut converged = false;
        while iterations < self.limits.max_iterations.max(1) {
            let Some(factor) = cholesky6(&at.hessian) else {
                break;
            };
            let mut step = -solve6(&factor, &at.gradient);
            if !step.iter().all(|x| x.is_finite()) {
                break;
            }
            if step.norm() < self.limits.tolerance {
                // Below the tolerance, the step certainly improves the pose and is not worth an
                // evaluation.
                pose = se3::compose(&se3::exp(&step), &pose);
                converged = true;
                break;
            }
            // Invariant: `at` belongs to `pose`, and its cost never rises by more than rounding.
            // Deviation: steps of the fusion: §V fuses by Barfoot & Furgale, who take full
            // Gauss–Newton steps. Here a step that raises the cost is halved, because poses that
            // scatter over half turns would otherwise not converge.
            let highest = at.cost * (1.0 + 1e-12);
            let (candidate, linearization, falls) = loop {
                let candidate = se3::compose(&se3::exp(&step), &pose);
                let linearization = self.linearize(&candidate);
                iterations += 1;
                let falls = linearization.cost <= highest;
                if falls
                    || iterations >= self.limits.max_iterations
                    || step.norm() < self.limits.tolerance
                {
                    break (candidate, linearization, falls);
                }
                step *= 0.5;
            };
            if !falls {
                // The smallest step raises V: the pose is as near to a minimum as rounding allows,
                // or no evaluations are left.
                converged = step.norm() < self.limits.tolerance;
                break;
            }
            (pose, at) = (candidate, linearization);
        }
        Some(Fused {
            estimate: PoseEstimate {
                camera_from_object: pose,
                covariance: self.covariance(&at)?,
                mve: None,
            },
            solution: Solution::new(iterations, at.cost, converged),
        })
    }

    /// Returns the covariance of the fused pose for estimates with other covariances than their
    /// weights, such as constant or robust ones.
    ///
    /// Push each pose with the covariance that weighs it, and solve. `fused` is that solution, and
    /// `own` holds the covariance Cₖ of each estimate, in the order of pushing. The result is
    /// A⁻¹ (Σ Gₖᵀ Wₖ Hₖ Cₖ Hₖᵀ Wₖ Gₖ) A⁻¹ with Wₖ = Σₖ⁻¹ and Hₖ = 𝓙(−ξₖ)⁻¹.
    #[must_use]
    pub fn covariance_from<'a>(
        &self,
        fused: &PoseEstimate,
        own: impl Iterator<Item = &'a Matrix6<f64>>,
    ) -> Matrix6<f64> {
        let mut middle = Matrix6::zeros();
        for (term, own) in self.terms.iter().zip(own) {
            let xi = se3::log(&(fused.camera_from_object * term.object_from_camera));
            let left = se3::left_jacobian_inverse(&xi);
            // 𝓙(−ξ)⁻¹ = 𝓙(ξ)⁻¹ + ξ⋏, as x/(1 − e⁻ˣ) = x/(eˣ − 1) + x.
            let right = left + se3::curly_hat(&xi);
            let gain = left.tr_mul(&(term.information * right));
            middle += gain * own * gain.transpose();
        }
        symmetrized(&(fused.covariance * middle * fused.covariance))
    }

    /// Linearizes by 3×3 blocks: G = [D B; 0 D] and Σ⁻¹ = [W₁₁ W₁₂; W₁₂ᵀ W₂₂].
    fn linearize(&self, camera_from_object: &Isometry3<f64>) -> Linearization {
        let mut cost = 0.0;
        let (mut g1, mut g2) = (Vector3::zeros(), Vector3::zeros());
        let (mut h11, mut h12, mut h22) = (Matrix3::zeros(), Matrix3::zeros(), Matrix3::zeros());
        for term in &self.terms {
            let relative = camera_from_object * term.object_from_camera;
            let (xi, d, b) = se3::log_and_left_jacobian_inverse(&relative);
            let [w11, w12, w22] = &term.blocks;
            let rho = Vector3::new(xi[0], xi[1], xi[2]);
            let phi = Vector3::new(xi[3], xi[4], xi[5]);
            let (y1, y2) = (w11 * rho + w12 * phi, w12.tr_mul(&rho) + w22 * phi);
            cost += 0.5 * (rho.dot(&y1) + phi.dot(&y2));
            let (dt, bt) = (d.transpose(), b.transpose());
            g1 += dt * y1;
            g2 += bt * y1 + dt * y2;
            let right = w11 * b + w12 * d;
            h11 += dt * (w11 * d);
            h12 += dt * right;
            h22 += bt * right + dt * (w12.transpose() * b + w22 * d);
        }
        let mut hessian = blocks(&h11, &h12, &h22);
        let mut below = hessian.fixed_view_mut::<3, 3>(3, 0);
        below.copy_from(&h12.transpose());
        Linearization {
            cost,
            hessian,
            gradient: Vector6::new(g1.x, g1.y, g1.z, g2.x, g2.y, g2.z),
        }
    }

    /// Returns A⁻¹, or the covariance of the most certain estimate if rounding made A indefinite.
    fn covariance(&self, at: &Linearization) -> Option<Matrix6<f64>> {
        let inverse = cholesky6(&at.hessian).map(|factor| inverse_of(&factor));
        if let Some(inverse) = inverse.filter(|inverse| inverse.iter().all(|x| x.is_finite())) {
            return Some(symmetrized(&inverse));
        }
        self.terms
            .iter()
            .map(|term| term.information)
            .max_by(|a, b| a.trace().total_cmp(&b.trace()))
            .map(|surest| information(&symmetrized(&surest)))
    }
}

/// Fuses estimates with [`Fusion`], starting from the one with the smallest tr Σ.
///
/// It allocates. A caller that fuses often keeps a [`Fusion`].
///
/// # Errors
///
/// [`FusionError::Empty`] without estimates. An iteration that does not converge is not an error;
/// see [`Fused::solution`].
///
/// ```
/// use hicp_core::{Isometry3, Matrix6};
/// use hicp_fusion::{FusionError, FusionLimits, PoseEstimate, fuse};
/// # fn main() -> Result<(), FusionError> {
/// // Two cameras disagree by 2 mm; the second has twice the standard deviation.
/// let a = PoseEstimate::new(Isometry3::translation(0.0, 0.0, 0.500), Matrix6::identity() * 1e-6)?;
/// let b = PoseEstimate::new(Isometry3::translation(0.0, 0.0, 0.502), Matrix6::identity() * 4e-6)?;
/// let fused = fuse(&[a, b], FusionLimits::default())?;
/// assert!((fused.estimate.camera_from_object().translation.z - 0.5004).abs() < 1e-12);
/// assert!((fused.estimate.covariance()[(0, 0)] - 0.8e-6).abs() < 1e-12);
/// assert!(fused.solution.converged);
/// # Ok(()) }
/// ```
pub fn fuse(estimates: &[PoseEstimate], limits: FusionLimits) -> Result<Fused, FusionError> {
    let mut fusion = Fusion::new(limits);
    for estimate in estimates {
        fusion.push(estimate);
    }
    estimates
        .iter()
        .min_by(|a, b| a.covariance.trace().total_cmp(&b.covariance.trace()))
        .and_then(|surest| fusion.solve(&surest.camera_from_object))
        .ok_or(FusionError::Empty)
}

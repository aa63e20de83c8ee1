//! Gradient, information and covariance of the pose that the pairs determine.

use hicp_core::{Matrix6, Vector6};

use crate::degeneracy::eigen;
use crate::freedom::reduce;
use crate::normal_equations::NormalEquations;

/// Ratio to the largest eigenvalue below which a direction is without information: points of 5 cm at 1 m in `f32` leave
/// 10⁻¹² of it where there should be none.
const RANK_TOLERANCE: f64 = 1e-9;

impl NormalEquations {
    /// Returns JᵀWJ for the twist ξ = [ρ; φ] about the *camera origin*, unscaled: metres, radians, translation first, a left
    /// perturbation of `camera_from_object`.
    ///
    /// The units are those of the weights per m², per m·rad and per rad²: divided by the variance of a residual of weight 1 it
    /// is Fisher's information. To move it to another frame: Ad(A)⁻ᵀ Λ Ad(A)⁻¹ when poses move as A T.
    #[must_use]
    pub fn information(&self) -> Matrix6<f64> {
        let scaled = self.scaled_from_camera();
        scaled.transpose() * self.full_hessian() * scaled
    }

    /// Returns JᵀWr, half the gradient of the loss for the twist of [`NormalEquations::information`]: zero at a minimum.
    #[must_use]
    pub fn gradient(&self) -> Vector6<f64> {
        self.scaled_from_camera().transpose() * self.gradient
    }

    /// Returns the covariance Σ = s² (JᵀWJ)⁻¹ of ξ = [ρ; φ], in the frame and order of [`NormalEquations::information`],
    /// with s² = Σ w r²/(N − 6) over the N rows of positive weight.
    ///
    /// It holds for residuals that are independent, with variances inversely proportional to their weights, at the pose that
    /// minimises the loss, and for the right pairs: wrong pairs and common errors are not in it, so it is optimistic for ICP
    /// (Censi 2007; Bonnabel, Barczyk & Goulette 2016). Neighbouring pixels are correlated; a robust kernel's weights shrink Σ w r².
    ///
    /// Components that are held ([`NormalEquations::freeze`]) have no variance and N − 6 becomes N less the number of free ones.
    /// `None` where the rows do not determine all that is free, or no row is left over, or a number is not finite.
    #[must_use]
    pub fn covariance(&self) -> Option<Matrix6<f64>> {
        let n_free = self.n_free();
        let spare = self.rows.checked_sub(n_free).filter(|spare| *spare > 0)?;
        #[allow(clippy::cast_precision_loss)] // Counts far below 2⁵³.
        let variance = self.loss() / spare as f64;
        let basis = self.basis();
        let (mut reduced, _) = reduce(&basis, &self.full_hessian(), &self.gradient);
        self.fill_held(&mut reduced);
        let eigenvalues = eigen(reduced)?.eigenvalues;
        if eigenvalues.min() <= RANK_TOLERANCE * eigenvalues.max() {
            return None;
        }
        // Inverted where it is well conditioned, about the pivot, and carried to the camera origin after. The columns of held
        // components are zero.
        let carried = self.camera_from_scaled() * basis;
        let covariance = carried * reduced.cholesky()?.inverse() * carried.transpose() * variance;
        // Symmetric to the bit.
        let covariance = (covariance + covariance.transpose()) * 0.5;
        covariance
            .iter()
            .all(|x| x.is_finite())
            .then_some(covariance)
    }
}

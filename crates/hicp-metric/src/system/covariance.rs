//! Gradient, information and covariance of the pose that the pairs determine.

use hicp_core::{Correspondences, Matrix6, Vector6};

use crate::metric::error_metric::ErrorMetric;
use crate::system::freedom::reduce;
use crate::system::normal_equations::NormalEquations;
use crate::system::solve::eigen;

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
        scaled.transpose() * self.scaled_hessian() * scaled
    }

    /// Returns JᵀWr, half the gradient of the loss for the twist of [`NormalEquations::information`]: zero at a minimum.
    #[must_use]
    pub fn gradient(&self) -> Vector6<f64> {
        self.scaled_from_camera().transpose() * self.scaled_gradient()
    }

    /// Returns the covariance Σ = s² (JᵀWJ)⁻¹ of ξ = [ρ; φ], in the frame and order of [`NormalEquations::information`],
    /// with s² = Σ w r²/(N − 6) over the N rows of positive weight.
    ///
    /// It holds for residuals that are independent, with variances inversely proportional to their weights, at the pose that
    /// minimises the loss, and for the right pairs: wrong pairs and common errors are not in it, so it is optimistic for ICP
    /// (Censi 2007; Bonnabel, Barczyk & Goulette 2016). Neighbouring pixels are correlated; a robust kernel's weights shrink Σ w r².
    ///
    /// Mean ξᵀΣ⁻¹ξ, 6 if Σ is right, over 300 runs on noisy images (0.2 % of the depth, three synthetic objects): 6.1 to 6.4 with the right pairs,
    /// exact normals and exact weights; 5.1 to 5.8 for projective plane-to-point and 4.8 to 6.3 for point-to-plane when the points are selected anew where the
    /// last stage starts; 11 to 26 when they stay those visible 1 mm and 1° off, for pixels beside the silhouette then have wrong pairs. At 0.5 %
    /// noisy normals take point-to-plane of a thin object to 13. [`crate::Generalized`] gives 22 to 34 even with the right pairs:
    /// [`crate::sandwich_covariance`] is for it. Reproduce with `cargo run --release -p hicp-tests --example nees_report 300`.
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
        let (mut reduced, _) = reduce(&basis, &self.scaled_hessian(), &self.scaled_gradient());
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

/// Returns the sandwich covariance H⁻¹ (Σ gᵢ gᵢᵀ) H⁻¹ · N/(N − 6) of ξ = [ρ; φ] over the N pairs of positive weight, with
/// gᵢ = Jᵢᵀ Wᵢ rᵢ each pair's own gradient (White 1980), in the frame and order of [`NormalEquations::information`].
///
/// Pairs must be independent and the right ones, as for [`NormalEquations::covariance`], but the weights need not be inverse
/// variances and the rows of one pair may depend on each other. That is the case of [`crate::Generalized`]: its tangential rows carry
/// no noise like that of its normal ones, so the plain covariance is four to five times too small. Mean ξᵀΣ⁻¹ξ, 6 if right, of
/// projective Generalized ICP at 0.2 % of noise: 5.6 to 6.2 in place of 22 to 29, and 5.6 to 5.9 at 0.5 %; nearest neighbours are drawn to the
/// noise and give 20 at 0.5 % (`cargo run --release -p hicp-tests --example nees_report 300`).
///
/// `None` where the pairs do not determine all six directions. Cost: two linearisations.
pub fn sandwich_covariance<M: ErrorMetric + ?Sized>(
    metric: &M,
    pairs: &Correspondences,
) -> Option<Matrix6<f64>> {
    let system = metric.linearize_all(pairs)?;
    let hessian = system.scaled_hessian();
    let eigenvalues = eigen(hessian)?.eigenvalues;
    if eigenvalues.min() <= RANK_TOLERANCE * eigenvalues.max() {
        return None;
    }
    let (mut middle, mut count) = (Matrix6::zeros(), 0_usize);
    for pair in pairs.as_slice().iter().filter(|pair| pair.weight > 0.0) {
        let mut own = NormalEquations::new(system.pivot, system.length);
        metric.linearize(pair, &mut own);
        middle += own.scaled_gradient() * own.scaled_gradient().transpose();
        count += 1;
    }
    let spare = count.checked_sub(6).filter(|spare| *spare > 0)?;
    #[allow(clippy::cast_precision_loss)] // Counts far below 2⁵³.
    let correction = count as f64 / spare as f64;
    let carried = system.camera_from_scaled() * hessian.cholesky()?.inverse();
    let covariance = carried * middle * carried.transpose() * correction;
    let covariance = (covariance + covariance.transpose()) * 0.5;
    covariance
        .iter()
        .all(|x| x.is_finite())
        .then_some(covariance)
}

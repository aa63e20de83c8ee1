//! Gradient, information and covariance of the pose that the pairs determine.

use hicp_core::internal::small::{cholesky6, inverse_of};
use hicp_core::{Correspondences, Matrix6, Vector6};

use crate::metric::error_metric::ErrorMetric;
use crate::system::normal_equations::NormalEquations;
use crate::system::solve::eigen;

/// Ratio to the largest eigenvalue below which a direction has no information.
///
/// Points of 5 cm at 1 m in `f32` leave 10⁻¹² of it where it should be zero.
const RANK_TOLERANCE: f64 = 1e-9;

impl NormalEquations {
    /// Returns JᵀWJ, unscaled, for the twist ξ = [ρ; φ] around the *camera origin*.
    ///
    /// The unknowns are in meters and radians, translation first. The twist is a left perturbation
    /// of `camera_from_object`. The units are those of the weights per m², per m·rad and per rad².
    /// Divided by the variance of a residual of weight 1, it is Fisher's information. If poses move
    /// as A T, it moves as Ad(A)⁻ᵀ Λ Ad(A)⁻¹.
    #[must_use]
    pub fn information(&self) -> Matrix6<f64> {
        let scaled = self.scaled_from_camera();
        scaled.transpose() * self.scaled_hessian() * scaled
    }

    /// Returns JᵀWr, half the gradient of the loss: zero at a minimum.
    ///
    /// The twist is that of [`NormalEquations::information`].
    #[must_use]
    pub fn gradient(&self) -> Vector6<f64> {
        self.scaled_from_camera().transpose() * self.scaled_gradient()
    }

    /// Returns the covariance Σ = s² (JᵀWJ)⁻¹ of ξ = [ρ; φ], with s² = Σ w r²/(N − 6).
    ///
    /// N is the number of rows of positive weight. Frame and order are those of
    /// [`NormalEquations::information`]. A known variance ([`NormalEquations::with_variance`])
    /// replaces s². If components are frozen ([`NormalEquations::freeze`]), they have no variance,
    /// and N minus the number of free components replaces N − 6. Returns `None` if the rows do not
    /// determine all free components, if the policy freezes or refuses one of them, if a number is
    /// not finite, or if no row is left over to estimate an unknown variance.
    ///
    /// It is valid at the pose that minimizes the loss, for right pairs and independent residuals
    /// whose variances are inversely proportional to their weights. It does not contain wrong pairs
    /// and common errors, so it is optimistic for ICP (Censi 2007; Bonnabel, Barczyk & Goulette
    /// 2016). Neighboring pixels are correlated, and a robust kernel's weights reduce Σ w r².
    ///
    /// The measure of its accuracy is the mean of ξᵀΣ⁻¹ξ, which is 6 if Σ is right. Over 300 runs
    /// on noisy images (0.2 % of the depth, three synthetic objects) it was:
    ///
    /// - 6.1 to 6.4 with the right pairs, exact normals and exact weights.
    /// - 5.1 to 5.8 for projective plane-to-point, and 4.8 to 6.3 for point-to-plane, if the last
    ///   stage selects its points again.
    /// - 11 to 26 if the points stay those visible 1 mm and 1° away, because pixels near the
    ///   silhouette then have wrong pairs.
    ///
    /// At 0.5 %, noisy normals raise point-to-plane of a thin object to 13.
    /// [`Generalized`](crate::Generalized) gives 22 to 34 even with the right pairs; use
    /// [`sandwich_covariance`] for it. `cargo run --release -p
    /// hicp-tests --example nees_report 300` reproduces these figures.
    #[must_use]
    pub fn covariance(&self) -> Option<Matrix6<f64>> {
        let variance = self.row_variance()?;
        let (mut reduced, _) = self.reduced(&self.scaled_hessian());
        self.fill_held(&mut reduced);
        let eigenvalues = eigen(reduced)?.eigenvalues;
        if eigenvalues.min() <= RANK_TOLERANCE * eigenvalues.max() || self.freezes() {
            return None;
        }
        // Inverted around the pivot, where it is well conditioned, and then moved to the camera
        // origin. The columns of frozen components are zero.
        let carried = self.camera_from_scaled() * self.basis();
        let covariance =
            carried * inverse_of(&cholesky6(&reduced)?) * carried.transpose() * variance;
        finite(&covariance)
    }

    /// Returns the variance of a row of weight 1: the known one, or that of the rows.
    pub(crate) fn row_variance(&self) -> Option<f64> {
        self.variance.or_else(|| {
            let spare = self.rows.checked_sub(self.n_free());
            #[allow(clippy::cast_precision_loss)] // Counts far below 2⁵³.
            let spare = spare.filter(|spare| *spare > 0)? as f64;
            Some(self.loss() / spare)
        })
    }
}

/// Returns a covariance that is symmetric to the bit, or `None` if it is not finite.
fn finite(covariance: &Matrix6<f64>) -> Option<Matrix6<f64>> {
    let symmetric = (covariance + covariance.transpose()) * 0.5;
    symmetric.iter().all(|x| x.is_finite()).then_some(symmetric)
}

/// Returns the sandwich covariance H⁻¹ (Σ gᵢ gᵢᵀ) H⁻¹ · N/(N − 6) of ξ = [ρ; φ].
///
/// It is summed over the N pairs of positive weight, where gᵢ = Jᵢᵀ Wᵢ rᵢ is the gradient of a pair
/// (White 1980). Frame and order are those of [`NormalEquations::information`]. Pairs must be right
/// and independent, as for [`NormalEquations::covariance`], but weights need not be inverse
/// variances, and the rows of a pair may depend on each other.
///
/// It suits [`Generalized`](crate::Generalized), whose tangential rows have less noise than its
/// normal ones, so that the plain covariance is four to five times too small. For projective
/// Generalized ICP, the mean of ξᵀΣ⁻¹ξ (6 if right) is 5.6 to 6.2 instead of 22 to 29 at 0.2 % of
/// noise, and 5.6 to 5.9 at 0.5 %. Nearest neighbors fit the noise and give 20 at 0.5 % (`cargo run
/// --release -p hicp-tests --example nees_report 300`).
///
/// Returns `None` if the pairs do not determine all six directions. Cost: two linearizations.
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
    let carried = system.camera_from_scaled() * inverse_of(&cholesky6(&hessian)?);
    finite(&(carried * middle * carried.transpose() * correction))
}

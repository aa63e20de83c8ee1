//! A Gaussian prior of the pose.

use hicp_core::{Correspondences, Isometry3, Matrix6, Pair, Vector6, se3};

use crate::metric::{ErrorMetric, Step};
use crate::normal_equations::NormalEquations;

/// A metric with a Gaussian prior of the pose T: Σ w E + σ² ξᵀΛξ, ξ = ln(T T₀⁻¹)^∨.
///
/// T₀ is the prior's mean and Λ its information, the inverse of its covariance. As everywhere, ξ = [ρ; φ] is a left perturbation in
/// the camera frame, translation first (metres, radians), so Λ⁻¹ is the covariance of a fused estimate as it stands.
///
/// σ (`sigma_meters`) is the standard deviation of a residual of weight 1: it makes both terms squares in units of m²,
/// and 1/σ² times the sum is the negative log posterior. N residuals count as N independent ones; neighbouring pixels are not,
/// so multiply σ by √(pixels per independent residual) where the prior should be heard.
///
/// The prior is linearised with the inverse left Jacobian (Barfoot & Furgale 2014): ξ + 𝓙(ξ)⁻¹ δ. The step is Gauss–Newton's,
/// also for metrics with a closed form; without information it is the metric's own, bit for bit. A strong prior leads to T₀ in one
/// step. The mean loss is the sum over Σ w. Six components of information make up for missing rows, not for missing pairs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosePrior<M> {
    /// The data term.
    pub metric: M,
    /// T₀, the mean of the prior; default the identity.
    pub camera_from_object: Isometry3<f64>,
    /// Λ, symmetric and positive semi-definite: 1/m² for the translation, 1/rad² for the rotation; default zero, no prior.
    pub information: Matrix6<f64>,
    /// σ of a residual of weight 1, metres; default 1 mm.
    pub sigma_meters: f64,
}

impl<M: Default> Default for PosePrior<M> {
    fn default() -> Self {
        Self {
            metric: M::default(),
            camera_from_object: Isometry3::identity(),
            information: Matrix6::zeros(),
            sigma_meters: 1e-3,
        }
    }
}

impl<M> PosePrior<M> {
    /// ξ at the pose of the pairs, and σ² Λ.
    fn term(&self, pairs: &Correspondences) -> (Vector6<f64>, Matrix6<f64>) {
        let error = se3::log(&(pairs.camera_from_object() * self.camera_from_object.inverse()));
        (error, self.information * self.sigma_meters.powi(2))
    }

    fn is_flat(&self) -> bool {
        self.information == Matrix6::zeros()
    }
}

impl<M: ErrorMetric> ErrorMetric for PosePrior<M> {
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        self.metric.linearize(pair, system);
    }

    fn squared_error(&self, pair: &Pair) -> f64 {
        self.metric.squared_error(pair)
    }

    fn mean_loss(&mut self, pairs: &Correspondences) -> Option<f64> {
        let data = self.metric.mean_loss(pairs)?;
        if self.is_flat() {
            return Some(data);
        }
        let weight: f64 = pairs.as_slice().iter().map(|p| f64::from(p.weight)).sum();
        let (error, information) = self.term(pairs);
        let mean = data + error.dot(&(information * error)) / weight;
        mean.is_finite().then_some(mean)
    }

    fn system(&mut self, pairs: &Correspondences) -> Option<NormalEquations> {
        let mut system = self.metric.system(pairs)?;
        if !self.is_flat() {
            let (error, information) = self.term(pairs);
            system.add_twist(&error, &se3::left_jacobian_inverse(&error), &information);
        }
        Some(system)
    }

    fn minimize(&mut self, pairs: &Correspondences) -> Option<Step> {
        if self.is_flat() {
            return self.metric.minimize(pairs);
        }
        Some(Step {
            increment: self.system(pairs)?.solve()?,
            mean_loss: self.mean_loss(pairs)?,
        })
    }

    fn name(&self) -> &'static str {
        "pose-prior"
    }
}

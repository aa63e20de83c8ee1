//! A Gaussian prior of the pose.

use hicp_core::internal::small::blocks;
use hicp_core::{Correspondences, Isometry3, Iteration, Matrix3, Matrix6, Vector6, se3, so3::hat};

use crate::metric::error_metric::Step;
use crate::metric::minimize::Minimize;
use crate::system::normal_equations::NormalEquations;

/// A Gaussian distribution of the pose, given by its mean and its information Λ = Σ⁻¹.
///
/// As everywhere, ξ = ln(T T₀⁻¹)^∨ = [ρ; φ] is a left perturbation in the camera frame, translation
/// first (meters, radians).
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // A pipeline has only one.
#[non_exhaustive]
pub enum Prior {
    /// All poses are equally likely.
    Flat,
    /// A given mean and information. For a fused estimate, Λ is the inverse of its covariance.
    Gaussian {
        /// The mean T₀.
        camera_from_object: Isometry3<f64>,
        /// Λ, symmetric and positive semi-definite: 1/m² for the translation, 1/rad² for the
        /// rotation.
        information: Matrix6<f64>,
    },
    /// The initial pose of the stage is the mean, with the same uncertainty in all directions.
    AboutInitial {
        /// Standard deviation of the object's origin along each axis, meters.
        ///
        /// Above 0; infinite for no information.
        translation_meters: f64,
        /// Standard deviation of the rotation around each axis through the object's origin,
        /// degrees.
        ///
        /// Above 0; infinite for no information.
        rotation_degrees: f64,
    },
}

impl Prior {
    /// Returns T₀ and Λ for a stage that starts at `init`, or `None` without information.
    fn resolve(&self, init: &Isometry3<f64>) -> Option<(Isometry3<f64>, Matrix6<f64>)> {
        let (mean, information) = match *self {
            Self::Flat => return None,
            Self::Gaussian {
                camera_from_object,
                information,
            } => (camera_from_object, information),
            Self::AboutInitial {
                translation_meters,
                rotation_degrees,
            } => {
                // The displacement of the object's origin is ρ + φ × t.
                let shift = -hat(&init.translation.vector);
                let identity = Matrix3::identity();
                let about_object = blocks(&identity, &shift, &identity);
                let [t, r] = [translation_meters, rotation_degrees.to_radians()]
                    .map(|sigma| sigma.powi(2).recip());
                let information = Matrix6::from_diagonal(&Vector6::new(t, t, t, r, r, r));
                (*init, about_object.transpose() * information * about_object)
            }
        };
        (information != Matrix6::zeros()).then_some((mean, information))
    }
}

/// Adds a Gaussian [`Prior`] of the pose to a metric: Σ w E + σ² ξᵀΛξ.
///
/// ξ = ln(T T₀⁻¹)^∨ is the deviation from the mean.
///
/// σ (`sigma_meters`) is the standard deviation of a residual of weight 1. It gives both terms the
/// unit m². The sum divided by 2σ² is the negative log posterior, up to a constant. All residuals
/// count as independent, which those of neighboring pixels are not. To give the prior its full
/// influence, multiply σ by √(pixels per independent residual). The covariance of the system is
/// that of the posterior at this σ, whatever the residuals are. Of nested priors, the outer one
/// sets σ.
///
/// The prior is linearized with the inverse left Jacobian (Barfoot & Furgale 2014): ξ + 𝓙(ξ)⁻¹ δ.
/// The step is that of Gauss–Newton, even for metrics with a closed form. Without information, it
/// is the metric's own step, bit for bit. A strong prior leads to T₀ in one step. The mean loss is
/// the sum divided by Σ w. A prior with information about all six components gives a step even from
/// too few pairs, but not without any pair.
///
/// [`Prior::AboutInitial`] reads the initial pose of the stage from [`Iteration::init`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosePrior<M> {
    /// The data term.
    pub metric: M,
    /// The prior of the pose; by default flat.
    pub prior: Prior,
    /// σ of a residual of weight 1, meters; default 1 mm.
    pub sigma_meters: f64,
}

impl<M: Default> Default for PosePrior<M> {
    fn default() -> Self {
        Self::new(M::default(), Prior::Flat, 1e-3)
    }
}

impl<M> PosePrior<M> {
    /// Adds a prior to a metric.
    ///
    /// `sigma_meters` is the standard deviation of a residual of weight 1.
    #[must_use]
    pub fn new(metric: M, prior: Prior, sigma_meters: f64) -> Self {
        Self {
            metric,
            prior,
            sigma_meters,
        }
    }

    /// Returns ξ at the pose of the pairs, and σ² Λ.
    fn term(
        &self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
    ) -> Option<(Vector6<f64>, Matrix6<f64>)> {
        let (mean, information) = self.prior.resolve(&iteration.init)?;
        let error = se3::log(&(pairs.camera_from_object() * mean.inverse()));
        Some((error, information * self.sigma_meters.powi(2)))
    }
}

impl<M: Minimize> Minimize for PosePrior<M> {
    fn inner(&mut self, _: &Iteration<'_>) -> Option<&mut dyn Minimize> {
        Some(&mut self.metric)
    }

    fn mean_loss(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<f64> {
        let data = self.metric.mean_loss(iteration, pairs)?;
        let Some((error, information)) = self.term(iteration, pairs) else {
            return Some(data);
        };
        let weight: f64 = pairs.as_slice().iter().map(|p| f64::from(p.weight)).sum();
        let mean = data + error.dot(&(information * error)) / weight;
        mean.is_finite().then_some(mean)
    }

    fn system(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
    ) -> Option<NormalEquations> {
        let mut system = self.metric.system(iteration, pairs)?;
        if let Some((error, information)) = self.term(iteration, pairs) {
            system.add_twist(&error, &se3::left_jacobian_inverse(&error), &information);
            system = system.with_variance(self.sigma_meters.powi(2));
        }
        Some(system)
    }

    fn minimize(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<Step> {
        if self.prior.resolve(&iteration.init).is_none() {
            return self.metric.minimize(iteration, pairs);
        }
        Some(Step {
            increment: self.system(iteration, pairs)?.solve()?,
            mean_loss: self.mean_loss(iteration, pairs)?,
        })
    }

    fn label(&self) -> &'static str {
        "pose-prior"
    }
}

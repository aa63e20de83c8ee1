//! Weights from the noise of the depth sensor.

use std::f32::consts::FRAC_PI_2;

use hicp_core::{Correspondences, Iteration, Surfel};

use crate::filter::outlier_filter::OutlierFilter;

/// Multiplies weights by 1/σ²(z, θ) of the observed point, divided by the mean over all pairs (Rusinkiewicz & Levoy 2001, §3.3:
/// weights by the uncertainty of the sensor).
///
/// The mean keeps weights near 1, so losses and thresholds keep their meaning. Matters where depths differ: between the front
/// and the back of an object a tenth as deep as it is far, they differ by 20 % at 0.5 m and 35 % at 1 m. Where no σ is finite,
/// weights stay. Cost: O(pairs).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorNoiseWeight {
    /// The standard deviation of depth.
    pub noise: SensorNoise,
}

/// Standard deviation of a measured depth: σ(z, θ) = c₀ + c₁ z + c₂ z² + t·z^1.5·Σ θᵢ/(π/2 − θᵢ)² metres, z in metres.
///
/// θ are the tilts of the surface about the image's two axes, radians, clamped to 75°, beyond which the last term explodes.
/// Only ratios of σ matter to [`SensorNoiseWeight`]. σ below 1 µm, and one that is not a number, counts as 1 µm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorNoise {
    /// c₀, metres.
    pub constant: f32,
    /// c₁, metres per metre.
    pub linear: f32,
    /// c₂, metres per square metre.
    pub quadratic: f32,
    /// t; 0 leaves the tilt out.
    pub tilt: f32,
}

/// Smallest standard deviation, metres.
const MIN_SIGMA: f32 = 1.0e-6;
/// Largest tilt that enters the formula.
const MAX_TILT: f32 = 75.0 / 180.0 * std::f32::consts::PI;

impl SensorNoise {
    /// The axial term of Ahn et al., "Analysis and Noise Modeling of the Intel RealSense D435 for Mobile Robots", UR 2019:
    /// σ = 0.001063 + 0.0007278 z + 0.003949 z².
    ///
    /// Coefficients as transcribed in public implementations; the paper itself was not consulted. For surfaces that
    /// roughly face the camera. The same implementations have a tilt term of t = 0.022, of low confidence and left out here.
    #[must_use]
    pub fn d435_ahn2019_axial() -> Self {
        Self {
            constant: 0.001_063,
            linear: 0.000_727_8,
            quadratic: 0.003_949,
            tilt: 0.0,
        }
    }

    /// σ ∝ z²: a stereo sensor of constant disparity error, whose size does not matter to a weight.
    #[must_use]
    pub fn stereo() -> Self {
        Self {
            constant: 0.0,
            linear: 0.0,
            quadratic: 1.0,
            tilt: 0.0,
        }
    }

    /// Returns σ in metres at an observed surfel (camera frame).
    #[must_use]
    pub fn sigma(&self, observed: &Surfel) -> f32 {
        let z = observed.point.z;
        let mut sigma = self.constant + z * (self.linear + z * self.quadratic);
        if self.tilt != 0.0 {
            let n = &observed.normal;
            let term = |slope: f32| {
                let angle = slope.abs().atan2(n.z.abs()).min(MAX_TILT);
                angle / (FRAC_PI_2 - angle).powi(2)
            };
            sigma += self.tilt * z.powf(1.5) * (term(n.x) + term(n.y));
        }
        // In this order a NaN becomes the minimum.
        sigma.max(MIN_SIGMA)
    }

    fn precision(&self, observed: &Surfel) -> f64 {
        f64::from(self.sigma(observed)).powi(-2)
    }
}

impl Default for SensorNoise {
    /// [`SensorNoise::d435_ahn2019_axial`].
    fn default() -> Self {
        Self::d435_ahn2019_axial()
    }
}

impl OutlierFilter for SensorNoiseWeight {
    fn filter(&mut self, _iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        let sum: f64 = (pairs.as_slice().iter())
            .map(|pair| self.noise.precision(&pair.target))
            .sum();
        if sum.is_nan() || sum <= 0.0 {
            return;
        }
        let per_mean = pairs.len() as f64 / sum;
        for pair in pairs.as_mut_slice() {
            #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
            let weight = (self.noise.precision(&pair.target) * per_mean) as f32;
            pair.weight *= weight;
        }
    }

    fn name(&self) -> &'static str {
        "sensor-noise-weight"
    }
}

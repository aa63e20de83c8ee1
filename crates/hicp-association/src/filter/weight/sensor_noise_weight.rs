//! Weights from the noise of the depth sensor.

use std::f32::consts::FRAC_PI_2;

use hicp_core::{Correspondences, Iteration, Surfel};

use crate::filter::outlier_filter::OutlierFilter;
use crate::length::narrow;

/// Multiplies weights by 1/σ²(z, θ) of the observed point, divided by the mean over all pairs.
///
/// It weighs by the uncertainty of the sensor (Rusinkiewicz & Levoy 2001, §3.3). The division keeps
/// weights near 1, so that losses and thresholds keep their meaning. If no σ is finite, weights do
/// not change.
///
/// It matters if depths differ. For an object whose depth range is a tenth of its distance, the
/// weights of front and back differ by 20 % at 0.5 m and by 35 % at 1 m. Cost: O(pairs).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorNoiseWeight {
    /// The standard deviation of depth.
    pub noise: SensorNoise,
}

/// Standard deviation of a measured depth, in meters, with z in meters.
///
/// σ(z, θ) = c₀ + c₁ z + c₂ z² + t·z^1.5·Σ θᵢ/(π/2 − θᵢ)²
///
/// θ are the tilts of the surface around the two image axes, in radians, clamped to 75°, because
/// the last term diverges at 90°. [`SensorNoiseWeight`] depends only on ratios of σ. Values below 1
/// µm, and NaN, count as 1 µm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorNoise {
    /// c₀, meters.
    pub constant: f64,
    /// c₁, meters per meter.
    pub linear: f64,
    /// c₂, meters per square meter.
    pub quadratic: f64,
    /// Coefficient t of the tilt term, for z in meters and θ in radians; 0 for no influence of the
    /// tilt.
    pub tilt: f64,
}

/// Smallest standard deviation, meters.
const MIN_SIGMA: f32 = 1.0e-6;
/// Largest tilt in the formula, radians.
const MAX_TILT: f32 = 75.0 / 180.0 * std::f32::consts::PI;

impl SensorNoise {
    /// The axial noise of the Intel RealSense D435: σ = 0.001063 + 0.0007278 z + 0.003949 z².
    ///
    /// Source: Ahn et al., "Analysis and Noise Modeling of the Intel RealSense D435 for Mobile
    /// Robots", UR 2019. The coefficients are those of public implementations; the paper itself was
    /// not consulted. They hold for surfaces that roughly face the camera. The same implementations
    /// have a tilt term of t = 0.022. It is omitted here because its confidence is low.
    #[must_use]
    pub fn d435_ahn2019_axial() -> Self {
        Self {
            constant: 0.001_063,
            linear: 0.000_727_8,
            quadratic: 0.003_949,
            tilt: 0.0,
        }
    }

    /// The noise of a stereo sensor with a constant disparity error: σ ∝ z².
    ///
    /// A weight does not depend on the scale.
    #[must_use]
    pub fn stereo() -> Self {
        Self {
            constant: 0.0,
            linear: 0.0,
            quadratic: 1.0,
            tilt: 0.0,
        }
    }

    /// Returns σ in meters at an observed surfel, which is in the camera frame.
    #[must_use]
    pub fn sigma(&self, observed: &Surfel) -> f32 {
        let z = observed.point.z;
        let [constant, linear, quadratic, tilt] =
            [self.constant, self.linear, self.quadratic, self.tilt].map(narrow);
        let mut sigma = constant + z * (linear + z * quadratic);
        if tilt != 0.0 {
            let n = &observed.normal;
            let term = |slope: f32| {
                let angle = slope.abs().atan2(n.z.abs()).min(MAX_TILT);
                angle / (FRAC_PI_2 - angle).powi(2)
            };
            sigma += tilt * z.powf(1.5) * (term(n.x) + term(n.y));
        }
        // In this order, `max` turns a NaN into the minimum.
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

//! Noise of depth sensors, independent per pixel.
//!
//! Real stereo noise is correlated between neighboring pixels; [`Distortion`](crate::Distortion)
//! adds such errors.

use std::fmt;
use std::str::FromStr;

use hicp_core::DepthImage;
use rand_distr::{Distribution, StandardNormal};

use crate::SimRng;
use crate::error::SimError;
use crate::narrow;

/// Gaussian noise with a standard deviation proportional to the depth, independent per pixel
/// (§VI-B.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeGaussian {
    /// Standard deviation in percent of the depth; 0 changes nothing.
    pub percent: f64,
}

impl RelativeGaussian {
    /// Returns a noisy copy of an image.
    ///
    /// Pixels without depth stay without. If noise would make a depth negative, the depth is
    /// removed.
    #[must_use]
    pub fn apply(&self, rng: &mut SimRng, depth: &DepthImage) -> DepthImage {
        let sigma = self.percent / 100.0;
        disturb(rng, depth, |z, unit| z * (1.0 + sigma * unit))
    }
}

/// A noise model by name, for studies, files and command lines.
///
/// All models except `None` draw one number per measured pixel, in row-major order. With the same
/// stream, images of different models and levels therefore use the same deviates.
///
/// ```
/// use hicp_sim::DepthNoise;
/// let noise: DepthNoise = "relative:2".parse()?;
/// assert!((noise.sigma_meters(0.5) - 0.01).abs() < 1e-12);
/// assert_eq!(noise.to_string().parse::<DepthNoise>()?, noise);
/// # Ok::<(), hicp_sim::SimError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum DepthNoise {
    /// No noise; the image is unchanged.
    #[default]
    None,
    /// Noise proportional to the depth.
    Relative(RelativeGaussian),
    /// Noise with a standard deviation of c₀ + c₁ z + c₂ z² at depth z, both in meters.
    Axial {
        /// Constant, m.
        c0: f64,
        /// Linear coefficient.
        c1: f64,
        /// Quadratic coefficient, 1/m.
        c2: f64,
    },
    /// Noise of a stereo camera's disparity d = f B / z.
    ///
    /// To first order, the RMS error of the depth is z² s / (f B).
    Stereo {
        /// Focal length f of the stereo pair, pixels. It may differ from that of the rendering
        /// camera.
        focal_pixels: f64,
        /// Baseline B, meters.
        baseline_meters: f64,
        /// RMS error s of the disparity, pixels.
        subpixel: f64,
        /// Step to which the disparity is rounded after adding noise, pixels; 0 for no rounding.
        quantization_pixels: f64,
    },
}

impl DepthNoise {
    /// The axial term for the Intel `RealSense` D435: σ = 0.001063 + 0.0007278 z + 0.003949 z².
    ///
    /// That is about 0.5 % of z from 0.4 to 1 m.
    ///
    /// The coefficients are from public implementations of Ahn, Chae, Noh, Nam & Hong, "Analysis
    /// and Noise Modeling of the Intel `RealSense` D435 for Mobile Robots", UR 2019. The original
    /// paper was not consulted. Only the axial term is used, which holds for nearly frontal
    /// surfaces. One paper that cites it reports up to 4 cm at 2 m, twice this polynomial.
    // Deviation: axial-only D435 noise: §VI-C.2 uses the noise model of Ahn et al. for the D435.
    // Here it is only the axial term for frontal surfaces, independent per pixel, because the other
    // terms were not available.
    pub const D435_AHN2019_AXIAL: Self = Self::Axial {
        c0: 0.001_063,
        c1: 0.000_727_8,
        c2: 0.003_949,
    };

    /// Intel's formula with nominal values of the D435, without rounding.
    ///
    /// The values are 848 pixels over 87°, a baseline of 50 mm, and 0.08 pixels RMS. The last one
    /// is the value that Intel's depth CTO recommends (librealsense issue 3904; 1/32 is the ideal
    /// limit).
    ///
    /// The noise is 0.9 mm at 0.5 m and 3.6 mm at 1 m. Measured noise of active stereo grows faster
    /// than z² (Huber et al. 2018).
    pub const D435_NOMINAL_STEREO: Self = Self::Stereo {
        focal_pixels: 447.0,
        baseline_meters: 0.05,
        subpixel: 0.08,
        quantization_pixels: 0.0,
    };

    /// Returns a noisy copy of an image.
    ///
    /// Pixels without depth stay without. If noise would make a depth negative, the depth is
    /// removed.
    #[must_use]
    pub fn apply(&self, rng: &mut SimRng, depth: &DepthImage) -> DepthImage {
        match *self {
            Self::None => depth.clone(),
            Self::Relative(noise) => noise.apply(rng, depth),
            Self::Axial { .. } => disturb(rng, depth, |z, unit| z + self.sigma_meters(z) * unit),
            Self::Stereo {
                focal_pixels,
                baseline_meters,
                subpixel,
                quantization_pixels: step,
            } => disturb(rng, depth, |z, unit| {
                let scale = focal_pixels * baseline_meters;
                let disparity = scale / z + subpixel * unit;
                if step > 0.0 {
                    scale / ((disparity / step).round() * step)
                } else {
                    scale / disparity
                }
            }),
        }
    }

    /// Returns the standard deviation at a depth, both in meters.
    ///
    /// For disparities, it is that to first order and without rounding.
    #[must_use]
    pub fn sigma_meters(&self, depth_meters: f64) -> f64 {
        match *self {
            Self::None => 0.0,
            Self::Relative(noise) => noise.percent / 100.0 * depth_meters,
            Self::Axial { c0, c1, c2 } => c0 + depth_meters * (c1 + depth_meters * c2),
            Self::Stereo {
                focal_pixels,
                baseline_meters,
                subpixel,
                ..
            } => depth_meters * depth_meters * subpixel / (focal_pixels * baseline_meters),
        }
    }
}

impl fmt::Display for DepthNoise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => write!(f, "none"),
            Self::Relative(RelativeGaussian { percent }) => write!(f, "relative:{percent}"),
            named if *named == Self::D435_AHN2019_AXIAL => write!(f, "d435-ahn2019-axial"),
            named if *named == Self::D435_NOMINAL_STEREO => write!(f, "d435-nominal-stereo"),
            Self::Axial { c0, c1, c2 } => write!(f, "axial:{c0},{c1},{c2}"),
            Self::Stereo {
                focal_pixels,
                baseline_meters,
                subpixel,
                quantization_pixels,
            } => write!(
                f,
                "stereo:{focal_pixels},{baseline_meters},{subpixel},{quantization_pixels}"
            ),
        }
    }
}

impl FromStr for DepthNoise {
    type Err = SimError;

    /// Parses the form that [`fmt::Display`] writes.
    ///
    /// # Errors
    ///
    /// [`SimError::NoiseName`] if the name is unknown, or if numbers are missing, negative or not
    /// finite.
    fn from_str(text: &str) -> Result<Self, SimError> {
        let unknown = || SimError::NoiseName {
            text: text.to_owned(),
        };
        let (name, numbers) = text.split_once(':').unwrap_or((text, ""));
        let numbers: Vec<f64> = numbers
            .split(',')
            .filter(|word| !word.is_empty())
            .map(str::parse)
            .collect::<Result<_, _>>()
            .map_err(|_| unknown())?;
        if numbers.iter().any(|x| !(x.is_finite() && *x >= 0.0)) {
            return Err(unknown());
        }
        match (name, &numbers[..]) {
            ("none", []) => Ok(Self::None),
            ("relative", &[percent]) => Ok(Self::Relative(RelativeGaussian { percent })),
            ("axial", &[c0, c1, c2]) => Ok(Self::Axial { c0, c1, c2 }),
            ("d435-ahn2019-axial", []) => Ok(Self::D435_AHN2019_AXIAL),
            ("d435-nominal-stereo", []) => Ok(Self::D435_NOMINAL_STEREO),
            ("stereo", &[focal_pixels, baseline_meters, subpixel, quantization_pixels])
                if focal_pixels > 0.0 && baseline_meters > 0.0 =>
            {
                Ok(Self::Stereo {
                    focal_pixels,
                    baseline_meters,
                    subpixel,
                    quantization_pixels,
                })
            }
            _ => Err(unknown()),
        }
    }
}

/// Replaces every measured depth by `measure(depth, deviate)`, with depths in meters.
///
/// The deviate is standard normal.
fn disturb(rng: &mut SimRng, depth: &DepthImage, measure: impl Fn(f64, f64) -> f64) -> DepthImage {
    map_depths(depth, |z| {
        let unit: f64 = StandardNormal.sample(rng);
        measure(z, unit)
    })
}

/// Replaces every measured depth, in meters. Results that are not a valid depth become missing.
pub(crate) fn map_depths(depth: &DepthImage, mut new: impl FnMut(f64) -> f64) -> DepthImage {
    let pixels = depth.pixels().iter().map(|z| match *z > 0.0 {
        true => narrow(new(f64::from(*z))),
        false => 0.0,
    });
    DepthImage::collect(depth.width(), depth.height(), pixels).unwrap_or_else(|_| depth.clone())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng;

    /// Returns the mean and the standard deviation of the measured depths of a wall at `z` meters.
    fn moments(noise: DepthNoise, z: f32) -> (f64, f64) {
        let wall = DepthImage::from_meters(200, 200, vec![z; 40_000]).unwrap();
        let noisy = noise.apply(&mut rng(3), &wall);
        let values: Vec<f64> = noisy.pixels().iter().map(|z| f64::from(*z)).collect();
        let mean = values.iter().sum::<f64>() / 4e4;
        let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 4e4;
        (mean, variance.sqrt())
    }

    #[test]
    fn every_model_has_its_stated_standard_deviation() {
        for text in [
            "relative:2",
            "axial:0.001,0.002,0.003",
            "d435-ahn2019-axial",
            "d435-nominal-stereo",
        ] {
            let noise: DepthNoise = text.parse().unwrap();
            for z in [0.3_f32, 0.6, 1.2] {
                let (mean, sigma) = moments(noise, z);
                let expected = noise.sigma_meters(f64::from(z));
                // With 40,000 samples, the standard error of σ is 0.35 %, and that of the mean is
                // σ/200. Stereo has a bias of second order.
                assert!(
                    (sigma / expected - 1.0).abs() < 0.015,
                    "{text} at {z}: {sigma}, {expected}"
                );
                assert!(
                    (mean - f64::from(z)).abs() < 0.04 * expected,
                    "{text} at {z}: {mean}"
                );
            }
        }
    }

    #[test]
    fn the_polynomial_and_the_stereo_formula_give_the_published_figures() {
        let axial = DepthNoise::D435_AHN2019_AXIAL;
        for (z, millimeters) in [
            (0.2, 1.37),
            (0.3, 1.64),
            (0.4, 1.99),
            (0.5, 2.41),
            (0.6, 2.92),
            (1.0, 5.74),
            (2.0, 18.3),
            (3.0, 38.8),
        ] {
            let sigma = 1e3 * axial.sigma_meters(z);
            assert!(
                (sigma - millimeters).abs() < 0.05 + 1e-3 * millimeters,
                "{z}: {sigma}"
            );
        }
        let stereo: DepthNoise = "stereo:424,0.05,0.08,0".parse().unwrap();
        for (z, millimeters) in [(0.5, 0.94), (1.0, 3.8), (2.0, 15.0)] {
            let sigma = 1e3 * stereo.sigma_meters(z);
            assert!((sigma / millimeters - 1.0).abs() < 0.01, "{z}: {sigma}");
        }
    }

    #[test]
    fn disparities_are_rounded_to_their_step() {
        let noise: DepthNoise = "stereo:447,0.05,0.08,0.25".parse().unwrap();
        let wall = DepthImage::from_meters(50, 50, vec![0.7; 2500]).unwrap();
        for z in noise.apply(&mut rng(1), &wall).pixels() {
            let steps = 447.0 * 0.05 / f64::from(*z) / 0.25;
            assert!((steps - steps.round()).abs() < 1e-4, "{steps}");
        }
    }

    #[test]
    fn names_are_parsed_back_and_other_texts_are_refused() {
        for text in [
            "none",
            "relative:2.5",
            "axial:0.001,0,0.5",
            "d435-ahn2019-axial",
            "stereo:424,0.05,0.08,0.03125",
            "d435-nominal-stereo",
        ] {
            assert_eq!(text.parse::<DepthNoise>().unwrap().to_string(), text);
        }
        for text in [
            "",
            "d435",
            "relative",
            "relative:-1",
            "relative:nan",
            "relative:1,2",
            "stereo:0,0.05,0.08,0",
            "none:1",
        ] {
            let error = text.parse::<DepthNoise>().unwrap_err().to_string();
            assert!(error.contains(&format!("{text:?}")), "{error}");
        }
    }
}

//! Depth-sensor noise.

use hicp_core::DepthImage;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

/// Gaussian noise whose standard deviation is a share of the depth, independent per pixel (§VI-B.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeGaussian {
    /// Standard deviation as a percentage of the depth; 0 changes nothing.
    pub percent: f64,
}

impl RelativeGaussian {
    /// Returns a noisy copy of an image. Pixels without depth stay without; noise that would turn a depth negative removes it.
    #[must_use]
    pub fn apply<R: Rng + ?Sized>(&self, rng: &mut R, depth: &DepthImage) -> DepthImage {
        let sigma = self.percent / 100.0;
        let noisy = depth
            .pixels()
            .iter()
            .map(|z| {
                if *z > 0.0 {
                    let unit: f64 = StandardNormal.sample(rng);
                    #[allow(clippy::cast_possible_truncation)]
                    // f32 is the precision of depth images.
                    let measured = (f64::from(*z) * (1.0 + sigma * unit)) as f32;
                    measured
                } else {
                    0.0
                }
            })
            .collect();
        DepthImage::from_meters(depth.width(), depth.height(), noisy)
            .unwrap_or_else(|_| depth.clone())
    }
}

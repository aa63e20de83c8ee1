//! Planes in a depth image.

use nalgebra::{Matrix3, Vector3};

use crate::internal::small::inverse3;

/// A plane in an image, in which inverse depth is linear: 1/z = a + b u + c v.
#[derive(Clone, Copy, Debug)]
pub struct DepthPlane(Vector3<f64>);

impl DepthPlane {
    /// Fits a plane to pixels (u, v, z) by least squares of inverse depth.
    ///
    /// Returns `None` if the pixels do not determine a plane.
    #[must_use]
    pub fn fit(pixels: impl Iterator<Item = Vector3<f64>>) -> Option<Self> {
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for pixel in pixels {
            let row = Vector3::new(1.0, pixel.x, pixel.y);
            normal += row * row.transpose();
            right += row / pixel.z;
        }
        Some(Self(inverse3(&normal)? * right))
    }

    /// Iterates over planes through three of the pixels, which must not be empty.
    ///
    /// The sequence is fixed, so that equal pixels give equal planes.
    pub fn through_three(pixels: &[Vector3<f64>], tries: usize) -> impl Iterator<Item = Self> + '_ {
        let mut state = 1_u64;
        let mut draw = move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            pixels[(state >> 33) as usize % pixels.len()]
        };
        (0..tries).filter_map(move |_| Self::fit([draw(), draw(), draw()].into_iter()))
    }

    /// Returns the depth of the plane at a pixel; infinite behind the camera.
    #[must_use]
    #[inline]
    pub fn depth(&self, u: f64, v: f64) -> f64 {
        let inverse = self.0.dot(&Vector3::new(1.0, u, v));
        if inverse > 0.0 {
            1.0 / inverse
        } else {
            f64::INFINITY
        }
    }
}

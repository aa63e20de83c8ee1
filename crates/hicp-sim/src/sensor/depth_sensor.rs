//! A simulated depth sensor: distortion, missing pixels, noise and quantization.

use hicp_core::{DepthImage, PinholeCamera};

use crate::SimRng;
use crate::error::{SimError, check_range, check_size};
use crate::sensor::distortion::{DEPTH_EDGE_METERS, Distortion};
use crate::sensor::noise::{DepthNoise, map_depths};

/// The error model of a depth sensor: distortion and missing pixels, then noise, then rounding.
///
/// The default changes nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DepthSensor {
    /// Systematic errors.
    pub distortion: Distortion,
    /// Noise of the measured depths.
    pub noise: DepthNoise,
    /// Step to which depths are rounded, meters; `None` or 0 for no rounding. A D435 uses 0.001 by
    /// default.
    pub quantization_meters: Option<f64>,
    /// Rules for pixels without depth.
    pub dropout: Dropout,
}

/// Rules for pixels that the sensor does not measure. The default loses none.
///
/// They are applied to the perfect image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dropout {
    /// Largest angle between a surface's normal and the ray to the camera, degrees; `None` for no
    /// limit.
    ///
    /// Pixels with a larger angle are lost.
    pub max_incidence_degrees: Option<f64>,
    /// Number of pixels lost on both sides of a depth edge; 0 for none.
    ///
    /// Missing depth next to a surface counts as an edge.
    pub edge_pixels: u32,
}

impl DepthSensor {
    /// Returns the measurement of a perfect depth image.
    ///
    /// Missing pixels do not change the noise of other pixels. Cost: O(pixels), times the square of
    /// the edge width if edges are lost.
    ///
    /// # Errors
    ///
    /// [`SimError`] if the sizes of image and camera differ, or if a parameter is out of its range.
    pub fn measure(
        &self,
        rng: &mut SimRng,
        perfect: &DepthImage,
        camera: &PinholeCamera,
    ) -> Result<DepthImage, SimError> {
        let step = self.quantization_meters.unwrap_or(0.0);
        check_range("quantization in meters", step, 0.0..=1.0)?;
        let lost = self.dropout.lost(perfect, camera)?;
        let mut measured = if self.distortion == Distortion::default() {
            self.noise.apply(rng, perfect)
        } else {
            let distorted = self.distortion.apply(rng, perfect)?;
            self.noise.apply(rng, &distorted)
        };
        if step > 0.0 {
            measured = map_depths(&measured, |z| (z / step).round() * step);
        }
        if self.dropout == Dropout::default() {
            return Ok(measured);
        }
        let pixels = measured.pixels().iter().zip(lost);
        let pixels = pixels.map(|(z, lost)| if lost { 0.0 } else { *z });
        let (width, height) = (measured.width(), measured.height());
        Ok(DepthImage::collect(width, height, pixels)?)
    }
}

impl Dropout {
    /// Returns whether each pixel is lost, row-major.
    fn lost(&self, depth: &DepthImage, camera: &PinholeCamera) -> Result<Vec<bool>, SimError> {
        check_size(depth, camera)?;
        if let Some(degrees) = self.max_incidence_degrees {
            check_range("largest incidence angle in degrees", degrees, 0.0..=90.0)?;
        }
        let width_of_edges = f64::from(self.edge_pixels);
        check_range("edge width in pixels", width_of_edges, 0.0..=64.0)?;
        let min_cosine = self
            .max_incidence_degrees
            .map(|degrees| degrees.to_radians().cos());
        let is_lost = |(u, v)| {
            let cosine = || incidence_cosine(depth, camera, u, v);
            let grazing = min_cosine.is_some_and(|min| cosine().is_some_and(|c| c < min));
            grazing || self.near_edge(depth, u, v)
        };
        Ok(camera.region().pixels().map(is_lost).collect())
    }

    fn near_edge(&self, depth: &DepthImage, u: u32, v: u32) -> bool {
        let n = self.edge_pixels;
        let Some(z) = depth.get(u, v).filter(|z| *z > 0.0 && n > 0) else {
            return false;
        };
        let (rows, columns) = (v.saturating_sub(n)..=v + n, u.saturating_sub(n)..=u + n);
        rows.flat_map(|v| columns.clone().map(move |u| (u, v)))
            .filter_map(|(u, v)| depth.get(u, v))
            .any(|other| other <= 0.0 || f64::from((other - z).abs()) > DEPTH_EDGE_METERS)
    }
}

/// Returns the cosine of the angle between the surface's normal and the ray at a pixel.
///
/// Returns `None` if the pixel has no depth. The inverse depth of a plane is affine in the pixel: w
/// = a x + b y + c with (a, b, c) along the normal. The slopes of w are therefore sufficient. The
/// smaller of the two one-sided slopes is used, because it does not cross an edge.
fn incidence_cosine(depth: &DepthImage, camera: &PinholeCamera, u: u32, v: u32) -> Option<f64> {
    let inverse = |u: Option<u32>, v: Option<u32>| {
        let z = depth.get(u?, v?).filter(|z| *z > 0.0)?;
        Some(1.0 / f64::from(z))
    };
    let here = inverse(Some(u), Some(v))?;
    let slope = |before: Option<f64>, after: Option<f64>| {
        let backward = before.map(|w| here - w);
        let forward = after.map(|w| w - here);
        match (backward, forward) {
            (Some(b), Some(f)) => Some(if b.abs() < f.abs() { b } else { f }),
            (one, other) => one.or(other),
        }
    };
    let across = slope(
        inverse(u.checked_sub(1), Some(v)),
        inverse(u.checked_add(1), Some(v)),
    )?;
    let down = slope(
        inverse(Some(u), v.checked_sub(1)),
        inverse(Some(u), v.checked_add(1)),
    )?;
    let (x, y) = (
        (f64::from(u) - camera.cx()) / camera.fx(),
        (f64::from(v) - camera.cy()) / camera.fy(),
    );
    let (a, b) = (across * camera.fx(), down * camera.fy());
    let c = here - a * x - b * y;
    Some(here / ((a * a + b * b + c * c) * (x * x + y * y + 1.0)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng;

    fn camera() -> PinholeCamera {
        PinholeCamera::new(100.0, 100.0, 31.5, 31.5, 64, 64).unwrap()
    }

    /// Returns a plane through the optical axis at 1 m whose normal is rotated by `degrees` around
    /// y.
    fn tilted(degrees: f64) -> DepthImage {
        let (s, c) = degrees.to_radians().sin_cos();
        #[allow(clippy::cast_possible_truncation)]
        let depth = |u: u32| (c / (c + s * (f64::from(u) - 31.5) / 100.0)) as f32;
        let pixels = (0..64 * 64).map(|i| depth(i % 64)).collect();
        DepthImage::from_meters(64, 64, pixels).unwrap()
    }

    #[test]
    fn the_incidence_angle_is_that_of_the_plane() {
        for degrees in [0.0, 20.0, 50.0, 70.0] {
            let cosine = incidence_cosine(&tilted(degrees), &camera(), 31, 31).unwrap();
            // Pixel 31 is 0.3 degrees off the axis.
            let angle = cosine.min(1.0).acos().to_degrees();
            assert!((angle - degrees).abs() < 0.5, "{degrees}: {angle}");
        }
    }

    #[test]
    fn grazing_surfaces_and_edges_are_lost_and_other_pixels_are_unchanged() {
        let sensor = |max_incidence_degrees, edge_pixels| DepthSensor {
            dropout: Dropout {
                max_incidence_degrees,
                edge_pixels,
            },
            ..DepthSensor::default()
        };
        let count = |depth: &DepthImage| depth.pixels().iter().filter(|z| **z > 0.0).count();
        let measure = |sensor: DepthSensor, depth: &DepthImage| {
            sensor.measure(&mut rng(1), depth, &camera()).unwrap()
        };
        let plane = tilted(60.0);
        assert_eq!(measure(DepthSensor::default(), &plane), plane);
        assert_eq!(count(&measure(sensor(Some(40.0), 0), &plane)), 0);
        assert_eq!(count(&measure(sensor(Some(89.0), 0), &plane)), 64 * 64);

        // A square of 20 pixels, 0.1 m in front of a wall. The image is empty below.
        let pixels = (0..64 * 64).map(|i| {
            let (u, v) = (i % 64, i / 64);
            let square = (20..40).contains(&u) && (10..30).contains(&v);
            if v >= 50 {
                0.0
            } else if square {
                0.5_f32
            } else {
                0.6
            }
        });
        let scene = DepthImage::from_meters(64, 64, pixels.collect()).unwrap();
        let lost = count(&scene) - count(&measure(sensor(None, 1), &scene));
        // One pixel inside and one outside (with corners) of the square's outline, and the row
        // above the empty part.
        assert_eq!(lost, (20 * 20 - 18 * 18) + (22 * 22 - 20 * 20) + 64);
    }

    #[test]
    fn depths_are_rounded_and_lost_pixels_do_not_change_the_noise_of_others() {
        let mut sensor = DepthSensor {
            noise: DepthNoise::Relative(crate::RelativeGaussian { percent: 1.0 }),
            quantization_meters: Some(0.001),
            ..DepthSensor::default()
        };
        let plane = tilted(60.0);
        let all = sensor.measure(&mut rng(2), &plane, &camera()).unwrap();
        assert!(
            all.pixels()
                .iter()
                .all(|z| (f64::from(*z) * 1e3 - (f64::from(*z) * 1e3).round()).abs() < 1e-3)
        );
        sensor.dropout.max_incidence_degrees = Some(60.0);
        let some = sensor.measure(&mut rng(2), &plane, &camera()).unwrap();
        let kept = some.pixels().iter().filter(|z| **z > 0.0).count();
        assert!((500..3600).contains(&kept), "{kept}");
        assert!(
            some.pixels()
                .iter()
                .zip(all.pixels())
                .all(|(a, b)| *a == 0.0 || a == b)
        );
    }

    #[test]
    fn errors_name_parameters_out_of_range() {
        let wrong = DepthSensor {
            quantization_meters: Some(-1.0),
            ..DepthSensor::default()
        };
        let error = wrong
            .measure(&mut rng(1), &tilted(0.0), &camera())
            .unwrap_err();
        assert_eq!(
            error.to_string(),
            "quantization in meters is -1, expected a number from 0 to 1"
        );
        let small = PinholeCamera::new(10.0, 10.0, 3.0, 3.0, 8, 8).unwrap();
        assert!(
            DepthSensor::default()
                .measure(&mut rng(1), &tilted(0.0), &small)
                .is_err()
        );
    }
}

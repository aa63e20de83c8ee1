//! The evidence of a pixel that it shows the object.

use hicp_core::internal::Surroundings;
use hicp_core::{Observation, RenderedView};

use super::line::{LENGTH, Line, SIDE};

/// Largest logarithm of odds of one pixel.
const MOST: f64 = 3.0;
/// Logarithm of the likelihood of a depth under anything but the object and the plane. The object
/// is as likely at a distance of √6 standard deviations.
const ANYTHING: f64 = -3.0;
/// Smallest logarithm of the likelihood of a depth under the object.
const LEAST: f64 = -6.0;
/// Logarithm of the likelihood under the plane from which on a pixel in front of the surface may be
/// background, and does not hide the object.
const ON_PLANE: f64 = -2.0;
/// Errors of the surface and of the plane that are not noise, in diameters.
const SURFACE_SIGMA: f64 = 0.03;
const PLANE_SIGMA: f64 = 0.015;
/// Logarithm of odds of a pixel outside the mask that has no depth: rather background.
const NO_DEPTH: f64 = -0.6;
/// Change of the object's depth per length outside of the silhouette that is expected.
const SLOPE: f64 = 0.5;

/// An image and a render.
pub(super) struct Evidence<'a> {
    pub(super) observation: &'a Observation,
    pub(super) view: &'a RenderedView,
    pub(super) surroundings: &'a Surroundings,
    /// The diameter of the model, meters.
    pub(super) diameter: f64,
}

impl Evidence<'_> {
    /// Fills in the evidence of the pixels of a line.
    pub(super) fn along(&self, mut line: Line) -> Line {
        let camera = self.observation.camera();
        for i in 0..LENGTH {
            if let Some(pixel) = line.pixel_at(i, camera) {
                (line.depth[i], line.mask[i]) = self.of(&line, i, pixel);
            }
        }
        line
    }

    /// Returns the evidence of depth and of the mask at a pixel of a line.
    fn of(&self, line: &Line, index: usize, (u, v): (u32, u32)) -> (f64, f64) {
        let masked = self.observation.mask().get(u, v) == Some(true);
        let mask = if masked { 1.0 } else { -1.0 };
        let measured = f64::from(self.observation.depth().get(u, v).unwrap_or(0.0));
        if measured <= 0.0 {
            return (if masked { 0.0 } else { NO_DEPTH }, mask);
        }
        let rendered = f64::from(self.view.depth_at(u, v));
        let surface = if index <= SIDE && rendered > 0.0 {
            rendered
        } else {
            line.point.z
        };
        let noise = self.surroundings.noise;
        let slope = SLOPE * Line::steps(index) * line.step_meters;
        let variance = noise.powi(2) + (SURFACE_SIGMA * self.diameter).powi(2) + slope.powi(2);
        let behind = measured - surface;
        let object = (-behind.powi(2) / (2.0 * variance)).max(LEAST);
        let plane = self.surroundings.plane.map_or(f64::NEG_INFINITY, |plane| {
            let height = plane.height(f64::from(u), f64::from(v), measured);
            -height.powi(2) / (2.0 * (noise.powi(2) + (PLANE_SIGMA * self.diameter).powi(2)))
        });
        let odds = object - plane.max(ANYTHING);
        if behind < 0.0 && odds < 0.0 && plane < ON_PLANE {
            return (0.0, 0.0);
        }
        (odds.clamp(-MOST, MOST), mask)
    }
}

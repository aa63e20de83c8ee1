//! A comparison of the flatness of the measured and the rendered surface.

use hicp_core::internal::DepthPlane;
use hicp_core::{Context, Isometry3, Observation, PixelRegion, RenderedView, Vector3};

/// Largest number of compared pixels.
const MAX_PIXELS: usize = 512;
/// Smallest number of pixels for a result.
const MIN_PIXELS: usize = 64;
/// Share of the pixels that are nearer than a reported distance.
///
/// The rest may be another surface, flying pixels or edges.
const SHARE: f64 = 0.7;
/// Share of the pixels, the nearest ones, for the next plane fit.
const FITTED: f64 = 0.8;
/// Number of fits.
const ROUNDS: usize = 4;
/// Smallest ratio of the distances from the pose's surface and from the plane for
/// [`Flatness::is_flat`].
const RATIO: f64 = 1.5;
/// Share of the diameter below which a distance counts as the error of a sensor and an ICP.
const SHARE_OF_DIAMETER: f64 = 0.01;
/// Share of the diameter within which a surface is flat, for a wall as measured by a sensor.
const FLAT: f64 = 0.03;

/// The flatness of the measured and the rendered surface where both are visible.
///
/// A wall, a table or a box in the place of the object may still have a good MVE. Its finest
/// tolerance is 5 % of the diameter, so a face or a side of the object fits against it. A plane
/// then explains the depth better than the pose does.
///
/// Every distance is the 70th percentile over the compared pixels, in meters along the optical
/// axis. The compared pixels are masked, have a depth, and show the rendered model; at most 512 of
/// them are used, on a grid. A plane is a least-squares fit of inverse depth, repeated over the
/// nearest 80 % of the pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Flatness {
    /// Distance from the measured to the rendered surface.
    pub residual: f64,
    /// Distance from the measured surface to the plane that fits it best.
    pub measured: f64,
    /// Distance from the rendered surface to the plane that fits it best.
    pub rendered: f64,
    /// Diameter of the model.
    pub diameter: f64,
}

impl Flatness {
    /// Creates a value from stored numbers, in meters; see the fields.
    #[must_use]
    pub fn new(residual: f64, measured: f64, rendered: f64, diameter: f64) -> Self {
        Self {
            residual,
            measured,
            rendered,
            diameter,
        }
    }

    /// Measures the flatness at a pose.
    ///
    /// Returns `None` if fewer than 64 pixels show both surfaces, or if no plane in front of the
    /// camera fits.
    ///
    /// Cost: one render (shared with other components that use this pose) and about 500 pixels,
    /// more if the common pixels are a small part of their boxes. Allocates nothing.
    #[must_use]
    pub fn at(context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> Option<Self> {
        let (model, observation) = context.problem.sides()?;
        let view = context.view(camera_from_object)?;
        let region = view.region().intersection(&observation.region());
        let mut pixels = [Pixel::default(); MAX_PIXELS];
        let mut step = (region.area() / MAX_PIXELS).isqrt().max(1);
        let mut n = loop {
            match gather(observation, view, region, step, &mut pixels) {
                Some(n) => break n,
                None => step += 1,
            }
        };
        if n < MAX_PIXELS / 4 {
            // The common pixels are a small part of the box: use a finer grid.
            let finer = step as f64 * (n.max(1) as f64 / MAX_PIXELS as f64).sqrt();
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            // Below the step before, not negative.
            let finer = (finer as usize).max(1);
            for step in finer..step {
                if let Some(more) = gather(observation, view, region, step, &mut pixels) {
                    n = more;
                    break;
                }
            }
        }
        let pixels = &pixels[..n];
        if n < MIN_PIXELS {
            return None;
        }
        let mut distances = [0.0; MAX_PIXELS];
        let distances = &mut distances[..n];
        for (distance, pixel) in distances.iter_mut().zip(pixels) {
            *distance = (pixel.measured - pixel.rendered).abs();
        }
        Some(Self {
            residual: nearest(distances, SHARE),
            measured: from_plane(pixels, |pixel| pixel.measured, distances)?,
            rendered: from_plane(pixels, |pixel| pixel.rendered, distances)?,
            diameter: model.diameter(),
        })
    }

    /// Returns whether the measured surface is a plane that the pose does not explain.
    ///
    /// It requires all of these:
    ///
    /// - The measured surface is within 3 % of the diameter of a plane.
    /// - Its distance from the rendered surface is more than 1.5 times its distance from that
    ///   plane.
    /// - The rendered surface is farther from a plane than the measured one.
    /// - The distance between the surfaces, and that of the rendered one from its plane, exceed 1 %
    ///   of the diameter.
    ///
    /// A flat face of the model fits a wall as well as its own place. This test does not detect
    /// that.
    #[must_use]
    pub fn is_flat(&self) -> bool {
        let least = SHARE_OF_DIAMETER * self.diameter;
        self.measured < FLAT * self.diameter
            && self.residual > least.max(RATIO * self.measured)
            && self.rendered > least.max(self.measured)
    }
}

/// A pixel with both depths in meters, relative to the corner of the compared region.
#[derive(Clone, Copy, Default)]
struct Pixel {
    u: f64,
    v: f64,
    measured: f64,
    rendered: f64,
}

/// Collects the pixels of a region that show both surfaces, on a grid with a given step.
///
/// Returns their number, or `None` if there are too many.
fn gather(
    observation: &Observation,
    view: &RenderedView,
    region: PixelRegion,
    step: usize,
    pixels: &mut [Pixel; MAX_PIXELS],
) -> Option<usize> {
    let (depth, mask) = (observation.depth(), observation.mask().pixels());
    let width = depth.width() as usize;
    let mut n = 0;
    for (u, v) in region.grid(step) {
        let index = v as usize * width + u as usize;
        let (measured, rendered) = (depth.pixels()[index], view.depth_at(u, v));
        if mask[index] && measured > 0.0 && rendered > 0.0 {
            let [u, v] = [u - region.u_min, v - region.v_min].map(f64::from);
            let [measured, rendered] = [measured, rendered].map(f64::from);
            *pixels.get_mut(n)? = Pixel {
                u,
                v,
                measured,
                rendered,
            };
            n += 1;
        }
    }
    Some(n)
}

/// Returns the distance that a share of the distances stays below. Reorders them.
fn nearest(distances: &mut [f64], share: f64) -> f64 {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // Not negative, below the length as shares are below 1.
    let place = (distances.len() as f64 * share) as usize;
    *distances.select_nth_unstable_by(place, f64::total_cmp).1
}

/// Returns the distance, along the optical axis, of seven tenths of a surface from its best plane.
///
/// `scratch` is as long as `pixels`. If no plane fits, returns `None`. In an image the inverse
/// depth of a plane is linear: 1/z = a + b u + c v.
fn from_plane(pixels: &[Pixel], depth: impl Fn(&Pixel) -> f64, scratch: &mut [f64]) -> Option<f64> {
    let mut plane = None;
    let mut limit = f64::INFINITY;
    for _ in 0..ROUNDS {
        let fitted = pixels.iter().filter(|pixel| {
            plane.is_none_or(|plane| distance(&plane, pixel, depth(pixel)) <= limit)
        });
        let best = DepthPlane::fit(fitted.map(|p| Vector3::new(p.u, p.v, depth(p))))?;
        plane = Some(best);
        for (distance_of, pixel) in scratch.iter_mut().zip(pixels) {
            *distance_of = distance(&best, pixel, depth(pixel));
        }
        limit = nearest(scratch, FITTED);
    }
    Some(nearest(scratch, SHARE)).filter(|distance| distance.is_finite())
}

/// Returns the distance of a depth from a plane, along the optical axis.
///
/// It is infinite if the plane is not in front of the camera.
fn distance(plane: &DepthPlane, pixel: &Pixel, z: f64) -> f64 {
    (z - plane.depth(pixel.u, pixel.v)).abs()
}

//! Compares how flat the measured and the rendered surface are.

use hicp_core::{Context, Isometry3, Matrix3, Observation, PixelRegion, RenderedView, Vector3};

/// Largest number of pixels that are compared.
const MAX_PIXELS: usize = 512;
/// Smallest number of pixels for a result.
const MIN_PIXELS: usize = 64;
/// Share of the pixels that are nearer than a reported distance. The rest may be another surface,
/// flying pixels or edges.
const SHARE: f64 = 0.7;
/// Share of the pixels, the nearest ones, that the next plane is fitted to.
const FITTED: f64 = 0.8;
/// Number of fits.
const ROUNDS: usize = 4;
/// Least ratio of the distances from the pose's surface and from the plane for
/// [`Flatness::is_flat`].
const RATIO: f64 = 1.5;
/// Share of the diameter below which a distance is the error of a sensor and an ICP.
const SHARE_OF_DIAMETER: f64 = 0.01;
/// Share of the diameter within which a surface is flat, as a sensor measures a wall.
const FLAT: f64 = 0.03;

/// How flat the measured and the rendered surface are where both are seen, and how far apart they
/// are.
///
/// A wall, a table or a box in the place of the object may still have a good MVE: its finest
/// tolerance is 5 % of the diameter, so a face or a side of the object lies flat against it. A
/// plane then explains the depth better than the pose does.
///
/// Every distance is in meters along the optical axis, and seven tenths of the pixels are nearer.
/// The pixels are those of the mask with depth where the model is rendered, on a grid of at most
/// 512. The plane has the least squares of inverse depths, fitted again to the nearest eight tenths
/// of the pixels.
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
    /// Creates a value from stored numbers, meters; see the fields.
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

    /// Whether what was measured is flat, a plane explains it better than the pose does, and the
    /// model is less flat: the measured surface is within 3 % of the diameter of a plane and more
    /// than half as far again from the rendered one, the rendered one is further from a plane than
    /// the measured one, and both these distances are more than 1 % of the diameter.
    ///
    /// A face of the model that is itself flat lies on a wall as in its own place: of that this
    /// says nothing.
    #[must_use]
    pub fn is_flat(&self) -> bool {
        let least = SHARE_OF_DIAMETER * self.diameter;
        self.measured < FLAT * self.diameter
            && self.residual > least.max(RATIO * self.measured)
            && self.rendered > least.max(self.measured)
    }
}

/// A pixel with both depths, metres, counted from the corner of the region that is looked at.
#[derive(Clone, Copy, Default)]
struct Pixel {
    u: f64,
    v: f64,
    measured: f64,
    rendered: f64,
}

/// Gathers the pixels of a region that show both surfaces, on a grid of that step; returns how
/// many, `None` when they are too many.
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
    for v in (region.v_min..region.v_max).step_by(step) {
        for u in (region.u_min..region.u_max).step_by(step) {
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
    }
    Some(n)
}

/// The distance that a share of the distances stays below. Reorders them.
fn nearest(distances: &mut [f64], share: f64) -> f64 {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // Not negative, below the length as shares are below 1.
    let place = (distances.len() as f64 * share) as usize;
    *distances.select_nth_unstable_by(place, f64::total_cmp).1
}

/// The distance along the optical axis that seven tenths of a surface stay below, from the plane
/// that fits it best; `scratch` is as long as `pixels`. `None` where no plane fits.
///
/// In an image the inverse depth of a plane is linear: 1/z = a + b u + c v.
fn from_plane(pixels: &[Pixel], depth: impl Fn(&Pixel) -> f64, scratch: &mut [f64]) -> Option<f64> {
    let mut plane = Vector3::zeros();
    let mut limit = f64::INFINITY;
    for round in 0..ROUNDS {
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for pixel in pixels {
            let z = depth(pixel);
            if round == 0 || distance(&plane, pixel, z) <= limit {
                let row = Vector3::new(1.0, pixel.u, pixel.v);
                normal += row * row.transpose();
                right += row / z;
            }
        }
        plane = normal.try_inverse()? * right;
        for (distance_of, pixel) in scratch.iter_mut().zip(pixels) {
            *distance_of = distance(&plane, pixel, depth(pixel));
        }
        limit = nearest(scratch, FITTED);
    }
    Some(nearest(scratch, SHARE)).filter(|distance| distance.is_finite())
}

/// How far a depth is from a plane, along the optical axis; infinite where the plane is not in
/// front of the camera.
fn distance(plane: &Vector3<f64>, pixel: &Pixel, z: f64) -> f64 {
    let inverse = plane.x + plane.y * pixel.u + plane.z * pixel.v;
    if inverse > 0.0 {
        (z - 1.0 / inverse).abs()
    } else {
        f64::INFINITY
    }
}

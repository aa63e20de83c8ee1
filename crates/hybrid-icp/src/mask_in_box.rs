//! Masks from bounding boxes: the measured pixels of a box without the plane around it.

use hicp_core::internal::{self, DepthPlane};
use hicp_core::{DepthImage, Mask, PinholeCamera, PixelRegion, Vector3};

/// Growth of the box on every side, relative to its longer side. The pixels around the box show
/// what the object stands on or in front of.
const GROWTH: f64 = 0.15;
/// Largest number of pixels around the box that a plane is fitted to.
const MAX_SAMPLES: usize = 512;
/// Smallest number of these pixels for a plane.
const MIN_SAMPLES: usize = 48;
/// Number of planes through three pixels that are tried.
const ROUNDS: usize = 64;
/// Standard deviations of the noise within which a pixel belongs to the plane.
const DEVIATIONS: f64 = 2.0;
/// Smallest relative distance within which a pixel belongs to the plane.
const FINEST: f64 = 0.004;
/// Largest distance within which a pixel belongs to the plane, relative to the longer side of the
/// box at the same depth.
const COARSEST: f64 = 0.25;
/// Smallest share of the box's measured pixels that must remain in front of the plane.
const LEAST_LEFT: f64 = 0.02;

/// Returns the measured pixels of a bounding box that are in front of the plane around it.
///
/// It replaces a segmentation for [`Refiner::estimate`](crate::Refiner::estimate). The box has the
/// form of BOP and COCO: x and y of its corner, width and height, in pixels. The depth image must
/// have the size of the camera.
///
/// The plane is a table or a wall. It is found in the pixels around the box, so the object's own
/// faces do not count: a least-median fit over 64 planes, then least squares. If less than half of
/// these pixels lie on one plane, or nothing in the box is in front of it, all measured pixels
/// remain. The mask is empty if nothing was measured in the box.
///
/// Deterministic. Cost: O(image) to clear, then O(box).
///
/// ```
/// use hybrid_icp::core::{DepthImage, PinholeCamera};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// // A cube of 20 pixels in front of a wall, in a larger box.
/// let camera = PinholeCamera::new(100.0, 100.0, 31.5, 31.5, 64, 64)?;
/// let depth = (0..64 * 64).map(|i| if (22..42).contains(&(i % 64)) && (22..42).contains(&(i / 64)) { 0.6 } else { 0.8 });
/// let depth = DepthImage::from_meters(64, 64, depth.collect())?;
/// let mask = hybrid_icp::mask_in_box(&depth, &camera, [20.0, 20.0, 25.0, 25.0]);
/// assert_eq!(mask.n_set(), 20 * 20);
/// # Ok(()) }
/// ```
#[must_use]
pub fn mask_in_box(depth: &DepthImage, camera: &PinholeCamera, bbox: [f64; 4]) -> Mask {
    let region = pixels_of(bbox, 0.0, depth);
    let around = pixels_of(bbox, GROWTH * bbox[2].max(bbox[3]), depth);
    let measured = |u: u32, v: u32| depth.get(u, v).map(f64::from).filter(|z| *z > 0.0);
    let size = (bbox[2] / camera.fx()).max(bbox[3] / camera.fy());
    let plane =
        Plane::around(region, around, measured).filter(|plane| plane.tolerance < COARSEST * size);
    let in_front = |u, v| match (measured(u, v), &plane) {
        (Some(z), Some(plane)) => plane.distance(u, v, z) < -plane.tolerance,
        (z, _) => z.is_some(),
    };
    let (width, height) = (depth.width(), depth.height());
    let everything = Mask::in_region(width, height, &region, |u, v| measured(u, v).is_some());
    let foreground = Mask::in_region(width, height, &region, in_front);
    match foreground.n_set() as f64 > LEAST_LEFT * everything.n_set() as f64 {
        true => foreground,
        false => everything,
    }
}

/// Returns the pixels of a box that is grown on every side, within the image.
fn pixels_of([x, y, width, height]: [f64; 4], by: f64, depth: &DepthImage) -> PixelRegion {
    // The cast saturates, and NaN becomes 0.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let pixel = |at: f64, side: u32| (at.max(0.0) as u32).min(side);
    PixelRegion {
        u_min: pixel((x - by).round(), depth.width()),
        v_min: pixel((y - by).round(), depth.height()),
        u_max: pixel((x + width + by).round(), depth.width()),
        v_max: pixel((y + height + by).round(), depth.height()),
    }
}

/// The plane around a box.
struct Plane {
    plane: DepthPlane,
    /// Relative distance within which a pixel belongs to the plane.
    tolerance: f64,
}

impl Plane {
    /// Fits the plane to the pixels of one region outside of another.
    fn around(
        inner: PixelRegion,
        outer: PixelRegion,
        depth: impl Fn(u32, u32) -> Option<f64>,
    ) -> Option<Self> {
        let step = (outer.area().saturating_sub(inner.area()) / MAX_SAMPLES)
            .isqrt()
            .max(1);
        let pixels: Vec<Vector3<f64>> = outer
            .grid(step)
            .filter(|(u, v)| !inner.contains(*u, *v))
            .filter_map(|(u, v)| Some(Vector3::new(f64::from(u), f64::from(v), depth(u, v)?)))
            .collect();
        if pixels.len() < MIN_SAMPLES {
            return None;
        }
        let distance = |plane: &DepthPlane, pixel: &Vector3<f64>| {
            (pixel.z * plane.inverse_depth(pixel.x, pixel.y) - 1.0).abs()
        };
        let mut residuals = Vec::with_capacity(pixels.len());
        let mut median = |plane: &DepthPlane| {
            residuals.clear();
            residuals.extend(pixels.iter().map(|pixel| distance(plane, pixel)));
            internal::median(&mut residuals, f64::total_cmp).unwrap_or(f64::INFINITY)
        };
        let planes = DepthPlane::through_three(&pixels, ROUNDS);
        let scored = planes.map(|plane| (median(&plane), plane));
        let (spread, plane) = scored.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let limit = 3.0 * spread.max(0.1 * FINEST);
        let near = pixels
            .iter()
            .filter(|pixel| distance(&plane, pixel) <= limit);
        let plane = DepthPlane::fit(near.copied())?;
        // The median of the absolute values is 0.67 standard deviations.
        let tolerance = (DEVIATIONS * median(&plane) / 0.6745).max(FINEST);
        Some(Self { plane, tolerance })
    }

    /// Returns the distance of a depth behind the plane along the ray, relative to the plane's.
    fn distance(&self, u: u32, v: u32, z: f64) -> f64 {
        z * self.plane.inverse_depth(f64::from(u), f64::from(v)) - 1.0
    }
}

//! Depth images as another camera sees them.

use hicp_core::{DepthImage, Isometry3, PinholeCamera, Point3};

use crate::number::{narrow, whole};

/// The largest side of the area of a pixel in the other image, pixels.
const MOST_PIXELS: f64 = 64.0;

/// Returns the depth image that the camera `to` sees, from the depth image of the camera `from`.
///
/// `to_from_from` is the pose of `from` in the frame of `to`, meters. Use it if the mask belongs to
/// a color camera with other intrinsics next to the depth camera.
///
/// Every measured pixel is a small square in front of `to`. If several overlap, the nearest one
/// counts. Pixels that no square covers are missing, such as background that an edge hides from the
/// depth camera. A square that would cover more than 64 pixels along a side, very near to the other
/// camera, is skipped.
///
/// Cost: proportional to the pixels of both images, and to those that the squares cover.
#[must_use]
pub fn register_depth(
    depth: &DepthImage,
    from: &PinholeCamera,
    to: &PinholeCamera,
    to_from_from: &Isometry3<f64>,
) -> DepthImage {
    let (width, height) = (to.width(), to.height());
    let mut nearest = vec![f32::INFINITY; width as usize * height as usize];
    let project = |u: f64, v: f64, z: f64| {
        let ray = Point3::new(
            (u - from.cx()) / from.fx(),
            (v - from.cy()) / from.fy(),
            1.0,
        );
        let point = to_from_from * (ray * z);
        let (x, y) = (point.x / point.z, point.y / point.z);
        ([x * to.fx() + to.cx(), y * to.fy() + to.cy()], point.z)
    };
    for (index, z) in depth.pixels().iter().enumerate().filter(|(_, z)| **z > 0.0) {
        let (u, v) = (
            index % depth.width() as usize,
            index / depth.width() as usize,
        );
        let (u, v, z) = (u as f64, v as f64, f64::from(*z));
        let (_, depth) = project(u, v, z);
        let corners = [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)];
        let corners = corners.map(|(du, dv)| project(u + du, v + dv, z).0);
        // A square smaller than a pixel still covers the pixel that its center is in.
        let span = |axis: usize, side: u32| {
            let places = corners.map(|corner| corner[axis]);
            let low = places.into_iter().fold(f64::INFINITY, f64::min);
            let high = places.into_iter().fold(f64::NEG_INFINITY, f64::max);
            let middle = ((low + high) / 2.0).round();
            let small = high - low <= MOST_PIXELS;
            let (first, last) = (
                low.ceil().min(middle).max(0.0),
                (high.ceil() - 1.0).max(middle),
            );
            (small && last >= 0.0 && first < f64::from(side)).then(|| {
                let last = last.min(f64::from(side) - 1.0);
                whole(first)..=whole(last)
            })
        };
        let (Some(columns), Some(rows)) = (span(0, width), span(1, height)) else {
            continue;
        };
        if depth <= 0.0 {
            continue;
        }
        for row in rows {
            for column in columns.clone() {
                let pixel = &mut nearest[row as usize * width as usize + column as usize];
                *pixel = pixel.min(narrow(depth));
            }
        }
    }
    // Infinity becomes missing.
    let image = DepthImage::from_meters(width, height, nearest);
    image.unwrap_or_else(|_| depth.clone())
}

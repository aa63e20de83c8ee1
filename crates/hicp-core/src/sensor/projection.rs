//! Depth images of point clouds.

use nalgebra::{Isometry3, Point3};

use crate::sensor::camera::PinholeCamera;
use crate::sensor::image::DepthImage;

impl DepthImage {
    /// Projects points into a camera: the depth image that it sees of a cloud.
    ///
    /// Use it for clouds of a depth sensor, whose viewpoint is the camera, and make an
    /// [`Observation`](crate::Observation) of the image. `camera_from_points` is the pose of the
    /// points' frame, often the identity; points are in meters. A point fills the pixel that it
    /// falls into, and the nearest one counts. Pixels without points are missing, so choose a
    /// camera that is at most as fine as the cloud. Points that are not finite, not in front or
    /// outside of the image are skipped.
    ///
    /// Cost: proportional to the points and the pixels.
    ///
    /// ```
    /// use hicp_core::{DepthImage, Isometry3, PinholeCamera, Point3};
    /// # fn main() -> Result<(), hicp_core::CameraError> {
    /// let camera = PinholeCamera::new(100.0, 100.0, 3.0, 2.0, 8, 6)?;
    /// let points = [Point3::new(0.02, 0.0, 1.0), Point3::new(0.0, 0.0, -1.0)];
    /// let depth = DepthImage::from_points(points, &camera, &Isometry3::identity());
    /// assert_eq!(depth.get(5, 2), Some(1.0));
    /// # Ok(()) }
    /// ```
    #[must_use]
    pub fn from_points(
        points: impl IntoIterator<Item = Point3<f32>>,
        camera: &PinholeCamera,
        camera_from_points: &Isometry3<f64>,
    ) -> Self {
        let (width, height) = (camera.width(), camera.height());
        let mut nearest = vec![f32::INFINITY; width as usize * height as usize];
        for point in points {
            let point = camera_from_points * point.cast::<f64>();
            let Some(pixel) = camera.project(&point) else {
                continue;
            };
            let (u, v) = (pixel.x.round(), pixel.y.round());
            // False for NaN.
            let (columns, rows) = (0.0..f64::from(width), 0.0..f64::from(height));
            if columns.contains(&u) && rows.contains(&v) {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                let (index, depth) = (v as usize * width as usize + u as usize, point.z as f32);
                nearest[index] = nearest[index].min(depth);
            }
        }
        // Infinity becomes missing.
        Self::from_meters(width, height, nearest)
            .unwrap_or_else(|_| unreachable!("there is one depth per pixel"))
    }
}

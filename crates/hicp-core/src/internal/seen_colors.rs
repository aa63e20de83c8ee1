//! The colors of a model next to those of an image.

use std::sync::Arc;

use nalgebra::{Isometry3, Point2, Point3, Vector3};

use crate::internal::background::Surroundings;
use crate::object::model::Model;
use crate::object::sampling::sample_colored_surface;
use crate::sensor::camera::PinholeCamera;
use crate::sensor::image::ColorImage;
use crate::sensor::observation::Observation;
use crate::surfel::Surfel;

/// Share of the diameter by which measured and modeled depth may differ.
const AGREES: f64 = 0.05;
/// The same in standard deviations of the depth noise, if that is more.
const SIGMAS: f64 = 2.0;
/// The channel value from which on a pixel is overexposed.
const OVEREXPOSED: u8 = 250;

/// The pixels of a color image that show a model.
#[derive(Clone, Copy, Debug)]
pub struct SeenColors<'a> {
    colors: &'a ColorImage,
    observation: &'a Observation,
    tolerance: f64,
}

impl<'a> SeenColors<'a> {
    /// Returns the colors of an observation, or `None` if it or the model has none.
    #[must_use]
    pub fn of(model: &Model, observation: &'a Observation) -> Option<Self> {
        model.mesh().color()?;
        let noise = Surroundings::of(observation).noise;
        Some(Self {
            colors: observation.color()?,
            observation,
            tolerance: (AGREES * model.diameter()).max(SIGMAS * noise),
        })
    }

    /// Returns the color of pixel (u, v), if it shows the model's surface in a depth of `z` meters.
    ///
    /// It does not count if another surface was measured there, or if the pixel is not masked or
    /// overexposed.
    #[inline]
    #[must_use]
    pub fn at(&self, (u, v): (u32, u32), z: f64) -> Option<[u8; 3]> {
        let index = v as usize * self.colors.width() as usize + u as usize;
        let measured = f64::from(self.observation.depth().pixels()[index]);
        let seen = self.observation.mask().pixels()[index]
            && (measured <= 0.0 || (measured - z).abs() < self.tolerance);
        let pixel = self.colors.pixels()[index];
        (seen && pixel.iter().all(|value| *value < OVEREXPOSED)).then_some(pixel)
    }
}

/// Returns whether a surface is seen well: not from behind and not from the side.
#[inline]
#[must_use]
pub fn faces_camera(point: &Point3<f64>, normal: &Vector3<f64>) -> bool {
    let along = normal.dot(&point.coords);
    along < 0.0 && along * along > 0.09 * point.coords.norm_squared()
}

/// Colored points that are spread evenly over a model.
#[derive(Debug)]
pub struct ColorSamples {
    points: Vec<(Surfel, [f32; 3])>,
    contrast: f64,
    /// `true` if normals are certain to point out of the object.
    oriented: bool,
}

/// A sample that faces the camera, in the camera frame.
#[derive(Clone, Copy, Debug)]
pub struct FacingSample {
    /// Its place, meters.
    pub point: Point3<f64>,
    /// The normal, toward the camera.
    pub normal: Vector3<f64>,
    /// The place in the image, pixels. It lies in the square of a pixel of the image.
    pub pixel: Point2<f64>,
    /// The color of the model, 0 to 255.
    pub color: [f32; 3],
}

impl FacingSample {
    /// Returns the pixel whose square contains the sample.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // Inside the image.
    #[inline]
    #[must_use]
    pub fn nearest(&self) -> (u32, u32) {
        ((self.pixel.x + 0.5) as u32, (self.pixel.y + 0.5) as u32)
    }
}

impl ColorSamples {
    /// Returns `count` samples of a model, which are computed once.
    ///
    /// There is none if the model has no color.
    #[must_use]
    pub fn of(model: &Model, count: usize) -> Arc<Self> {
        model.derived().get_or_build(count as u64, || {
            let points = sample_colored_surface(model.mesh(), count);
            Self {
                contrast: contrast(&points),
                oriented: model.mesh().is_closed(),
                points,
            }
        })
    }

    /// Returns the standard deviation of the colors, gray levels.
    #[must_use]
    pub fn contrast(&self) -> f64 {
        self.contrast
    }

    /// Calls `visit` with every sample that faces the camera and lies in the image at a pose.
    ///
    /// Some of them may be hidden.
    #[inline]
    pub fn visit(
        &self,
        camera: &PinholeCamera,
        camera_from_object: &Isometry3<f64>,
        mut visit: impl FnMut(&FacingSample),
    ) {
        let (width, height) = (f64::from(camera.width()), f64::from(camera.height()));
        let rotation = camera_from_object.rotation.to_rotation_matrix();
        let translation = &camera_from_object.translation.vector;
        let eye = camera_from_object.inverse().translation.vector;
        let eye = Point3::from(eye.cast::<f32>());
        for (surfel, color) in &self.points {
            // The far side of a closed mesh is skipped before anything is computed.
            if self.oriented && surfel.normal.dot(&(surfel.point - eye)) >= 0.0 {
                continue;
            }
            let mut normal = rotation * surfel.normal.cast::<f64>().into_inner();
            let point = rotation * surfel.point.cast::<f64>() + translation;
            if normal.dot(&point.coords) > 0.0 {
                normal = -normal;
            }
            if !faces_camera(&point, &normal) {
                continue;
            }
            let Some(pixel) = camera.project(&point) else {
                continue;
            };
            let (u, v) = (pixel.x + 0.5, pixel.y + 0.5);
            if u >= 0.0 && v >= 0.0 && u < width && v < height {
                visit(&FacingSample {
                    point,
                    normal,
                    pixel,
                    color: *color,
                });
            }
        }
    }
}

/// Returns the standard deviation of colors over all channels.
fn contrast(points: &[(Surfel, [f32; 3])]) -> f64 {
    let n = points.len().max(1) as f64;
    let mean = |channel: usize, value: fn(f64) -> f64| {
        let colors = points.iter().map(|(_, color)| f64::from(color[channel]));
        colors.map(value).sum::<f64>() / n
    };
    let variance = |channel| mean(channel, |x| x * x) - mean(channel, |x| x).powi(2);
    ((0..3).map(variance).sum::<f64>() / 3.0).max(0.0).sqrt()
}

//! Simulated color images.

use hicp_core::{
    ColorImage, Isometry3, Mask, Model, PinholeCamera, RenderedView, Renderer, Vector3,
};
use hicp_raster::Rasterizer;
use rand::RngExt;
use rand_distr::{Distribution, Normal};

use crate::SimRng;
use crate::error::SimError;
use crate::sampling::unit_vector;

/// The light of a scene and the exposure of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lighting {
    /// Unit vector toward the lamp, camera frame.
    pub direction: Vector3<f64>,
    /// Share of the light that comes from everywhere, 0 to 1; the rest comes from the lamp.
    pub ambient: f64,
    /// Brightness of the highlight where the surface mirrors the lamp, as a share of white.
    pub highlight: f64,
    /// Factor of all channels.
    pub exposure: f64,
    /// Factors of red, green and blue.
    pub white_balance: [f64; 3],
    /// Standard deviation of the noise of a channel, gray levels.
    pub noise: f64,
    /// Factor of the light in a shadow that covers one half of the object; 1 for no shadow.
    pub shadow: f64,
}

impl Lighting {
    /// Draws the light of an ordinary scene, without shadow.
    pub fn draw(rng: &mut SimRng) -> Self {
        let mut direction = unit_vector(rng);
        // The lamp is on the side of the camera.
        direction.z = -direction.z.abs();
        Self {
            direction,
            ambient: rng.random_range(0.3..0.9),
            highlight: rng.random_range(0.0..0.5),
            exposure: rng.random_range(0.6..1.4),
            white_balance: [(); 3].map(|()| rng.random_range(0.8..1.2)),
            noise: rng.random_range(0.0..8.0),
            shadow: 1.0,
        }
    }

    /// Returns the color image of a model at a pose `camera_from_object`.
    ///
    /// The pixels of `visible` show the model, and all others random patches of color. Cost: one
    /// render, and O(image).
    ///
    /// # Errors
    ///
    /// Never if the mask has the size of the camera.
    pub fn photograph(
        &self,
        rng: &mut SimRng,
        model: &Model,
        camera_from_object: &Isometry3<f64>,
        visible: &Mask,
        camera: &PinholeCamera,
    ) -> Result<ColorImage, SimError> {
        let mut view = RenderedView::default();
        let mesh = model.mesh();
        let region = camera.region();
        Rasterizer::default().render(mesh, camera, camera_from_object, &region, &mut view);
        let patches: Vec<[f64; 3]> = (0..64 * 64)
            .map(|_| [(); 3].map(|()| rng.random_range(0.0..255.0)))
            .collect();
        let center = camera_from_object * model.center();
        let across = unit_vector(rng);
        let noise = Normal::new(0.0, self.noise.max(0.0));
        let mut pixels = Vec::with_capacity(region.area());
        for (u, v) in region.pixels() {
            let seen = visible.get(u, v) == Some(true);
            let surfel = view.surfel_at(u, v, mesh, camera, camera_from_object);
            let color = view.color_at(u, v, mesh, camera, camera_from_object);
            let mut value = patches[(v / 16 % 64 * 64 + u / 16 % 64) as usize];
            if let (true, Some(surfel), Some(color)) = (seen, surfel, color) {
                let normal = surfel.normal.cast::<f64>().into_inner();
                let toward_lamp = normal.dot(&self.direction);
                let mirrored = normal * (2.0 * toward_lamp) - self.direction;
                let to_camera = -surfel.point.cast::<f64>().coords.normalize();
                let gloss = mirrored.dot(&to_camera).max(0.0).powi(30);
                let side = (surfel.point.cast::<f64>() - center).dot(&across);
                let lit = if side > 0.0 { self.shadow } else { 1.0 };
                let light = lit * (self.ambient + (1.0 - self.ambient) * toward_lamp.max(0.0));
                value = color.map(|c| f64::from(c) * light + lit * 255.0 * self.highlight * gloss);
            }
            let mut pixel = [0; 3];
            for (channel, pixel) in pixel.iter_mut().enumerate() {
                let gain = self.exposure * self.white_balance[channel];
                let random = noise.as_ref().map_or(0.0, |noise| noise.sample(rng));
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // Saturates.
                let value = (value[channel] * gain + random).round() as u8;
                *pixel = value;
            }
            pixels.push(pixel);
        }
        Ok(ColorImage::new(camera.width(), camera.height(), pixels)?)
    }
}

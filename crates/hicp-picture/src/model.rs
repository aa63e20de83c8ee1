//! Pictures of models alone.

use hicp_core::{Isometry3, Model, PinholeCamera, RenderedView, Renderer, UnitQuaternion, Vector3};
use hicp_raster::Rasterizer;

use crate::{Picture, PictureError};

/// Yellow, as CAD models are in the paper's pictures.
const SURFACE: [f64; 3] = [240.0, 200.0, 90.0];

impl Picture {
    /// Shows a model from obliquely above, on white. It fills a square of `side` pixels.
    ///
    /// # Errors
    ///
    /// [`PictureError::Camera`] if no image has such sides.
    pub fn of_model(model: &Model, side: u32) -> Result<Self, PictureError> {
        let mut picture = Self::white(side, side);
        let middle = (f64::from(side) - 1.0) / 2.0;
        let focal = 2.5 * f64::from(side);
        let camera = PinholeCamera::new(focal, focal, middle, middle, side, side)?;
        // Object z points up in the picture. Rotate around it, then tip the model to the viewer.
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.6);
        let tip =
            UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2 + 0.5);
        let rotation = tip * turn;
        let distance = model.radius() * focal / (0.46 * f64::from(side));
        let shift = Vector3::new(0.0, 0.0, distance) - rotation * model.center().coords;
        let camera_from_object = Isometry3::from_parts(shift.into(), rotation);
        let mut view = RenderedView::default();
        Rasterizer::default().render(
            model.mesh(),
            &camera,
            &camera_from_object,
            &camera.region(),
            &mut view,
        );
        let light = Vector3::new(-0.4, -0.7, -0.6).normalize();
        for (u, v) in camera.region().pixels() {
            let Some(surfel) = view.surfel_at(u, v, model.mesh(), &camera, &camera_from_object)
            else {
                continue;
            };
            let lit = surfel.normal.cast::<f64>().dot(&light).max(0.0);
            let color = SURFACE.map(|full| (full * (0.3 + 0.7 * lit)) as u8);
            picture.mix((u.into(), v.into()), color, 1.0);
        }
        Ok(picture)
    }
}

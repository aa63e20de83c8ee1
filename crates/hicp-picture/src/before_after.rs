//! Pictures of a refinement: the object with the outlines of its model before and after.

use hicp_core::{
    CameraError, DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, PixelRegion,
    RenderedView, Renderer,
};
use hicp_raster::Rasterizer;

use crate::legend::{LEFT, Legend, WIDTH};
use crate::{AGAINST, Ink, Picture, PictureError, RESULT};

/// The least width and height that are shown of an image, in pixels of the image.
const LEAST: [u32; 2] = [320, 160];
/// The widest region that is shown twice as large.
const MOST_ENLARGED: usize = 1000;

impl Picture {
    /// Shows the depth around an object with the model's outlines at some poses, and their
    /// captions.
    ///
    /// A single pose is the result. Of two poses, the second is the result. Further poses have no
    /// outline.
    ///
    /// The picture contains the mask and all silhouettes, with a margin. Poses are
    /// `camera_from_object`, meters.
    ///
    /// # Errors
    ///
    /// [`PictureError`] if the picture is too large, or if a caption cannot be drawn.
    pub fn before_and_after(
        model: &Model,
        observation: &Observation,
        poses: &[(&Isometry3<f64>, String)],
    ) -> Result<Self, PictureError> {
        let camera = observation.camera();
        let (mut rasterizer, mut view) = (Rasterizer::default(), RenderedView::default());
        let mut shown = observation.mask().pixels().to_vec();
        for (pose, _) in poses {
            rasterizer.render(model.mesh(), camera, pose, &camera.region(), &mut view);
            for (u, v) in view.covered() {
                shown[v as usize * camera.width() as usize + u as usize] = true;
            }
        }
        let shown = Mask::new(camera.width(), camera.height(), shown)?;
        let shown = with_margin(shown.bounding_region(), camera);
        let scale = 1 + u32::from(shown.width() <= MOST_ENLARGED);
        let camera = enlarged(camera, shown, scale)?;
        let depth = |u, v| {
            observation
                .depth()
                .get(shown.u_min + u / scale, shown.v_min + v / scale)
        };
        let pixels = camera
            .region()
            .pixels()
            .map(|(u, v)| depth(u, v).unwrap_or(0.0));
        let depth = DepthImage::collect(camera.width(), camera.height(), pixels)?;

        let mut picture = Self::of_depth(&depth);
        let mut ink = Ink::of(&picture);
        let kinds = [AGAINST, RESULT].into_iter();
        let lines = poses.iter().zip(kinds.skip(usize::from(poses.len() < 2)));
        for ((pose, _), line) in lines.clone() {
            rasterizer.render(model.mesh(), &camera, pose, &camera.region(), &mut view);
            ink.outline(&view, line, |_, _, _| false);
        }
        picture.draw(&ink);
        let mut legend = Legend::below(&picture, poses.len())?;
        for (row, ((_, caption), line)) in (0..).zip(lines) {
            legend.line(caption, (LEFT, row), WIDTH - 2 * LEFT, line);
        }
        legend.finish()
    }
}

/// Returns a region with a margin, or the whole image for an empty region.
fn with_margin(region: PixelRegion, camera: &PinholeCamera) -> PixelRegion {
    if region.is_empty() {
        return camera.region();
    }
    let wider = |min: u32, max: u32, least: u32, side: u32| {
        let size = ((max - min) * 5 / 4).max(least).min(side);
        let first = ((min + max).saturating_sub(size) / 2).min(side - size);
        (first, first + size)
    };
    let (u_min, u_max) = wider(region.u_min, region.u_max, LEAST[0], camera.width());
    let (v_min, v_max) = wider(region.v_min, region.v_max, LEAST[1], camera.height());
    PixelRegion {
        u_min,
        v_min,
        u_max,
        v_max,
    }
}

/// Returns the camera of a region of the image, with `scale` pixels for every pixel of a row.
fn enlarged(
    camera: &PinholeCamera,
    region: PixelRegion,
    scale: u32,
) -> Result<PinholeCamera, CameraError> {
    let factor = f64::from(scale);
    // The middle of the first of the new pixels is above the middle of the old one.
    let place = |center: f64, first: u32| (center - f64::from(first) + 0.5) * factor - 0.5;
    PinholeCamera::new(
        camera.fx() * factor,
        camera.fy() * factor,
        place(camera.cx(), region.u_min),
        place(camera.cy(), region.v_min),
        (region.u_max - region.u_min) * scale,
        (region.v_max - region.v_min) * scale,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_get_a_margin_inside_of_the_image() {
        let camera = PinholeCamera::new(500.0, 500.0, 320.0, 240.0, 640, 480).unwrap();
        let region = |u_min, v_min, u_max, v_max| PixelRegion {
            u_min,
            v_min,
            u_max,
            v_max,
        };
        for (object, shown) in [
            (region(200, 100, 600, 300), region(140, 75, 640, 325)),
            (region(0, 470, 10, 480), region(0, 320, 320, 480)),
            (PixelRegion::default(), camera.region()),
        ] {
            assert_eq!(with_margin(object, &camera), shown);
        }
    }

    #[test]
    fn an_enlarged_camera_sees_the_same_rays() {
        let camera = PinholeCamera::new(500.0, 510.0, 320.0, 240.0, 640, 480).unwrap();
        let region = PixelRegion {
            u_min: 100,
            v_min: 50,
            u_max: 300,
            v_max: 150,
        };
        let enlarged = enlarged(&camera, region, 2).unwrap();
        assert_eq!((enlarged.width(), enlarged.height()), (400, 200));
        // The middle of pixel (101, 52) is between its four new pixels.
        let (old, new) = (
            camera.unproject(101.0, 52.0, 1.0),
            enlarged.unproject(2.5, 4.5, 1.0),
        );
        assert!((old - new).norm() < 1e-12);
    }
}

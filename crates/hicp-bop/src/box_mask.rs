//! Masks without a segmentation: all measured points in a box around the estimate.

use hybrid_icp::core::{
    DepthImage, Isometry3, Mask, Model, PinholeCamera, PixelRegion, Point3, RenderedView, Vector3,
};

/// The creation of a mask from an estimate alone.
///
/// The mask has the pixels that meet two conditions:
///
/// - They lie in the box of the model's silhouette at the estimate, grown on every side by `margin`
///   times its longer side.
/// - Their measured point lies in the model's bounding box at the estimate, grown on every side by
///   `margin` times the diameter.
///
/// The mask includes all other objects in that box. It is therefore suitable for accurate
/// estimates, for isolated objects, and for projective pipelines. A segmentation gives better
/// results (see `docs/results.md`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxMask {
    /// The growth of the boxes on every side, relative to their size.
    pub margin: f64,
}

impl Default for BoxMask {
    /// Returns a margin of 0.05.
    fn default() -> Self {
        Self { margin: 0.05 }
    }
}

impl BoxMask {
    /// Returns the mask of an estimate, or `None` if it has no pixel.
    ///
    /// `view` must be the render of the model at `camera_from_object`, in meters. The depth image
    /// must have the size of the camera.
    ///
    /// Cost: O(image) to clear, O(vertices), then O(box).
    #[must_use]
    pub fn mask(
        &self,
        view: &RenderedView,
        (depth, camera): (&DepthImage, &PinholeCamera),
        model: &Model,
        camera_from_object: &Isometry3<f64>,
    ) -> Option<Mask> {
        let region = self.grown(&silhouette_box(view)?, depth);
        let (lowest, highest) = self.corners(model);
        let object_from_camera = camera_from_object.inverse();
        let width = depth.width() as usize;
        let mut pixels = vec![false; depth.pixels().len()];
        let mut any = false;
        for v in region.v_min..region.v_max {
            let row = v as usize * width;
            let columns = row + region.u_min as usize..row + region.u_max as usize;
            let measured = depth.pixels()[columns.clone()].iter();
            let row = pixels[columns].iter_mut().zip(measured);
            for (u, (pixel, z)) in (region.u_min..).zip(row) {
                if *z > 0.0 {
                    let seen = camera.unproject(f64::from(u), f64::from(v), f64::from(*z));
                    let point = object_from_camera * seen;
                    *pixel = lowest <= point && point <= highest;
                    any |= *pixel;
                }
            }
        }
        let mask = any.then(|| Mask::new(depth.width(), depth.height(), pixels));
        mask?.ok()
    }

    /// Returns two opposite corners of the model's grown bounding box, in the object frame, meters.
    fn corners(&self, model: &Model) -> (Point3<f64>, Point3<f64>) {
        let by = (self.margin * model.diameter()).max(0.0);
        let center = model.center();
        let vertices = model.mesh().used_points();
        let offsets = vertices.map(|vertex| (vertex.cast::<f64>() - center).abs());
        let half = offsets.fold(Vector3::zeros(), |half: Vector3<f64>, offset| {
            half.sup(&offset)
        });
        let half = half.add_scalar(by);
        (center - half, center + half)
    }

    /// Grows a box on every side, within the image.
    fn grown(&self, region: &PixelRegion, depth: &DepthImage) -> PixelRegion {
        let longer = region.width().max(region.height());
        let pixels = (self.margin * longer as f64)
            .ceil()
            .clamp(0.0, f64::from(u32::MAX));
        // The clamp keeps the value in the range of u32, and NaN becomes 0.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let by = pixels as u32;
        PixelRegion {
            u_min: region.u_min.saturating_sub(by),
            v_min: region.v_min.saturating_sub(by),
            u_max: region.u_max.saturating_add(by).min(depth.width()),
            v_max: region.v_max.saturating_add(by).min(depth.height()),
        }
    }
}

/// Returns the smallest box around the rendered pixels, or `None` if there are none.
fn silhouette_box(view: &RenderedView) -> Option<PixelRegion> {
    let pixels = view.covered().map(|(u, v)| PixelRegion {
        u_min: u,
        v_min: v,
        u_max: u + 1,
        v_max: v + 1,
    });
    pixels.reduce(|a, b| PixelRegion {
        u_min: a.u_min.min(b.u_min),
        v_min: a.v_min,
        u_max: a.u_max.max(b.u_max),
        v_max: b.v_max,
    })
}

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
    ///
    /// The size is the longer side of the silhouette's box, and the diameter for the model's box.
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
        let mask = Mask::in_region(depth.width(), depth.height(), &region, |u, v| {
            let measured = depth.get(u, v).filter(|z| *z > 0.0);
            measured.is_some_and(|z| {
                let seen = camera.unproject(f64::from(u), f64::from(v), f64::from(z));
                let point = object_from_camera * seen;
                lowest <= point && point <= highest
            })
        });
        (!mask.bounding_region().is_empty()).then_some(mask)
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
        let image = PixelRegion::of_image(depth.width(), depth.height());
        region.grown(by).intersection(&image)
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
    pixels.reduce(|a, b| a.union(&b))
}

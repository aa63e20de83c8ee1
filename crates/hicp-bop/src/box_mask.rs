//! A mask where there is no segmentation: what was measured in a box about the estimate.

use hybrid_icp::core::{
    DepthImage, Isometry3, Mask, Model, PinholeCamera, PixelRegion, Point3, RenderedView, Vector3,
};

/// How a mask is made of an estimate alone.
///
/// Set are the pixels that lie in the box of the model's silhouette at the estimate, grown on every side by `margin` times its
/// longer side, and whose measured point lies in the model's own bounding box at the estimate, grown on every side by `margin`
/// times its diameter. Whatever else stands in that box is in the mask too, so this is for estimates that are near, of objects
/// that stand free, and for projective pipelines; a segmentation is better where there is one (`docs/bop.md` has figures).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxMask {
    /// How much the boxes grow on every side.
    pub margin: f64,
}

impl Default for BoxMask {
    /// A twentieth.
    fn default() -> Self {
        Self { margin: 0.05 }
    }
}

impl BoxMask {
    /// Makes the mask of an estimate, or returns `None` where no pixel is in it.
    ///
    /// `view` is the render of the model at `camera_from_object`; depth image and camera are of one size. Cost: O(image) to
    /// clear, O(vertices), then O(box).
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

    /// Returns two opposite corners of the model's grown bounding box, object frame.
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

    /// Grows a box, within the image.
    fn grown(&self, region: &PixelRegion, depth: &DepthImage) -> PixelRegion {
        let longer = region.width().max(region.height());
        let pixels = (self.margin * longer as f64)
            .ceil()
            .clamp(0.0, f64::from(u32::MAX));
        // In the range of u32, by the clamp; no number is 0.
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

/// Returns the smallest box of the pixels that were rendered, or `None` where none was.
fn silhouette_box(view: &RenderedView) -> Option<PixelRegion> {
    let region = view.region();
    let mut found: Option<PixelRegion> = None;
    let rows = view.depth().chunks_exact(region.width().max(1));
    for (v, row) in (region.v_min..).zip(rows) {
        let Some(first) = row.iter().position(|z| *z > 0.0) else {
            continue;
        };
        let last = row.iter().rposition(|z| *z > 0.0).unwrap_or(first);
        // Columns of an image, which are numbered in u32.
        let column = |index: usize| region.u_min + u32::try_from(index).unwrap_or(u32::MAX);
        let (u_min, u_max) = (column(first), column(last) + 1);
        let so_far = found.get_or_insert(PixelRegion {
            u_min,
            v_min: v,
            u_max,
            v_max: v + 1,
        });
        so_far.u_min = so_far.u_min.min(u_min);
        so_far.u_max = so_far.u_max.max(u_max);
        so_far.v_max = v + 1;
    }
    found
}

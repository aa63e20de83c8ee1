//! A mask where there is no segmentation: a box about the estimate, gated by depth.

use hybrid_icp::{DepthImage, Isometry3, Mask, Model, PixelRegion, RenderedView};

/// How a mask is made of an estimate alone.
///
/// Set are the pixels that have a depth, lie in the box of the model's silhouette at the estimate, grown on every side by
/// `margin` times its longer side, and whose depth differs from that of the model's centre at the estimate by at most
/// `depth_gate` times the model's diameter. What lies beside, before or behind the object within the gate is in the mask, so
/// this is for estimates that are near, of objects that stand free; a segmentation is better where there is one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxMask {
    /// How much the box grows on every side, as a share of its longer side.
    pub margin: f64,
    /// Largest distance in depth from the model's centre, in diameters of the model.
    pub depth_gate: f64,
}

impl Default for BoxMask {
    /// A tenth of the box, half a diameter of depth.
    fn default() -> Self {
        Self {
            margin: 0.1,
            depth_gate: 0.5,
        }
    }
}

impl BoxMask {
    /// Makes the mask of an estimate, or returns `None` where no pixel is in it.
    ///
    /// `view` is the render of the model at `camera_from_object`. Cost: O(image) to clear, then O(box).
    #[must_use]
    pub fn mask(
        &self,
        view: &RenderedView,
        depth: &DepthImage,
        model: &Model,
        camera_from_object: &Isometry3<f64>,
    ) -> Option<Mask> {
        let region = self.grown(&silhouette_box(view)?, depth);
        let center = camera_from_object * model.center();
        let gate = self.depth_gate * model.diameter();
        let width = depth.width() as usize;
        let mut pixels = vec![false; depth.pixels().len()];
        let mut any = false;
        for v in region.v_min..region.v_max {
            let row = v as usize * width;
            let columns = row + region.u_min as usize..row + region.u_max as usize;
            for (pixel, z) in pixels[columns.clone()]
                .iter_mut()
                .zip(&depth.pixels()[columns])
            {
                *pixel = *z > 0.0 && (f64::from(*z) - center.z).abs() <= gate;
                any |= *pixel;
            }
        }
        let mask = any.then(|| Mask::new(depth.width(), depth.height(), pixels));
        mask?.ok()
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

//! The border pixels of a render.

use hicp_core::{PinholeCamera, RenderedView};

/// The rendered pixels next to pixels that show nothing, row by row.
#[derive(Debug, Default)]
pub(super) struct Silhouette {
    pixels: Vec<(u32, u32)>,
}

impl Silhouette {
    /// Finds the border pixels of a render.
    ///
    /// The border of the image is not one of the object.
    pub(super) fn find(&mut self, view: &RenderedView, camera: &PinholeCamera) {
        self.pixels.clear();
        let region = view.region();
        let width = region.width();
        let depth = view.depth();
        let at_right = region.u_max >= camera.width();
        let at_bottom = region.v_max >= camera.height();
        for (row, v) in (region.v_min..region.v_max).enumerate() {
            let start = row * width;
            let line = &depth[start..start + width];
            let above = row.checked_sub(1).map(|row| &depth[row * width..start]);
            let below = depth.get(start + width..start + 2 * width);
            for (column, u) in (region.u_min..region.u_max).enumerate() {
                if line[column] <= 0.0 {
                    continue;
                }
                let empty = |row: Option<&[f32]>, at_image_border: bool| {
                    row.map_or(!at_image_border, |row| row[column] <= 0.0)
                };
                let left = column.checked_sub(1).map_or(u > 0, |i| line[i] <= 0.0);
                let right = line.get(column + 1).map_or(!at_right, |z| *z <= 0.0);
                if left || right || empty(above, v == 0) || empty(below, at_bottom) {
                    self.pixels.push((u, v));
                }
            }
        }
    }

    /// Iterates over about `count` of the pixels, evenly spread.
    pub(super) fn spread(&self, count: usize) -> impl Iterator<Item = (u32, u32)> {
        let step = self.pixels.len().div_ceil(count.max(1)).max(1);
        self.pixels.iter().copied().step_by(step)
    }
}

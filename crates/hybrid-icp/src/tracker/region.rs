//! The pixels in which an object is looked for, without a mask.

use hicp_core::{DepthImage, Mask, PixelRegion, RenderedView};

/// The scratch memory for widened silhouettes.
#[derive(Clone, Debug, Default)]
pub(super) struct Widening {
    near: Vec<f32>,
    far: Vec<f32>,
    rows: Vec<f32>,
}

impl Widening {
    /// Returns the pixels around a render whose measured depth is near the rendered one.
    ///
    /// A pixel belongs to the mask if its depth is within `meters` of the depths rendered within
    /// about `pixels`. Cost: O(pixels of the render and of the border), and zeroed memory for the
    /// image.
    pub(super) fn mask(
        &mut self,
        view: &RenderedView,
        depth: &DepthImage,
        pixels: u32,
        meters: f32,
    ) -> Mask {
        let cell = pixels.max(1);
        let (seen, side) = (view.region(), cell as usize);
        let image = PixelRegion::of_image(depth.width(), depth.height());
        let region = seen.grown(cell).intersection(&image);
        let columns = region.width().div_ceil(side);
        let cells = columns * region.height().div_ceil(side);
        let place = |u: u32, v: u32| {
            (v - region.v_min) as usize / side * columns + (u - region.u_min) as usize / side
        };
        self.near.clear();
        self.near.resize(cells, f32::INFINITY);
        self.far.clear();
        self.far.resize(cells, f32::NEG_INFINITY);
        for ((u, v), z) in seen.pixels().zip(view.depth()) {
            if *z > 0.0 {
                let cell = place(u, v);
                self.near[cell] = self.near[cell].min(*z);
                self.far[cell] = self.far[cell].max(*z);
            }
        }
        spread(&mut self.near, &mut self.rows, columns, f32::min);
        spread(&mut self.far, &mut self.rows, columns, f32::max);
        let width = depth.width() as usize;
        Mask::in_region(depth.width(), depth.height(), &region, |u, v| {
            let (z, cell) = (depth.pixels()[v as usize * width + u as usize], place(u, v));
            z > self.near[cell] - meters && z < self.far[cell] + meters && z > 0.0
        })
    }
}

/// Combines every cell with its eight neighbors.
fn spread(
    cells: &mut [f32],
    rows: &mut Vec<f32>,
    columns: usize,
    combine: impl Fn(f32, f32) -> f32,
) {
    rows.clear();
    for row in cells.chunks_exact(columns.max(1)) {
        for column in 0..columns {
            let around = &row[column.saturating_sub(1)..(column + 2).min(columns)];
            rows.extend(around.iter().copied().reduce(&combine));
        }
    }
    let n_rows = rows.len() / columns.max(1);
    for row in 0..n_rows {
        let around = row.saturating_sub(1)..(row + 2).min(n_rows);
        for column in 0..columns {
            let of_column = around.clone().map(|row| rows[row * columns + column]);
            if let Some(combined) = of_column.reduce(&combine) {
                cells[row * columns + column] = combined;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widened_silhouettes_hold_near_depths_within_the_border() {
        let mut view = RenderedView::default();
        let square = PixelRegion {
            u_min: 20,
            v_min: 10,
            u_max: 30,
            v_max: 20,
        };
        view.reset(square);
        view.buffers_mut().0.fill(0.5);
        // The left half of the image is 2 cm behind the surface, the rest 10 cm.
        let depths = (0..64 * 48).map(|i| if i % 64 < 32 { 0.52 } else { 0.6 });
        let mut depths: Vec<f32> = depths.collect();
        depths[15 * 64 + 25] = 0.0;
        let depth = DepthImage::from_meters(64, 48, depths).unwrap();
        let mut widening = Widening::default();
        let mask = widening.mask(&view, &depth, 4, 0.03);
        for v in 0..48 {
            for u in 0..64 {
                let near = |x: u32, (low, high): (u32, u32), by| x + by >= low && x < high + by;
                let inside = near(u, (20, 30), 0) && near(v, (10, 20), 0);
                let within = near(u, (20, 30), 4) && near(v, (10, 20), 4);
                let set = mask.get(u, v) == Some(true);
                assert!(!set || (within && u < 32), "{u} {v}");
                assert!(set || !inside || (u, v) == (25, 15), "{u} {v}");
            }
        }
        // A smaller gate excludes everything.
        assert!(
            widening
                .mask(&view, &depth, 4, 0.01)
                .bounding_region()
                .is_empty()
        );
    }
}

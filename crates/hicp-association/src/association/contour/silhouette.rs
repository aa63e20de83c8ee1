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

    /// Iterates over about `count` of the pixels, evenly spread: one of each group of neighbors in
    /// the list.
    ///
    /// The place in the group differs from group to group. Most rows have a pixel on the left and
    /// one on the right, and a fixed step of two would return only one of these sides.
    pub(super) fn spread(&self, count: usize) -> impl Iterator<Item = (u32, u32)> {
        let group = self.pixels.len().div_ceil(count.max(1)).max(1);
        (0_u64..).zip(self.pixels.chunks(group)).map(|(k, group)| {
            let share = k.wrapping_mul(GOLDEN_RATIO) >> 32;
            #[allow(clippy::cast_possible_truncation)] // Below the length of the group.
            let place = ((share * group.len() as u64) >> 32) as usize;
            group[place]
        })
    }
}

/// The fractional part of the golden ratio, times 2⁶⁴. Its multiples are spread evenly.
const GOLDEN_RATIO: u64 = 0x9E37_79B9_7F4A_7C15;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_sides_are_selected_whatever_the_count() {
        let rows = 0..60;
        let pixels: Vec<_> = rows.flat_map(|v| [(10, v), (40, v)]).collect();
        let silhouette = Silhouette { pixels };
        for count in [1, 7, 20, 30, 40, 60, 90, 119, 120, 500] {
            let selected: Vec<_> = silhouette.spread(count).collect();
            assert!(selected.len() <= count, "{count}");
            assert!(selected.len() * 2 > count.min(120), "{count}");
            let left = selected.iter().filter(|(u, _)| *u == 10).count();
            let right = selected.len() - left;
            assert!(left.abs_diff(right) <= 2, "{count}: {left}, {right}");
            assert!(selected.is_sorted_by_key(|(u, v)| (*v, *u)));
        }
        assert_eq!(Silhouette::default().spread(5).count(), 0);
    }
}

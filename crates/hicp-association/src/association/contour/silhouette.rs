//! The border pixels of a render.

use hicp_core::internal::{VectorLoop, vectorized};
use hicp_core::{PinholeCamera, RenderedView};

/// The rendered pixels next to pixels that show nothing, row by row.
#[derive(Debug, Default)]
pub(super) struct Silhouette {
    pixels: Vec<(u32, u32)>,
    /// A row without depth.
    nothing: Vec<f32>,
    /// 1 at the border pixels of a row, otherwise 0; then zeros up to a whole number of blocks.
    border: Vec<u8>,
}

/// Number of pixels that are searched for border pixels at once.
const BLOCK: usize = 8;

impl Silhouette {
    /// Finds the border pixels of a render.
    ///
    /// The border of the image is not one of the object.
    pub(super) fn find(&mut self, view: &RenderedView, camera: &PinholeCamera) {
        self.pixels.clear();
        let region = view.region();
        let width = region.width();
        if region.is_empty() {
            return;
        }
        self.nothing.resize(width, 0.0);
        self.border.resize(width.next_multiple_of(BLOCK), 0);
        self.border[width..].fill(0);
        let depth = view.depth();
        for (row, v) in (region.v_min..region.v_max).enumerate() {
            let start = row * width;
            let line = &depth[start..start + width];
            // At the border of the image, the row itself stands for the one beyond: its rendered
            // pixels are not empty.
            let beyond = |at_image_border: bool| if at_image_border { line } else { &self.nothing };
            let above = row.checked_sub(1).map(|row| &depth[row * width..start]);
            let below = depth.get(start + width..start + 2 * width);
            vectorized(FindBorder {
                line,
                above: above.unwrap_or_else(|| beyond(v == 0)),
                below: below.unwrap_or_else(|| beyond(v + 1 >= camera.height())),
                ends: [region.u_min > 0, region.u_max < camera.width()],
                border: &mut self.border[..width],
            });
            let blocks = self.border.as_chunks::<BLOCK>().0.iter();
            for (block, u) in blocks.zip((region.u_min..).step_by(BLOCK)) {
                if u64::from_ne_bytes(*block) == 0 {
                    continue;
                }
                let pixels = (u..).zip(block).filter(|(_, border)| **border != 0);
                self.pixels.extend(pixels.map(|(u, _)| (u, v)));
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

/// The loop that finds the border pixels of a row.
struct FindBorder<'a> {
    line: &'a [f32],
    above: &'a [f32],
    below: &'a [f32],
    /// `true` where the pixel left or right of the row is empty.
    ends: [bool; 2],
    border: &'a mut [u8],
}

impl VectorLoop for FindBorder<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let (line, width) = (self.line, self.line.len());
        let (above, below) = (&self.above[..width], &self.below[..width]);
        let border = &mut self.border[..width];
        for column in 1..width - 1 {
            let (left, right) = (line[column - 1], line[column + 1]);
            let empty = (left <= 0.0) | (right <= 0.0) | (above[column] <= 0.0);
            let bounded = empty | (below[column] <= 0.0);
            border[column] = u8::from(bounded & (line[column] > 0.0));
        }
        let empty = |column: usize, end: bool| line.get(column).map_or(end, |z| *z <= 0.0);
        for column in [0, width - 1] {
            let left = empty(column.wrapping_sub(1), self.ends[0]);
            let bounded = left || empty(column + 1, self.ends[1]);
            let bounded = bounded || above[column] <= 0.0 || below[column] <= 0.0;
            border[column] = u8::from(bounded && line[column] > 0.0);
        }
    }
}

/// The fractional part of the golden ratio, times 2⁶⁴. Its multiples are spread evenly.
const GOLDEN_RATIO: u64 = 0x9E37_79B9_7F4A_7C15;

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use hicp_core::PixelRegion;

    /// Compares with the definition, for regions at the border of the image and inside of it.
    #[test]
    fn a_border_pixel_shows_something_next_to_a_pixel_that_shows_nothing() {
        let camera = PinholeCamera::new(9.0, 9.0, 1.0, 1.0, 21, 6).unwrap();
        let mut silhouette = Silhouette::default();
        for (u_min, u_max) in [(0, 21), (0, 1), (20, 21), (3, 4), (3, 12), (2, 18), (5, 5)] {
            for (v_min, v_max) in [(0, 6), (0, 1), (5, 6), (1, 5)] {
                let mut view = RenderedView::default();
                view.reset(PixelRegion {
                    u_min,
                    v_min,
                    u_max,
                    v_max,
                });
                for (index, z) in view.buffers_mut().0.iter_mut().enumerate() {
                    *z = f32::from(u8::from(!(index * index + index / 7).is_multiple_of(5)));
                }
                // Beyond the image, no pixel is empty.
                let empty = |u: i64, v: i64| match (u32::try_from(u), u32::try_from(v)) {
                    (Ok(u), Ok(v)) => u < 21 && v < 6 && view.depth_at(u, v) <= 0.0,
                    _ => false,
                };
                let around = [(-1, 0), (1, 0), (0, -1), (0, 1)];
                let pixels = (0..6).flat_map(|v| (0..21).map(move |u| (u, v)));
                let shown = pixels.filter(|&(u, v)| view.depth_at(u, v) > 0.0);
                let expected: Vec<_> = shown
                    .filter(|&(u, v)| {
                        let (u, v) = (i64::from(u), i64::from(v));
                        around.iter().any(|(x, y)| empty(u + x, v + y))
                    })
                    .collect();
                silhouette.find(&view, &camera);
                assert_eq!(
                    silhouette.pixels, expected,
                    "{u_min} {u_max} {v_min} {v_max}"
                );
            }
        }
    }

    #[test]
    fn both_sides_are_selected_whatever_the_count() {
        let rows = 0..60;
        let pixels: Vec<_> = rows.flat_map(|v| [(10, v), (40, v)]).collect();
        let silhouette = Silhouette {
            pixels,
            ..Silhouette::default()
        };
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

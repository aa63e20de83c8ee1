//! Depth edges: discontinuities of the surface between adjacent pixels.

use std::ops::Range;

use super::patch::DepthPatch;
use super::size::EDGE_RADIUS;
use crate::internal::{VectorLoop, vectorized};
use crate::sensor::region::PixelRegion;

/// The depth edges of a patch.
pub(super) struct Edges {
    /// Pixels with an edge within the window's radius, in the maximum norm of rows and columns.
    pub(super) near: BitRows,
    /// Pixels joined to their right neighbor: both are used, and the step between them is not an
    /// edge.
    pub(super) right: BitRows,
    /// Pixels joined to the neighbor below.
    pub(super) below: BitRows,
}

impl Edges {
    /// Finds the edges, or returns `None` if there are none.
    ///
    /// `spans` are the columns that each row uses. A step to a pixel without depth is not an edge,
    /// because nothing is fitted to that pixel.
    pub(super) fn find(
        patch: &DepthPatch<'_>,
        spans: &[Range<usize>],
        edge_step: f32,
        radius: usize,
    ) -> Option<Self> {
        let mut near = BitRows::new(&patch.region);
        let mut bytes = Vec::new();
        let mut any = false;
        for (v, span) in used(spans) {
            let here = &patch.row(v)[span.clone()];
            if judge::<false>(here, &here[1..], edge_step, &mut bytes) {
                any = true;
                near.set(v, span.start, &bytes);
                near.set(v, span.start + 1, &bytes);
            }
            if v + 1 < spans.len() {
                let below = &patch.row(v + 1)[span.clone()];
                if judge::<false>(here, below, edge_step, &mut bytes) {
                    any = true;
                    near.set(v, span.start, &bytes);
                    near.set(v + 1, span.start, &bytes);
                }
            }
        }
        if !any {
            return None;
        }
        near.dilate(radius);
        let (mut right, mut below) = (BitRows::new(&patch.region), BitRows::new(&patch.region));
        for (v, span) in used(spans) {
            // Only windows around pixels near edges are read.
            let rows = v.saturating_sub(EDGE_RADIUS)..(v + EDGE_RADIUS + 1).min(spans.len());
            if rows
                .into_iter()
                .all(|v| near.row(v).iter().all(|w| *w == 0))
            {
                continue;
            }
            let here = &patch.row(v)[span.clone()];
            judge::<true>(here, &here[1..], edge_step, &mut bytes);
            right.set(v, span.start, &bytes);
            if v + 1 < spans.len() {
                judge::<true>(here, &patch.row(v + 1)[span.clone()], edge_step, &mut bytes);
                below.set(v, span.start, &bytes);
            }
        }
        Some(Self { near, right, below })
    }
}

/// Iterates over the rows that use any columns.
fn used(spans: &[Range<usize>]) -> impl Iterator<Item = (usize, &Range<usize>)> {
    spans
        .iter()
        .enumerate()
        .filter(|(_, span)| !span.is_empty())
}

/// Classifies the steps from the pixels of one row to those of another, up to the shorter length.
///
/// A byte is 1 where the step joins its pixels, or where it is an edge if `JOINED` is false.
/// Returns whether any is.
fn judge<const JOINED: bool>(
    from: &[f32],
    to: &[f32],
    edge_step: f32,
    bytes: &mut Vec<u8>,
) -> bool {
    let n = from.len().min(to.len());
    bytes.resize(n, 0);
    vectorized(Judge::<JOINED> {
        from: &from[..n],
        to: &to[..n],
        edge_step,
        bytes,
    })
}

struct Judge<'a, const JOINED: bool> {
    from: &'a [f32],
    to: &'a [f32],
    edge_step: f32,
    bytes: &'a mut [u8],
}

impl<const JOINED: bool> VectorLoop for Judge<'_, JOINED> {
    type Output = bool;

    #[inline(always)]
    fn run(self) -> bool {
        let steps = self.from.iter().zip(self.to);
        let mut any = 0;
        for (byte, (a, b)) in self.bytes.iter_mut().zip(steps) {
            let nearer = if a < b { a } else { b };
            let torn = (a - b).abs() > self.edge_step * nearer;
            *byte = u8::from((*nearer > 0.0) & (torn != JOINED));
            any |= *byte;
        }
        any != 0
    }
}

/// One bit per pixel.
pub(super) struct BitRows {
    words: Vec<u64>,
    words_per_row: usize,
}

impl BitRows {
    fn new(region: &PixelRegion) -> Self {
        // One word more than needed, so that any bits of a row lie in two adjacent words.
        let words_per_row = region.width() / 64 + 2;
        Self {
            words: vec![0; words_per_row * region.height()],
            words_per_row,
        }
    }

    fn row(&self, v: usize) -> &[u64] {
        &self.words[v * self.words_per_row..][..self.words_per_row]
    }

    fn row_mut(&mut self, v: usize) -> &mut [u64] {
        &mut self.words[v * self.words_per_row..][..self.words_per_row]
    }

    /// Sets the bits of row `v` from column `first` on that are 1 in `bytes`.
    fn set(&mut self, v: usize, first: usize, bytes: &[u8]) {
        let row = self.row_mut(v);
        for (bytes, u) in bytes.chunks(8).zip((first..).step_by(8)) {
            let mut eight = [0; 8];
            eight[..bytes.len()].copy_from_slice(bytes);
            let eight = u64::from_le_bytes(eight);
            if eight == 0 {
                continue;
            }
            // Byte i, which is 0 or 1, becomes bit 56 + i: the partial products do not overlap.
            let bits = eight.wrapping_mul(0x0102_0408_1020_4080) >> 56;
            row[u / 64] |= bits << (u % 64);
            // The shift is split in two, because a shift by 64 is not allowed.
            row[u / 64 + 1] |= bits >> 1 >> (63 - u % 64);
        }
    }

    /// Iterates over the set columns of row `v` among the first `width`.
    pub(super) fn columns(&self, v: usize, width: usize) -> impl Iterator<Item = usize> {
        self.row(v)
            .iter()
            .enumerate()
            .flat_map(move |(index, word)| {
                let mut left = *word;
                std::iter::from_fn(move || {
                    let bit = (left != 0).then(|| left.trailing_zeros() as usize)?;
                    left &= left - 1;
                    Some(64 * index + bit).filter(|u| *u < width)
                })
            })
    }

    /// Returns the bits of `count` < 64 pixels from (u, v) to the right, the first in the lowest
    /// bit.
    pub(super) fn get(&self, u: usize, v: usize, count: usize) -> u64 {
        let word = v * self.words_per_row + u / 64;
        let shift = u % 64;
        let bits = self.words[word] >> shift | (self.words[word + 1] << 1) << (63 - shift);
        bits & ((1 << count) - 1)
    }

    /// Sets every pixel within `radius` rows and columns of a set pixel.
    fn dilate(&mut self, radius: usize) {
        for _ in 0..radius {
            for row in self.words.chunks_exact_mut(self.words_per_row) {
                let mut left = 0;
                for index in 0..row.len() {
                    let word = row[index];
                    let right = row.get(index + 1).map_or(0, |next| next << 63);
                    row[index] = word | word << 1 | word >> 1 | left | right;
                    left = word >> 63;
                }
            }
        }
        let n = self.words_per_row;
        let height = self.words.len() / n;
        // Bits dilated by `covered` rows reach twice as far, and one more, when shifted by covered
        // + 1. Bits beyond the border are dropped.
        let mut covered = 0;
        while covered < radius {
            let step = (covered + 1).min(radius - covered);
            let before = self.words.clone();
            for (v, row) in self.words.chunks_exact_mut(n).enumerate() {
                let above = v.checked_sub(step);
                let under = (v + step < height).then_some(v + step);
                for other in above.into_iter().chain(under) {
                    for (word, bits) in row.iter_mut().zip(&before[other * n..]) {
                        *word |= bits;
                    }
                }
            }
            covered += step;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns rows of bits and the same bits pixel by pixel.
    ///
    /// Both are set from runs of bytes that start anywhere and cross word borders.
    fn bits_and_pixels(region: &PixelRegion, seed: usize) -> (BitRows, Vec<Vec<bool>>) {
        let (width, height) = (region.width(), region.height());
        let mut bits = BitRows::new(region);
        let mut pixels = vec![vec![false; width]; height];
        for (v, row) in pixels.iter_mut().enumerate() {
            // Words are half full or mostly empty.
            let every = if v % 2 == 0 { 2 } else { 7 };
            for first in [seed + 5 * v, (seed * 37 + 11 * v) % width] {
                let is_set = |u: usize| (31 * u * u + seed * u + v).is_multiple_of(every);
                let end = width.min(first + 40 + v);
                let run: Vec<u8> = (first..end).map(|u| u8::from(is_set(u))).collect();
                bits.set(v, first, &run);
                for (u, set) in (first..).zip(run) {
                    row[u] |= set == 1;
                }
            }
        }
        (bits, pixels)
    }

    #[test]
    fn bits_equal_those_set_pixel_by_pixel() {
        for (seed, width) in (0..).zip([65, 70, 128, 131, 200]) {
            let region = PixelRegion::of_image(width, 8);
            let (bits, pixels) = bits_and_pixels(&region, seed);
            let width = region.width();
            for (v, row) in pixels.iter().enumerate() {
                for u in 0..width {
                    for count in [1, 6, 7, 63] {
                        let set = |i: &usize| row.get(u + i).is_some_and(|set| *set);
                        let expected: u64 = (0..count).filter(set).map(|i| 1 << i).sum();
                        assert_eq!(bits.get(u, v, count), expected, "{u} {v} {count}");
                    }
                }
                for end in [width, width - 1, 64, 63, 1] {
                    let expected: Vec<usize> = (0..end).filter(|u| row[*u]).collect();
                    assert_eq!(bits.columns(v, end).collect::<Vec<_>>(), expected);
                }
            }
        }
    }

    #[test]
    fn dilation_equals_its_definition_for_many_pixels() {
        for (seed, width) in (0..).zip([65, 70, 131, 200]) {
            let region = PixelRegion::of_image(width, 8);
            for radius in 0..=3_usize {
                let (mut bits, pixels) = bits_and_pixels(&region, seed);
                bits.dilate(radius);
                for v in 0..8_usize {
                    let rows = &pixels[v.saturating_sub(radius)..(v + radius + 1).min(8)];
                    let near = |u: &usize| {
                        let columns =
                            u.saturating_sub(radius)..(u + radius + 1).min(region.width());
                        rows.iter().any(|row| row[columns.clone()].contains(&true))
                    };
                    let expected: Vec<usize> = (0..region.width()).filter(near).collect();
                    let found: Vec<usize> = bits.columns(v, region.width()).collect();
                    assert_eq!(found, expected, "{width} {radius}");
                }
            }
        }
    }

    #[test]
    fn dilation_equals_its_definition_for_single_pixels() {
        let region = PixelRegion {
            u_min: 3,
            u_max: 203,
            v_min: 2,
            v_max: 42,
        };
        let seeds = [(0, 0), (63, 20), (64, 5), (130, 39), (199, 12)];
        for radius in 0..=10 {
            let mut bits = BitRows::new(&region);
            for (u, v) in seeds {
                bits.set(v, u, &[1]);
            }
            bits.dilate(radius);
            for v in 0..region.height() {
                for u in 0..region.width() {
                    let near =
                        |(x, y): &(usize, usize)| u.abs_diff(*x).max(v.abs_diff(*y)) <= radius;
                    assert_eq!(
                        bits.get(u, v, 1) == 1,
                        seeds.iter().any(near),
                        "{u} {v} {radius}"
                    );
                }
            }
        }
    }
}

//! Counts of agreeing pixels, many at a time.

use std::ops::Range;

use hicp_core::internal::VectorLoop;

use crate::mve::trust_map::CERTAIN;
use crate::tolerances::{N_TOLERANCES, tolerances};

/// Number of pixels counted at once.
const LANES: usize = 8;

/// The weights of a row of pixels of the mask.
pub(crate) trait Weights: Copy {
    /// The largest weight: all-ones if a pixel either counts or does not.
    const ONE: u32;
    /// Whether there are weights between 0 and the largest.
    const GRADED: bool;

    /// Returns the weights of `n` pixels from the pixel `first` on, and 0 beyond them.
    fn load(&self, first: usize, n: usize) -> [u32; LANES];
}

/// An exact mask.
impl Weights for &[bool] {
    const ONE: u32 = u32::MAX;
    const GRADED: bool = false;

    #[inline(always)]
    fn load(&self, first: usize, n: usize) -> [u32; LANES] {
        let masked = lanes(self, first, n);
        let mut weights = [0; LANES];
        for (weight, masked) in weights.iter_mut().zip(masked) {
            *weight = all_bits(masked);
        }
        weights
    }
}

/// Weights of an imperfect mask; `None` outside of its region.
impl Weights for Option<&[u8]> {
    const ONE: u32 = CERTAIN as u32;
    const GRADED: bool = true;

    #[inline(always)]
    fn load(&self, first: usize, n: usize) -> [u32; LANES] {
        let mut weights = [0; LANES];
        if let Some(row) = self {
            for (weight, byte) in weights.iter_mut().zip(lanes(row, first, n)) {
                *weight = u32::from(byte);
            }
        }
        weights
    }
}

/// Returns `n` values from the index `first` on, and defaults after them.
#[inline(always)]
fn lanes<T: Copy + Default>(values: &[T], first: usize, n: usize) -> [T; LANES] {
    if let Some(full) = values[first..].first_chunk().filter(|_| n == LANES) {
        return *full;
    }
    let mut lanes = [T::default(); LANES];
    lanes[..n].copy_from_slice(&values[first..first + n]);
    lanes
}

/// A row of pixels: rendered depth, measured depth and mask, from the same column on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row<'a, W> {
    pub(crate) rendered: &'a [f32],
    pub(crate) observed: &'a [f32],
    pub(crate) mask: W,
    /// Column of the first pixel.
    pub(crate) u: u32,
    /// (v − cy) / fy.
    pub(crate) y: f64,
}

impl<'a, W> Row<'a, W> {
    /// Returns some columns of the row with other weights.
    pub(crate) fn part<V>(&self, columns: Range<usize>, mask: V) -> Row<'a, V> {
        Row {
            rendered: &self.rendered[columns.clone()],
            observed: &self.observed[columns.clone()],
            mask,
            #[allow(clippy::cast_possible_truncation)] // A column of an image.
            u: self.u + columns.start as u32,
            y: self.y,
        }
    }
}

/// The loop that counts the pixels of a region, row by row.
#[derive(Debug)]
pub(crate) struct Agreement<R> {
    pub(crate) rows: R,
    pub(crate) cx: f64,
    pub(crate) inverse_fx: f64,
    pub(crate) diameter: f64,
    /// Rendered pixels outside the mask do not count if they are this far behind the measured
    /// surface, meters.
    pub(crate) hidden_beyond: f64,
}

/// The counts of a region.
#[derive(Debug)]
pub(crate) struct Found {
    /// Pixels of the intersection that differ by less than each tolerance.
    pub(crate) correct: [u64; N_TOLERANCES],
    /// Rendered pixels outside the mask that count against the pose.
    pub(crate) outside: u64,
    /// Weight of the rendered and measured pixels within the mask.
    pub(crate) covered: u64,
    /// Rendered pixels outside the mask that are hidden, or inside a measured surface.
    pub(crate) nearer: u64,
}

impl<'a, W: Weights + 'a, R: Iterator<Item = Row<'a, W>>> VectorLoop for Agreement<R> {
    type Output = Found;

    #[inline(always)]
    fn run(self) -> Found {
        #[allow(clippy::cast_possible_truncation)] // f32 is the precision of depth.
        let single = |value: f64| value as f32;
        let [cx, inverse_fx, diameter, hidden_beyond] =
            [self.cx, self.inverse_fx, self.diameter, self.hidden_beyond].map(single);
        let limits = tolerances().map(|share| single(share) * diameter);
        let (mut all, mut some) = (Counts::<u64>::default(), Counts::<u32>::default());
        let mut pixels = 0;
        for row in self.rows {
            #[allow(clippy::cast_possible_truncation)]
            let squared_y = (row.y * row.y + 1.0) as f32;
            let width = row.rendered.len();
            pixels += width;
            if pixels > MOST_PIXELS {
                all.take(&mut some);
                pixels = width;
            }
            for first in (0..width).step_by(LANES) {
                // The last pixels of a row are padded with pixels that do not count.
                let n = (width - first).min(LANES);
                let rendered = lanes(row.rendered, first, n);
                if rendered == [0.0; LANES] {
                    continue;
                }
                let observed = lanes(row.observed, first, n);
                let weights = row.mask.load(first, n);
                // Whole numbers up to 2²⁴ are exact.
                let column = (row.u as usize + first) as f32;
                // Masks are all-ones or zero instead of `bool`, which avoids a branch per pixel.
                let mut distance = [0.0; LANES];
                let mut certain = [0; LANES];
                for lane in 0..LANES {
                    let (z, measured) = (rendered[lane], observed[lane]);
                    let x = (column + lane as f32 - cx) * inverse_fx;
                    let distance_per_depth = (x * x + squared_y).sqrt();
                    let behind = (z - measured) * distance_per_depth;
                    let (seen, known) = (all_bits(z > 0.0), all_bits(measured > 0.0));
                    let outside_mask = W::ONE - weights[lane];
                    let counts = if W::GRADED {
                        // Outside the mask, a pixel counts half if it is near the surface.
                        let through = all_bits(behind < -hidden_beyond) | !known;
                        let front = all_bits(behind > hidden_beyond.max(0.25 * diameter)) & known;
                        let near = (outside_mask / 2) & seen & !through & !front;
                        some.outside[lane] += (outside_mask & seen & through) + near;
                        some.nearer[lane] += outside_mask & seen & front;
                        some.covered[lane] += weights[lane] & seen & known;
                        certain[lane] = weights[lane] + near;
                        all_bits(certain[lane] > 0)
                    } else {
                        let hidden = known & all_bits(behind > hidden_beyond);
                        some.outside[lane] += 1 & outside_mask & seen & !hidden;
                        certain[lane] = 1;
                        weights[lane]
                    };
                    // NaN if the pixel does not count: NaN is below no limit.
                    let nothing = !(seen & known & counts);
                    distance[lane] = f32::from_bits(behind.abs().to_bits() | nothing);
                }
                // Near the right pose, nearly all pixels agree within the least tolerance, and so
                // within the others.
                let mut between = 0;
                for lane in 0..LANES {
                    let within = all_bits(distance[lane] < limits[0]);
                    some.correct[0][lane] += within & certain[lane];
                    between |= all_bits(distance[lane] < limits[N_TOLERANCES - 1]) & !within;
                }
                if between == 0 {
                    continue;
                }
                for (correct, limit) in some.correct[1..].iter_mut().zip(&limits[1..]) {
                    for lane in 0..LANES {
                        let (least, distance) = (limits[0], distance[lane]);
                        let within = all_bits((distance < *limit) & (distance >= least));
                        correct[lane] += within & certain[lane];
                    }
                }
            }
        }
        all.take(&mut some);
        let sum = |lanes: [u64; LANES]| lanes.iter().sum::<u64>();
        let least = sum(all.correct[0]);
        let mut correct = all.correct.map(|lanes| least + sum(lanes));
        correct[0] = least;
        Found {
            correct,
            outside: sum(all.outside),
            covered: sum(all.covered),
            nearer: sum(all.nearer),
        }
    }
}

/// Number of pixels whose weights fit the sums of 32 bits.
const MOST_PIXELS: usize = 1 << 24;

/// Sums of weights, one per lane.
#[derive(Default)]
struct Counts<T> {
    /// The pixels within the least tolerance. Then, for each other tolerance, the pixels within it
    /// that are not within the least one.
    correct: [[T; LANES]; N_TOLERANCES],
    outside: [T; LANES],
    covered: [T; LANES],
    nearer: [T; LANES],
}

impl Counts<u64> {
    /// Adds counts, and sets them to zero.
    #[inline(always)]
    fn take(&mut self, counts: &mut Counts<u32>) {
        let add = |all: &mut [u64; LANES], some: &[u32; LANES]| {
            for (all, some) in all.iter_mut().zip(some) {
                *all += u64::from(*some);
            }
        };
        for (all, some) in self.correct.iter_mut().zip(&counts.correct) {
            add(all, some);
        }
        add(&mut self.outside, &counts.outside);
        add(&mut self.covered, &counts.covered);
        add(&mut self.nearer, &counts.nearer);
        *counts = Counts::default();
    }
}

/// Returns all-ones if the condition holds, otherwise zero.
#[inline(always)]
pub(crate) fn all_bits(condition: bool) -> u32 {
    u32::from(condition).wrapping_neg()
}

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
    const ONE: u64;
    /// Whether there are weights between 0 and the largest.
    const GRADED: bool;

    /// Returns the weights of `n` pixels from the pixel `first` on, and 0 beyond them.
    fn load(&self, first: usize, n: usize) -> [u64; LANES];
}

/// An exact mask.
impl Weights for &[bool] {
    const ONE: u64 = u64::MAX;
    const GRADED: bool = false;

    #[inline(always)]
    fn load(&self, first: usize, n: usize) -> [u64; LANES] {
        let mut masked = [false; LANES];
        if n == LANES {
            masked.copy_from_slice(&self[first..first + LANES]);
        } else {
            masked[..n].copy_from_slice(&self[first..]);
        }
        masked.map(all_bits)
    }
}

/// Weights of an imperfect mask; `None` outside of its region.
impl Weights for Option<&[u8]> {
    const ONE: u64 = CERTAIN as u64;
    const GRADED: bool = true;

    #[inline(always)]
    fn load(&self, first: usize, n: usize) -> [u64; LANES] {
        let mut weights = [0; LANES];
        if let Some(row) = self {
            weights[..n].copy_from_slice(&row[first..first + n]);
        }
        weights.map(u64::from)
    }
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
        let limits = tolerances();
        let inverse_diameter = 1.0 / self.diameter;
        let mut correct = [[0_u64; LANES]; N_TOLERANCES];
        let mut outside = [0_u64; LANES];
        let (mut covered, mut nearer) = ([0_u64; LANES], [0_u64; LANES]);
        for row in self.rows {
            let squared_y = row.y * row.y + 1.0;
            let width = row.rendered.len();
            let mut first = 0;
            while first < width {
                // The last pixels of a row are padded with pixels that do not count.
                let n = (width - first).min(LANES);
                let (mut rendered, mut observed) = ([0.0_f32; LANES], [0.0_f32; LANES]);
                let weights = if n == LANES {
                    rendered.copy_from_slice(&row.rendered[first..first + LANES]);
                    observed.copy_from_slice(&row.observed[first..first + LANES]);
                    row.mask.load(first, LANES)
                } else {
                    rendered[..n].copy_from_slice(&row.rendered[first..]);
                    observed[..n].copy_from_slice(&row.observed[first..]);
                    row.mask.load(first, n)
                };
                if rendered == [0.0; LANES] {
                    first += LANES;
                    continue;
                }
                // Masks are all-ones or zero instead of `bool`, which avoids a branch per pixel.
                let mut relative = [0.0; LANES];
                let mut certain = [0; LANES];
                for lane in 0..LANES {
                    let (z, measured) = (f64::from(rendered[lane]), f64::from(observed[lane]));
                    let u = f64::from(row.u) + (first + lane) as f64;
                    let x = (u - self.cx) * self.inverse_fx;
                    let distance_per_depth = (x * x + squared_y).sqrt();
                    let behind = (z - measured) * distance_per_depth;
                    let (seen, known) = (all_bits(z > 0.0), all_bits(measured > 0.0));
                    let outside_mask = W::ONE - weights[lane];
                    let counts = if W::GRADED {
                        // Outside the mask, a pixel counts half if it is near the surface.
                        let through = all_bits(behind < -self.hidden_beyond) | !known;
                        let front =
                            all_bits(behind > self.hidden_beyond.max(0.25 * self.diameter)) & known;
                        let near = (outside_mask / 2) & seen & !through & !front;
                        outside[lane] += (outside_mask & seen & through) + near;
                        nearer[lane] += outside_mask & seen & front;
                        covered[lane] += weights[lane] & seen & known;
                        certain[lane] = weights[lane] + near;
                        all_bits(certain[lane] > 0)
                    } else {
                        let hidden = known & all_bits(behind > self.hidden_beyond);
                        outside[lane] += 1 & outside_mask & seen & !hidden;
                        weights[lane]
                    };
                    // NaN if the pixel does not count: NaN is below no limit.
                    let nothing = !(seen & known & counts);
                    relative[lane] =
                        f64::from_bits((behind.abs() * inverse_diameter).to_bits() | nothing);
                }
                for (correct, limit) in correct.iter_mut().zip(limits) {
                    for lane in 0..LANES {
                        correct[lane] += if W::GRADED {
                            certain[lane] & all_bits(relative[lane] < limit)
                        } else {
                            u64::from(relative[lane] < limit)
                        };
                    }
                }
                first += LANES;
            }
        }
        let sum = |lanes: [u64; LANES]| lanes.iter().sum::<u64>();
        Found {
            correct: correct.map(sum),
            outside: sum(outside),
            covered: sum(covered),
            nearer: sum(nearer),
        }
    }
}

/// Returns all-ones if the condition holds, otherwise zero.
#[inline(always)]
fn all_bits(condition: bool) -> u64 {
    u64::from(condition).wrapping_neg()
}

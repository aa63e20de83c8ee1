//! Counts of agreeing pixels, many at a time.

use hicp_core::internal::VectorLoop;

use crate::tolerances::{N_TOLERANCES, tolerances};

/// Number of pixels counted at once.
const LANES: usize = 8;

/// A row of pixels: rendered depth, measured depth and mask, from the same column on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row<'a> {
    pub(crate) rendered: &'a [f32],
    pub(crate) observed: &'a [f32],
    pub(crate) masked: &'a [bool],
    /// Column of the first pixel.
    pub(crate) u: u32,
    /// (v − cy) / fy.
    pub(crate) y: f64,
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
}

impl<'a, R: Iterator<Item = Row<'a>>> VectorLoop for Agreement<R> {
    type Output = Found;

    #[inline(always)]
    fn run(self) -> Found {
        let limits = tolerances();
        let inverse_diameter = 1.0 / self.diameter;
        let mut correct = [[0_u64; LANES]; N_TOLERANCES];
        let mut outside = [0_u64; LANES];
        for row in self.rows {
            let squared_y = row.y * row.y + 1.0;
            let width = row.rendered.len();
            let mut first = 0;
            while first < width {
                // The last pixels of a row are padded with pixels that do not count.
                let n = (width - first).min(LANES);
                let (mut rendered, mut observed) = ([0.0_f32; LANES], [0.0_f32; LANES]);
                let mut masked = [false; LANES];
                if n == LANES {
                    rendered.copy_from_slice(&row.rendered[first..first + LANES]);
                    observed.copy_from_slice(&row.observed[first..first + LANES]);
                    masked.copy_from_slice(&row.masked[first..first + LANES]);
                } else {
                    rendered[..n].copy_from_slice(&row.rendered[first..]);
                    observed[..n].copy_from_slice(&row.observed[first..]);
                    masked[..n].copy_from_slice(&row.masked[first..]);
                }
                if rendered == [0.0; LANES] {
                    first += LANES;
                    continue;
                }
                // Masks are all-ones or zero instead of `bool`, which avoids a branch per pixel.
                let mut relative = [0.0; LANES];
                for lane in 0..LANES {
                    let (z, measured) = (f64::from(rendered[lane]), f64::from(observed[lane]));
                    let u = f64::from(row.u) + (first + lane) as f64;
                    let x = (u - self.cx) * self.inverse_fx;
                    let distance_per_depth = (x * x + squared_y).sqrt();
                    let behind = (z - measured) * distance_per_depth;
                    let (seen, known) = (all_bits(z > 0.0), all_bits(measured > 0.0));
                    let masked = all_bits(masked[lane]);
                    let hidden = known & all_bits(behind > self.hidden_beyond);
                    outside[lane] += 1 & seen & !masked & !hidden;
                    // NaN if the pixel does not count: NaN is below no limit.
                    let nothing = !(seen & known & masked);
                    relative[lane] =
                        f64::from_bits((behind.abs() * inverse_diameter).to_bits() | nothing);
                }
                for (correct, limit) in correct.iter_mut().zip(limits) {
                    for lane in 0..LANES {
                        correct[lane] += u64::from(relative[lane] < limit);
                    }
                }
                first += LANES;
            }
        }
        let sum = |lanes: [u64; LANES]| lanes.iter().sum::<u64>();
        Found {
            correct: correct.map(sum),
            outside: sum(outside),
        }
    }
}

/// Returns all-ones if the condition holds, otherwise zero.
#[inline(always)]
fn all_bits(condition: bool) -> u64 {
    u64::from(condition).wrapping_neg()
}

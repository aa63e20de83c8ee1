//! Plane fits next to depth edges.

use super::edges::Edges;
use super::lanes::LANES;
use super::patch::{DepthPatch, MIN_FITTED_METERS};
use super::plane_fits::PlaneFits;
use super::row::Row;
use super::size::EDGE_RADIUS;
use crate::internal::VectorLoop;

// The columns of the largest window are summed in parallel, with one that stays empty.
const _: () = assert!(LANES == 2 * EDGE_RADIUS + 2);

/// A set of pixels of the gated window, one byte per row: bit `8 y + x`.
type Joined = u64;

/// Sums the pixels of a row near depth edges, each with the neighbors on its own side.
pub(super) struct FitGated<'a, 'b> {
    pub(super) edges: &'a Edges,
    pub(super) edge_step: f32,
    /// Half side of the window, at most [`EDGE_RADIUS`] pixels.
    pub(super) radius: usize,
    pub(super) fits: &'a mut PlaneFits,
    pub(super) row: &'a mut Row<'b>,
}

impl VectorLoop for FitGated<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let (patch, v) = (self.row.patch, self.row.v);
        let depth = patch.row(v);
        for u in self.edges.near.columns(v, depth.len()) {
            if depth[u] >= MIN_FITTED_METERS {
                let window = Window::around(patch, u, v, self.radius);
                let sums = self.sums(&window, window.joined(self.edges));
                let at = [(u - window.left) as f64, (v - window.top) as f64];
                self.fits.push(u, at, sums);
                if self.fits.is_full() {
                    self.fits.solve(self.row);
                }
            }
        }
    }
}

impl FitGated<'_, '_> {
    /// Sums the pixels of a set that also lie within a depth gate.
    ///
    /// Without the gate, a path around the end of an edge may reach its other side, and slopes just
    /// below an edge may add up.
    #[inline(always)]
    fn sums(&self, window: &Window, joined: Joined) -> [f64; 9] {
        let center = self.row.patch.row(window.v)[window.u];
        let mut across = [0.0_f32; LANES];
        for (lane, across) in across.iter_mut().enumerate() {
            *across = (window.left + lane).abs_diff(window.u) as f32;
        }
        // Per column: the number of pixels, the sums of rows and of squared rows, the sum of
        // inverse depths, and the sum of inverse depth times row.
        let (mut n, mut y, mut yy) = ([0_u32; LANES], [0_u32; LANES], [0_u32; LANES]);
        let (mut w, mut yw) = ([0.0_f64; LANES], [0.0_f64; LANES]);
        for row in 0..window.rows {
            let v = window.top + row;
            // Pixels beyond the end of the row are not in the set.
            let z = self.row.patch.block(window.left, v).0;
            #[allow(clippy::cast_possible_truncation)] // A byte, and a row of the window.
            let (bits, line) = ((joined >> (8 * row)) as u32 & 0xff, row as u32);
            let away = (v.abs_diff(window.v).max(1)) as f32;
            for lane in 0..LANES {
                let reach = if across[lane] > away {
                    across[lane]
                } else {
                    away
                };
                let gate = self.edge_step * center * (0.5 + 0.5 * reach);
                let used = (bits >> lane & 1 != 0)
                    & (z[lane] >= MIN_FITTED_METERS)
                    & ((z[lane] - center).abs() <= gate);
                // All bits are set where the pixel is used.
                let mask = u32::from(used).wrapping_neg();
                n[lane] += mask & 1;
                y[lane] += mask & line;
                yy[lane] += mask & (line * line);
                let inverse = 1.0 / f64::from(if used { z[lane] } else { f32::INFINITY });
                w[lane] += inverse;
                yw[lane] += inverse * f64::from(line);
            }
        }
        sum_columns(&n, &y, &yy, &w, &yw)
    }
}

/// Sums columns, given by n, Σv, Σv², Σw and Σvw of each.
///
/// Returns n, Σu, Σv, Σu², Σuv, Σv², Σw, Σuw and Σvw.
#[inline(always)]
fn sum_columns(
    n: &[u32; LANES],
    v: &[u32; LANES],
    vv: &[u32; LANES],
    w: &[f64; LANES],
    vw: &[f64; LANES],
) -> [f64; 9] {
    let (mut counts, mut sums) = ([0_u32; 6], [0.0; 3]);
    for (u, column) in (0_u32..).zip(0..LANES) {
        let terms = [
            n[column],
            u * n[column],
            v[column],
            u * u * n[column],
            u * v[column],
            vv[column],
        ];
        for (sum, term) in counts.iter_mut().zip(terms) {
            *sum += term;
        }
        let terms = [w[column], f64::from(u) * w[column], vw[column]];
        for (sum, term) in sums.iter_mut().zip(terms) {
            *sum += term;
        }
    }
    let [n, u, v, uu, uv, vv] = counts.map(f64::from);
    let [w, uw, vw] = sums;
    [n, u, v, uu, uv, vv, w, uw, vw]
}

/// The gated window around a pixel, cut at the borders.
struct Window {
    u: usize,
    v: usize,
    left: usize,
    top: usize,
    columns: usize,
    rows: usize,
}

impl Window {
    #[inline(always)]
    fn around(patch: &DepthPatch<'_>, u: usize, v: usize, radius: usize) -> Self {
        let (width, height) = (patch.region.width(), patch.region.height());
        let (left, top) = (u.saturating_sub(radius), v.saturating_sub(radius));
        Self {
            u,
            v,
            left,
            top,
            columns: (u + radius + 1).min(width) - left,
            rows: (v + radius + 1).min(height) - top,
        }
    }

    /// Returns the pixels connected to the window's center by steps that are not edges.
    #[inline(always)]
    fn joined(&self, edges: &Edges) -> Joined {
        // Column 7 stays empty, so that shifts do not carry from one row into the next.
        let (mut right, mut below): (Joined, Joined) = (0, 0);
        for row in 0..self.rows {
            let v = self.top + row;
            right |= edges.right.get(self.left, v, self.columns - 1) << (8 * row);
            below |= edges.below.get(self.left, v, self.columns) << (8 * row);
        }
        // The neighbors below the last row are outside the window.
        below &= !(0xff << (8 * (self.rows - 1)));
        let mut reached: Joined = 1 << (8 * (self.v - self.top) + (self.u - self.left));
        loop {
            let grown = reached
                | (reached & right) << 1
                | (reached >> 1) & right
                | (reached & below) << 8
                | (reached >> 8) & below;
            if grown == reached {
                return reached;
            }
            reached = grown;
        }
    }
}

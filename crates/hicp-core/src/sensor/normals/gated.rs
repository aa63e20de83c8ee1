//! Plane fits next to depth edges.

use super::edges::Edges;
use super::patch::{DepthPatch, MIN_DEPTH_METERS};
use super::size::EDGE_RADIUS;
use super::window::{Rays, WindowSums};
use crate::internal::VectorLoop;
use crate::surfel::Surfel;

/// Columns that are summed in parallel: those of the largest window, and one that stays empty.
const LANES: usize = 2 * EDGE_RADIUS + 2;

/// A set of pixels of the gated window, one byte per row: bit `8 y + x`.
type Joined = u64;

/// Fits the pixels of row `v` near depth edges, each to the neighbors on its own side.
pub(super) struct FitGated<'a> {
    pub(super) patch: &'a DepthPatch<'a>,
    pub(super) edges: &'a Edges,
    pub(super) rays: &'a Rays,
    pub(super) edge_step: f32,
    /// Half side of the window, at most [`EDGE_RADIUS`] pixels.
    pub(super) radius: usize,
    pub(super) v: usize,
    /// The surfels of the row. Those of other pixels are not changed.
    pub(super) surfels: &'a mut [Surfel],
}

impl VectorLoop for FitGated<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let width = self.patch.region.width();
        for u in self.edges.near.columns(self.v, width) {
            let z = self.patch.depth[self.v * width + u];
            if z >= MIN_DEPTH_METERS {
                let window = Window::around(self.patch, u, self.v, self.radius);
                let sums = self.sums(&window, window.joined(self.edges));
                let at = (u - window.left, self.v - window.top);
                let normal = sums.normal(self.rays, (u, self.v), at);
                self.surfels[u] = self.rays.surfel((u, self.v), z, normal);
            }
        }
    }
}

impl FitGated<'_> {
    /// Sums the pixels of a set that also lie within a depth gate.
    ///
    /// Without the gate, a path around the end of an edge may reach its other side, and slopes just
    /// below an edge may add up.
    #[inline(always)]
    fn sums(&self, window: &Window, joined: Joined) -> WindowSums {
        let width = self.patch.region.width();
        let depth = self.patch.depth;
        let center = depth[window.v * width + window.u];
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
            let mut z = [0.0; LANES];
            let pixels = &depth[v * width + window.left..];
            // Pixels beyond the end of the row are not in the set.
            if let Some(pixels) = pixels.first_chunk() {
                z = *pixels;
            } else {
                z[..pixels.len()].copy_from_slice(pixels);
            }
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
                    & (z[lane] >= MIN_DEPTH_METERS)
                    & ((z[lane] - center).abs() <= gate);
                let one = u32::from(used);
                n[lane] += one;
                y[lane] += one * line;
                yy[lane] += one * (line * line);
                let inverse = 1.0 / f64::from(if used { z[lane] } else { f32::INFINITY });
                w[lane] += inverse;
                yw[lane] += inverse * f64::from(line);
            }
        }
        WindowSums::of_columns(&n, &y, &yy, &w, &yw)
    }
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

//! Plane fits beside depth edges.

use nalgebra::UnitVector3;

use super::edges::Edges;
use super::window::{Rays, WindowSums};
use super::{DepthPatch, MIN_DEPTH_METERS};

/// Half side of the gated window, pixels. Its rows must fit [`Joined`].
const EDGE_RADIUS: usize = 3;

/// A set of pixels of the gated window, one byte per row: bit `8 y + x`.
type Joined = u64;

/// Fits the neighbours that lie on the same side of the depth edges as the pixel itself: those that steps which are no
/// edges lead to without leaving the window.
pub(super) fn gated_normal(
    patch: &DepthPatch<'_>,
    edges: &Edges,
    rays: &Rays,
    (u, v): (usize, usize),
    edge_step: f32,
) -> Option<UnitVector3<f32>> {
    let (width, height) = (patch.region.width(), patch.region.height());
    let columns = u.saturating_sub(EDGE_RADIUS)..(u + EDGE_RADIUS + 1).min(width);
    let rows = v.saturating_sub(EDGE_RADIUS)..(v + EDGE_RADIUS + 1).min(height);

    // Column 7 stays empty, so that shifts do not run from one row into the next.
    let (mut right, mut below): (Joined, Joined) = (0, 0);
    for (y, row) in rows.clone().enumerate() {
        right |= edges.right.get(columns.start, row, columns.len() - 1) << (8 * y);
        if row + 1 < rows.end {
            below |= edges.below.get(columns.start, row, columns.len()) << (8 * y);
        }
    }
    let mut reached: Joined = 1 << (8 * (v - rows.start) + (u - columns.start));
    loop {
        let grown = reached
            | (reached & right) << 1
            | (reached >> 1) & right
            | (reached & below) << 8
            | (reached >> 8) & below;
        if grown == reached {
            break;
        }
        reached = grown;
    }

    let center = patch.depth[v * width + u];
    let mut sums = WindowSums::default();
    while reached != 0 {
        let bit = reached.trailing_zeros() as usize;
        reached &= reached - 1;
        let (column, row) = (columns.start + bit % 8, rows.start + bit / 8);
        let z = patch.depth[row * width + column];
        // A way around an edge's end may lead to its other side, and a slope just short of an edge may add up.
        let reach = column.abs_diff(u).max(row.abs_diff(v)).max(1) as f32;
        let gate = edge_step * center * (0.5 + 0.5 * reach);
        if z >= MIN_DEPTH_METERS && (z - center).abs() <= gate {
            sums.add_pixel(column as f64, row as f64, 1.0 / f64::from(z));
        }
    }
    sums.normal(rays, u, v)
}

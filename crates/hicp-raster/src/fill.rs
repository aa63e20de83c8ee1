//! Depth of covered pixels.

use glam::DVec3;
use hicp_core::{PixelRegion, RenderedView};

use crate::edge::{Coverage, Edge};
use crate::projection::ProjectedVertex;

/// Up to this many columns every pixel of the bounding box is tried; in wider ones the ends of each row are computed.
const NARROW_COLUMNS: i64 = 12;

/// The plane of a triangle as the image sees it: 1/z is affine in the pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InverseDepth {
    per_u: f64,
    per_v: f64,
    at_origin: f64,
    low: f64,
    high: f64,
}

impl InverseDepth {
    /// Makes the plane through three vertices, none of them to be clipped.
    #[inline]
    pub(crate) fn through(a: &ProjectedVertex, b: &ProjectedVertex, c: &ProjectedVertex) -> Self {
        let (u1, v1, w1) = (b.u - a.u, b.v - a.v, b.inverse_depth - a.inverse_depth);
        let (u2, v2, w2) = (c.u - a.u, c.v - a.v, c.inverse_depth - a.inverse_depth);
        // A triangle that has an area only by rounding to the grid may have none here: the values are then infinite or
        // not numbers, and the clamp below makes a depth of the triangle of them.
        let scale = 1.0 / (u1 * v2 - u2 * v1);
        let per_u = (w1 * v2 - w2 * v1) * scale;
        let per_v = (u1 * w2 - u2 * w1) * scale;
        Self {
            per_u,
            per_v,
            at_origin: a.inverse_depth - per_u * a.u - per_v * a.v,
            low: lesser(lesser(a.inverse_depth, b.inverse_depth), c.inverse_depth),
            high: greater(greater(a.inverse_depth, b.inverse_depth), c.inverse_depth),
        }
    }

    /// Makes the plane through three homogeneous pixels (u·z, v·z, z), also behind the camera, for the part of it between
    /// two values of 1/z.
    pub(crate) fn through_homogeneous([a, b, c]: [DVec3; 3], low: f64, high: f64) -> Self {
        // 1/z = α u + β v + γ, times z: α (u z) + β (v z) + γ z = 1 at all three.
        let normal = (b - a).cross(c - a);
        let plane = normal / normal.dot(a);
        Self {
            per_u: plane.x,
            per_v: plane.y,
            at_origin: plane.z,
            low,
            high,
        }
    }

    #[inline]
    fn at_row(&self, v: f64) -> f64 {
        self.at_origin + self.per_v * v
    }

    /// Returns the depth in metres at column `u` of a row, never outside the triangle's own range.
    #[inline]
    #[allow(
        clippy::cast_possible_truncation,
        reason = "depth is handed out as f32"
    )]
    fn depth(&self, row: f64, u: f64) -> f32 {
        // `greater` comes first and turns what is not a number into the far end of the range.
        let inverse = lesser(greater(row + self.per_u * u, self.low), self.high);
        (1.0 / inverse) as f32
    }
}

/// Returns `b` unless `a` is greater: one instruction, where `f64::max` has to look after NaN in both.
#[inline]
fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline]
fn lesser(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The buffers of a view that is being filled.
#[derive(Debug)]
pub(crate) struct Target<'a> {
    pub(crate) region: PixelRegion,
    depth: &'a mut [f32],
    triangles: &'a mut [u32],
    width: usize,
}

impl<'a> Target<'a> {
    pub(crate) fn new(view: &'a mut RenderedView) -> Self {
        let region = view.region();
        let (depth, triangles) = view.buffers_mut();
        Self {
            region,
            depth,
            triangles,
            width: region.width(),
        }
    }

    /// Writes the pixels of a triangle where it is nearer than what is there.
    #[inline(always)]
    pub(crate) fn fill(&mut self, coverage: &Coverage, plane: &InverseDepth, triangle: u32) {
        if coverage.columns <= NARROW_COLUMNS {
            self.fill_narrow(coverage, plane, triangle);
        } else {
            self.fill_wide(coverage, plane, triangle);
        }
    }

    #[inline(always)]
    fn fill_narrow(&mut self, coverage: &Coverage, plane: &InverseDepth, triangle: u32) {
        let [e0, e1, e2] = &coverage.edges;
        let mut row_values = [e0.value, e1.value, e2.value];
        let mut start = self.index(coverage.u, coverage.v);
        let columns = index(coverage.columns);
        let (first_u, mut v) = (to_f64(coverage.u), to_f64(coverage.v));
        for _ in 0..coverage.rows {
            let row = plane.at_row(v);
            let [mut w0, mut w1, mut w2] = row_values;
            let mut u = first_u;
            let depths = &mut self.depth[start..start + columns];
            let triangles = &mut self.triangles[start..start + columns];
            for (depth, id) in depths.iter_mut().zip(triangles) {
                if (w0 | w1 | w2) >= 0 {
                    keep_nearer(depth, id, plane.depth(row, u), triangle);
                }
                w0 += e0.per_u;
                w1 += e1.per_u;
                w2 += e2.per_u;
                u += 1.0;
            }
            row_values[0] += e0.per_v;
            row_values[1] += e1.per_v;
            row_values[2] += e2.per_v;
            start += self.width;
            v += 1.0;
        }
    }

    fn fill_wide(&mut self, coverage: &Coverage, plane: &InverseDepth, triangle: u32) {
        let mut edges = coverage.edges;
        let mut start = self.index(coverage.u, coverage.v);
        let (first_u, mut v) = (to_f64(coverage.u), to_f64(coverage.v));
        for _ in 0..coverage.rows {
            let (first, end) = inside_columns(&edges, coverage.columns);
            if first < end {
                let row = plane.at_row(v);
                let mut u = first_u + to_f64(first);
                let span = start + index(first)..start + index(end);
                let depths = &mut self.depth[span.clone()];
                let triangles = &mut self.triangles[span];
                for (depth, id) in depths.iter_mut().zip(triangles) {
                    keep_nearer(depth, id, plane.depth(row, u), triangle);
                    u += 1.0;
                }
            }
            for edge in &mut edges {
                edge.value += edge.per_v;
            }
            start += self.width;
            v += 1.0;
        }
    }

    #[inline]
    fn index(&self, u: i64, v: i64) -> usize {
        index(v - i64::from(self.region.v_min)) * self.width
            + index(u - i64::from(self.region.u_min))
    }
}

/// Returns the columns of a row, first and one past the last, in which no edge is negative.
fn inside_columns(edges: &[Edge; 3], columns: i64) -> (i64, i64) {
    let (mut first, mut end) = (0, columns);
    for edge in edges {
        let (value, step) = (edge.value, edge.per_u);
        if step > 0 {
            if value < 0 {
                // The first column k with value + k step >= 0.
                first = first.max((step - 1 - value) / step);
            }
        } else if value < 0 {
            return (0, 0);
        } else if step < 0 && value + (columns - 1) * step < 0 {
            // The last one.
            end = end.min(value / -step + 1);
        }
    }
    (first, end)
}

/// The nearer depth wins, and of equal ones the first. 0 is no depth.
#[inline]
fn keep_nearer(depth: &mut f32, id: &mut u32, candidate: f32, triangle: u32) {
    if *depth == 0.0 || candidate < *depth {
        *depth = candidate;
        *id = triangle;
    }
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "offsets within a region, not negative and below 2^15"
)]
#[inline]
fn index(offset: i64) -> usize {
    offset as usize
}

/// Pixel indices are below 2¹⁵ and exact.
#[inline]
fn to_f64(pixel: i64) -> f64 {
    pixel as f64
}

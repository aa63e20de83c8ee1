//! The plane of a triangle in the image.

use glam::DVec3;

use crate::projection::ProjectedVertex;

/// The plane of a triangle in the image, where 1/z is affine in the pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InverseDepth {
    per_u: f64,
    per_v: f64,
    at_origin: f64,
    low: f64,
    high: f64,
}

impl InverseDepth {
    /// Creates the plane through three vertices that do not need clipping.
    #[inline(always)]
    pub(crate) fn through(a: &ProjectedVertex, b: &ProjectedVertex, c: &ProjectedVertex) -> Self {
        let (u1, v1, w1) = (b.u - a.u, b.v - a.v, b.inverse_depth - a.inverse_depth);
        let (u2, v2, w2) = (c.u - a.u, c.v - a.v, c.inverse_depth - a.inverse_depth);
        // If the area of a triangle comes only from rounding to the grid, it may be zero here. The
        // values are then infinite or NaN, and `depth` clamps them to the range of the triangle.
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

    /// Creates the plane through three homogeneous pixels (u·z, v·z, z).
    ///
    /// They may be behind the camera. Depths are limited to the range between two values of 1/z.
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

    #[inline(always)]
    pub(crate) fn at_row(&self, v: f64) -> f64 {
        self.at_origin + self.per_v * v
    }

    /// Returns the depth in meters at column `u` of a row, within the range of the triangle.
    #[inline(always)]
    #[allow(
        clippy::cast_possible_truncation,
        reason = "depth is handed out as f32"
    )]
    pub(crate) fn depth(&self, row: f64, u: f64) -> f32 {
        // `greater` comes first and replaces NaN by the far end of the range.
        let inverse = lesser(greater(row + self.per_u * u, self.low), self.high);
        // Four divisions of this precision take the time of one of the other.
        1.0 / inverse as f32
    }

    /// Returns the depths in meters at some columns of a row.
    #[inline(always)]
    pub(crate) fn depths<const N: usize>(&self, row: f64, us: &[f64; N]) -> [f32; N] {
        let mut depths = [0.0; N];
        for (depth, u) in depths.iter_mut().zip(us) {
            *depth = self.depth(row, *u);
        }
        depths
    }
}

/// Returns `b` unless `a` is greater.
///
/// That is one instruction, whereas `f64::max` handles NaN in both arguments.
#[inline(always)]
fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline(always)]
fn lesser(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

//! Exact coverage: integer edge functions with the top-left rule.

use hicp_core::PixelRegion;

use crate::fixed::{FRACTION_BITS, FixedPoint, first_pixel, last_pixel};

/// Largest side with edge functions in 64 bits, in grid units (512 px).
///
/// Sides below it from the first corner limit the extent to twice as much, and the edge functions
/// to two products of 2³⁰ by 2³⁰.
const SMALL_SIDE: i64 = 1 << 29;

/// The drawn triangles, by the sign of their area in the image (u right, v down).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Keep {
    /// All triangles with an area.
    Both,
    /// Triangles of negative area: counter-clockwise as seen, the front of an outward-facing mesh.
    Negative,
    /// Triangles of positive area.
    Positive,
}

/// One edge function over the pixels of a triangle's bounding box.
///
/// The function is divided by the grid units of a pixel and rounded down. One pixel changes it by a
/// multiple of the divisor, so its sign stays exact and the numbers stay small. Only the sign
/// matters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Edge {
    /// Value at the first pixel of the bounding box. A pixel is inside if no edge is negative
    /// there.
    pub(crate) value: i64,
    /// Change per column.
    pub(crate) per_u: i64,
    /// Change per row.
    pub(crate) per_v: i64,
}

impl Edge {
    /// Creates the edge from `p` to `q` of a triangle of positive area, evaluated at pixel center
    /// `at`.
    #[inline(always)]
    fn new<const SMALL: bool>(p: FixedPoint, q: FixedPoint, at: FixedPoint) -> Self {
        let (du, dv) = (q.u - p.u, q.v - p.v);
        // Rows grow downward and the area is positive. The inside therefore lies below an edge that
        // runs to the right, and to the right of an edge that runs upward. These are the top and
        // left edges, which own the pixel centers on them.
        let owns = dv < 0 || (dv == 0 && du > 0);
        let (u, v) = (at.u - p.u, at.v - p.v);
        let value = if SMALL {
            (du * v - dv * u - i64::from(!owns)) >> FRACTION_BITS
        } else {
            let value = wide_cross(du, dv, u, v) - i128::from(!owns);
            narrow(value >> FRACTION_BITS)
        };
        Self {
            value,
            per_u: -dv,
            per_v: du,
        }
    }
}

/// Returns whether all sides are within plus or minus [`SMALL_SIDE`].
#[inline]
fn are_small(sides: [i64; 4]) -> bool {
    // Shifted to start at 0 and combined by OR: one comparison, since negative numbers are large
    // ones without their sign.
    let together = sides
        .iter()
        .fold(0, |bits, side| bits | (side + SMALL_SIDE).cast_unsigned());
    together < 2 * SMALL_SIDE.unsigned_abs()
}

fn wide_cross(au: i64, av: i64, bu: i64, bv: i64) -> i128 {
    i128::from(au) * i128::from(bv) - i128::from(av) * i128::from(bu)
}

/// Converts a value that fits.
///
/// Coordinates reach 2³⁷ units (two guard bands), differences 2³⁸, and edge functions 2⁷⁷. Divided
/// by the units of a pixel, that is 2⁵⁷.
#[allow(
    clippy::cast_possible_truncation,
    reason = "bounded as the comment above shows"
)]
fn narrow(value: i128) -> i64 {
    value as i64
}

/// The pixels of a view that a triangle can cover, and the edges that decide which it does.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Coverage {
    pub(crate) edges: [Edge; 3],
    /// First column and row in the view's region.
    pub(crate) u: i64,
    pub(crate) v: i64,
    /// Number of columns and rows, at least one each.
    pub(crate) columns: i64,
    pub(crate) rows: i64,
}

impl Coverage {
    /// Sets up a triangle.
    ///
    /// Returns `None` if it has no area, is culled, or if no pixel center of `region` lies in its
    /// bounding box.
    #[inline(always)]
    pub(crate) fn new(
        a: FixedPoint,
        b: FixedPoint,
        c: FixedPoint,
        keep: Keep,
        region: &PixelRegion,
    ) -> Option<Self> {
        let (bu, bv, cu, cv) = (b.u - a.u, b.v - a.v, c.u - a.u, c.v - a.v);
        let small = are_small([bu, bv, cu, cv]);
        let area_sign = if small {
            (bu * cv - bv * cu).signum()
        } else {
            narrow(wide_cross(bu, bv, cu, cv).signum())
        };
        let dropped = match keep {
            Keep::Both => area_sign == 0,
            Keep::Negative => area_sign >= 0,
            Keep::Positive => area_sign <= 0,
        };
        if dropped {
            return None;
        }

        let (u_low, u_high) = (a.u.min(b.u).min(c.u), a.u.max(b.u).max(c.u));
        let u = first_pixel(u_low).max(i64::from(region.u_min));
        let u_last = last_pixel(u_high).min(i64::from(region.u_max) - 1);
        let (v_low, v_high) = (a.v.min(b.v).min(c.v), a.v.max(b.v).max(c.v));
        let v = first_pixel(v_low).max(i64::from(region.v_min));
        let v_last = last_pixel(v_high).min(i64::from(region.v_max) - 1);
        if u > u_last || v > v_last {
            return None;
        }

        let (b, c) = if area_sign > 0 { (b, c) } else { (c, b) };
        let at = FixedPoint {
            u: u << FRACTION_BITS,
            v: v << FRACTION_BITS,
        };
        let edges = if small {
            [
                Edge::new::<true>(a, b, at),
                Edge::new::<true>(b, c, at),
                Edge::new::<true>(c, a, at),
            ]
        } else {
            [
                Edge::new::<false>(a, b, at),
                Edge::new::<false>(b, c, at),
                Edge::new::<false>(c, a, at),
            ]
        };
        Some(Self {
            edges,
            u,
            v,
            columns: u_last - u + 1,
            rows: v_last - v + 1,
        })
    }
}

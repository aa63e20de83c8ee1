//! The sub-pixel grid to which projected vertices are rounded.

/// Binary digits of a pixel.
///
/// With 20, rounding moves a vertex by less than the resolution of the mesh's `f32` coordinates.
/// Triangles up to 512 px still have edge functions in 64 bits.
pub(crate) const FRACTION_BITS: u32 = 20;

/// Grid units per pixel.
pub(crate) const UNITS_PER_PIXEL: f64 = (1_u64 << FRACTION_BITS) as f64;

/// Projected coordinates beyond this many pixels from the origin are clipped.
///
/// It is twice the largest image side, and a constant, so that the bits of a pixel do not depend on
/// the image or on the requested region.
pub(crate) const GUARD_PIXELS: f64 = 65_536.0;

/// Adding this to a number below 2⁵¹ puts its nearest integer into the low digits of the mantissa.
const ROUNDER: f64 = 1.5 * (1_u64 << 52) as f64;

/// A position in the image plane, in grid units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct FixedPoint {
    pub(crate) u: i64,
    pub(crate) v: i64,
}

impl FixedPoint {
    /// Rounds a position in pixels to the grid. It must be at most a few guard bands from the
    /// origin.
    #[inline]
    pub(crate) fn nearest(u: f64, v: f64) -> Self {
        Self {
            u: round(u * UNITS_PER_PIXEL),
            v: round(v * UNITS_PER_PIXEL),
        }
    }
}

/// Rounds to the nearest integer, half to even.
///
/// Without SSE4.1, `f64::round` is a library call, and this is the hot path.
#[inline]
fn round(x: f64) -> i64 {
    (x + ROUNDER)
        .to_bits()
        .wrapping_sub(ROUNDER.to_bits())
        .cast_signed()
}

/// Returns the first pixel center at or after a grid position.
#[inline]
pub(crate) fn first_pixel(units: i64) -> i64 {
    (units + ((1 << FRACTION_BITS) - 1)) >> FRACTION_BITS
}

/// Returns the last pixel center at or before a grid position.
#[inline]
pub(crate) fn last_pixel(units: i64) -> i64 {
    units >> FRACTION_BITS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_is_to_nearest_even() {
        for (x, expected) in [
            (0.0, 0),
            (-0.0, 0),
            (0.5, 0),
            (1.5, 2),
            (-0.5, 0),
            (-1.5, -2),
            (2.4999, 2),
            (-2.5001, -3),
            (1e11 + 0.75, 100_000_000_001),
            (-1e11 - 0.75, -100_000_000_001),
        ] {
            assert_eq!(round(x), expected, "{x}");
        }
    }

    #[test]
    fn pixel_centers_lie_on_the_grid() {
        let p = FixedPoint::nearest(-65_536.0, 32_767.0);
        assert_eq!((first_pixel(p.u), last_pixel(p.u)), (-65_536, -65_536));
        assert_eq!((first_pixel(p.v), last_pixel(p.v)), (32_767, 32_767));
        let p = FixedPoint::nearest(-0.25, 0.25);
        assert_eq!((first_pixel(p.u), last_pixel(p.u)), (0, -1));
        assert_eq!((first_pixel(p.v), last_pixel(p.v)), (1, 0));
    }
}

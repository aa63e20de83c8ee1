//! Profiles and polygons that solids are turned and extruded from: points in the plane, metres.

/// A point of a spherical bowl's profile, from the foot at its axis (0) up to the rim (14).
pub(crate) fn bowl_point(i: usize, radius: f64) -> (f64, f64) {
    let t = 1.35 * f64::from(to_u32(i)) / 14.0;
    (radius * t.sin(), 0.04 - radius * t.cos())
}

/// Inserts points so that no segment of an open profile is longer than `longest`; the closing segment runs along the axis.
pub(crate) fn refine(profile: &[(f64, f64)], longest: f64) -> Vec<(f64, f64)> {
    let mut points = subdivide(profile, longest);
    // The closing segment lies on the axis and makes no surface.
    while points.len() > 1
        && points.last().is_some_and(|p| p.0 == 0.0)
        && points[points.len() - 2].0 == 0.0
    {
        points.pop();
    }
    points
}

/// Inserts points so that no side of a closed polygon is longer than `longest`.
pub(crate) fn subdivide(polygon: &[(f64, f64)], longest: f64) -> Vec<(f64, f64)> {
    let mut points = Vec::new();
    for (i, &(x, y)) in polygon.iter().enumerate() {
        let (next_x, next_y) = polygon[(i + 1) % polygon.len()];
        let length = (next_x - x).hypot(next_y - y);
        let pieces = (length / longest).ceil().max(1.0);
        let mut k = 0.0;
        while k < pieces {
            let t = k / pieces;
            points.push((x + (next_x - x) * t, y + (next_y - y) * t));
            k += 1.0;
        }
    }
    points
}

/// Loop counters of the shapes above.
pub(crate) fn to_u32(i: usize) -> u32 {
    u32::try_from(i).unwrap_or(u32::MAX)
}

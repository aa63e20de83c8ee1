//! Profiles and polygons for lathes and extrusions: points in the plane, meters.

/// Returns the points of a curve at 0, 1, …, `last`.
pub(crate) fn curve<P>(last: u32, point: impl Fn(f64) -> P) -> Vec<P> {
    (0..=last).map(f64::from).map(point).collect()
}

/// Returns the profile of a spherical bowl, from the foot on its axis up to the rim and back
/// inside.
pub(crate) fn bowl_profile(outer_radius: f64, inner_radius: f64) -> Vec<(f64, f64)> {
    let side = |radius: f64| {
        curve(14, |i| {
            let t = 1.35 * i / 14.0;
            (radius * t.sin(), 0.04 - radius * t.cos())
        })
    };
    let (mut profile, inside) = (side(outer_radius), side(inner_radius));
    profile.extend(inside.into_iter().rev());
    profile
}

/// Inserts points so that no segment of an open profile is longer than `longest`.
///
/// The closing segment runs along the axis.
pub(crate) fn refine(profile: &[(f64, f64)], longest: f64) -> Vec<(f64, f64)> {
    let mut points = subdivide(profile, longest);
    // The closing segment lies on the axis and forms no surface.
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

//! Clipping at the near plane and the guard band.

use glam::DVec3;

use crate::fixed::GUARD_PIXELS;

/// Clips triangles and reuses its buffers between calls.
#[derive(Clone, Debug, Default)]
pub(crate) struct Clipper {
    polygon: Vec<DVec3>,
    next: Vec<DVec3>,
}

impl Clipper {
    /// Returns the part of a triangle beyond the near plane and inside the guard band.
    ///
    /// The result is a convex polygon in the triangle's winding, empty if nothing remains. Corners
    /// are homogeneous pixels (u·z, v·z, z). All results have z ≥ `near` > 0.
    ///
    /// Invariant: an edge that two triangles share is cut at the identical point in both.
    pub(crate) fn clip(&mut self, triangle: [DVec3; 3], near: f64) -> &[DVec3] {
        self.polygon.clear();
        self.polygon.extend(triangle);
        // The near plane comes first: the others are meaningful only for positive z.
        self.cut(DVec3::Z, near);
        for h in &mut self.polygon {
            // Interpolation may miss the plane by a rounding error.
            h.z = h.z.max(near);
        }
        for normal in [
            DVec3::new(1.0, 0.0, GUARD_PIXELS),
            DVec3::new(-1.0, 0.0, GUARD_PIXELS),
            DVec3::new(0.0, 1.0, GUARD_PIXELS),
            DVec3::new(0.0, -1.0, GUARD_PIXELS),
        ] {
            self.cut(normal, 0.0);
        }
        &self.polygon
    }

    /// Keeps the half-space `normal · h >= offset`, a step of the Sutherland–Hodgman algorithm.
    fn cut(&mut self, normal: DVec3, offset: f64) {
        let Some(&last) = self.polygon.last() else {
            return;
        };
        // The signed distance without a particular unit, not negative inside.
        let distance = |h: DVec3| normal.dot(h) - offset;
        self.next.clear();
        let (mut from, mut from_distance) = (last, distance(last));
        for &to in &self.polygon {
            let to_distance = distance(to);
            if (from_distance >= 0.0) != (to_distance >= 0.0) {
                // Always from the inside to the outside. Both triangles at an edge then round
                // alike, although they traverse it in opposite directions.
                self.next.push(if from_distance >= 0.0 {
                    crossing(from, from_distance, to, to_distance)
                } else {
                    crossing(to, to_distance, from, from_distance)
                });
            }
            if to_distance >= 0.0 {
                self.next.push(to);
            }
            (from, from_distance) = (to, to_distance);
        }
        std::mem::swap(&mut self.polygon, &mut self.next);
    }
}

/// Returns the point where the edge from an inside to an outside point leaves.
fn crossing(inside: DVec3, inside_distance: f64, outside: DVec3, outside_distance: f64) -> DVec3 {
    let fraction = inside_distance / (inside_distance - outside_distance);
    inside + (outside - inside) * fraction
}

#[cfg(test)]
mod tests {
    use super::*;

    const NEAR: f64 = 0.01;

    #[test]
    fn a_triangle_inside_is_returned_unchanged() {
        let triangle = [
            DVec3::new(10.0, 10.0, 1.0),
            DVec3::new(20.0, 10.0, 1.0),
            DVec3::new(10.0, 20.0, 2.0),
        ];
        assert_eq!(Clipper::default().clip(triangle, NEAR), triangle);
    }

    #[test]
    fn nothing_remains_of_triangles_behind_or_next_to_the_image() {
        let mut clipper = Clipper::default();
        let behind = [DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, 0.009)];
        assert!(clipper.clip(behind, NEAR).is_empty());
        let beside = [
            DVec3::new(70_000.0, 0.0, 1.0),
            DVec3::new(80_000.0, 1.0, 1.0),
            DVec3::new(70_000.0, 5.0, 1.0),
        ];
        assert!(clipper.clip(beside, NEAR).is_empty());
    }

    #[test]
    fn a_shared_edge_is_cut_at_the_identical_point() {
        let (p, q) = (DVec3::new(3.3, -7.1, 0.731), DVec3::new(-11.9, 2.3, -0.377));
        let (r, s) = (DVec3::new(5.7, 5.3, 0.517), DVec3::new(-1.1, -9.7, 0.193));
        let mut clipper = Clipper::default();
        let first = clipper.clip([p, q, r], NEAR).to_vec();
        let second = clipper.clip([q, p, s], NEAR).to_vec();
        let shared: Vec<_> = first.iter().filter(|h| second.contains(h)).collect();
        assert_eq!(shared.len(), 2, "{first:?} {second:?}");
        assert!(first.iter().chain(&second).all(|h| h.z >= NEAR));
    }

    #[test]
    fn the_remaining_polygon_lies_in_the_guard_band() {
        let triangle = [
            DVec3::new(-1e9, -1e9, 1.0),
            DVec3::new(1e9, -1e9, 1.0),
            DVec3::new(0.0, 2e9, 2.0),
        ];
        let mut clipper = Clipper::default();
        let polygon = clipper.clip(triangle, NEAR);
        // The triangle covers the whole band.
        assert_eq!(polygon.len(), 4);
        for h in polygon {
            assert!((h.x / h.z).abs() <= GUARD_PIXELS * (1.0 + 1e-9), "{h}");
            assert!((h.y / h.z).abs() <= GUARD_PIXELS * (1.0 + 1e-9), "{h}");
        }
    }
}

//! The surfaces that were searched in vain.

use hicp_core::Point3;

use super::segments::Segment;

/// Number of frames until a surface is searched again: after the first search, and at most.
const REST: usize = 1;
const LONGEST_REST: usize = 80;
/// Movement in diameters and relative change of the area above which a surface is another one.
const OTHER_MEAN: f64 = 0.1;
const OTHER_AREA: f64 = 0.15;

/// The surfaces that were searched in vain. Each rests for some frames before its next search.
#[derive(Default)]
pub(super) struct Rejections(Vec<Rejected>);

struct Rejected {
    mean: Point3<f64>,
    area: f64,
    /// Number of frames of its last rest.
    rest: usize,
    /// Number of frames until it is searched again.
    left: usize,
}

impl Rejections {
    /// Counts a frame with some surfaces, and returns those that do not rest.
    ///
    /// Forgets rested surfaces that the frame does not show.
    pub(super) fn fresh(&mut self, segments: &[Segment], diameter: f64) -> Vec<Segment> {
        for rejected in &mut self.0 {
            rejected.left = rejected.left.saturating_sub(1);
        }
        let shown = |r: &Rejected| segments.iter().any(|s| r.is(s, diameter));
        self.0.retain(|r| r.left > 0 || shown(r));
        let rests = |s: &&Segment| self.0.iter().any(|r| r.left > 0 && r.is(s, diameter));
        segments.iter().filter(|s| !rests(s)).copied().collect()
    }

    /// Adds a surface. After each further search in vain, it rests twice as long.
    pub(super) fn add(&mut self, segment: &Segment, diameter: f64) {
        let before = self.0.iter().position(|r| r.is(segment, diameter));
        let before = before.map(|index| self.0.swap_remove(index).rest);
        let rest = before.map_or(REST, |rest| (2 * rest).min(LONGEST_REST));
        self.0.push(Rejected {
            mean: segment.mean,
            area: segment.area,
            rest,
            left: rest,
        });
    }

    pub(super) fn clear(&mut self) {
        self.0.clear();
    }
}

impl Rejected {
    /// Returns whether a surface has about the same place and area.
    fn is(&self, segment: &Segment, diameter: f64) -> bool {
        let moved = (segment.mean - self.mean).norm() / diameter;
        let grown = (segment.area / self.area - 1.0).abs();
        moved < OTHER_MEAN && grown < OTHER_AREA
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rests_double_until_the_surface_changes() {
        let surface = |x| Segment {
            label: 1,
            mean: Point3::new(x, 0.0, 1.0),
            area: 0.01,
        };
        let mut rejections = Rejections::default();
        let mut searched = Vec::new();
        for frame in 0..40 {
            for segment in rejections.fresh(&[surface(0.0)], 0.2) {
                searched.push(frame);
                rejections.add(&segment, 0.2);
            }
        }
        assert_eq!(searched, [0, 1, 3, 7, 15, 31]);
        // Moved by more than a tenth of the diameter, it is another one.
        assert_eq!(rejections.fresh(&[surface(0.03)], 0.2).len(), 1);
    }
}

//! Outlines of silhouettes: closed paths along the sides between pixels inside and outside.

use std::collections::HashSet;

use hicp_core::RenderedView;

/// A side between a pixel inside and a pixel outside the silhouette, as columns and rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Side {
    /// The pixel inside.
    pub inside: (u32, u32),
    /// The pixel outside, which may lie outside the image.
    pub outside: (i64, i64),
}

/// Steps of a path from corner to corner of the pixels: east, south, west and north.
///
/// The inside is to its right.
const STEPS: [(i64, i64); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];
/// The pixel to the right of a step, relative to the corner where the step starts.
const RIGHT: [(i64, i64); 4] = [(0, 0), (-1, 0), (-1, -1), (0, -1)];
const EAST: usize = 0;

/// Returns the outlines of a view's silhouettes and of their holes.
///
/// Each starts at the first side of its topmost row.
/// Pixels that touch only at a corner belong to different silhouettes. Cost: the region's pixels.
#[must_use]
pub fn contours(view: &RenderedView) -> Vec<Vec<Side>> {
    let pixel = |(u, v): (i64, i64)| Some((u32::try_from(u).ok()?, u32::try_from(v).ok()?));
    let shown = |place| pixel(place).filter(|(u, v)| view.depth_at(*u, *v) > 0.0);
    let side = |heading: usize, (x, y): (i64, i64)| {
        let right_of = |heading: usize| (x + RIGHT[heading % 4].0, y + RIGHT[heading % 4].1);
        // The pixel to the left of a step is to the right of a step that turns left.
        let (inside, outside) = (shown(right_of(heading))?, right_of(heading + 3));
        shown(outside).is_none().then_some(Side { inside, outside })
    };
    // Every closed path has a side toward the east, above a pixel of the region.
    let mut passed = HashSet::new();
    let mut paths = Vec::new();
    for (u, v) in view.covered() {
        let start = (i64::from(u), i64::from(v));
        if passed.contains(&(u, v)) || side(EAST, start).is_none() {
            continue;
        }
        let mut path = Vec::new();
        let (mut corner, mut heading) = (start, EAST);
        while let Some(next) = side(heading, corner) {
            path.push(next);
            if heading == EAST {
                passed.insert(next.inside);
            }
            corner = (corner.0 + STEPS[heading].0, corner.1 + STEPS[heading].1);
            let [right, left] = [heading + 1, heading + 3].map(|turn| turn % 4);
            let turns = [right, heading, left].into_iter();
            let mut open = turns.filter(|turn| side(*turn, corner).is_some());
            heading = open.next().unwrap_or(heading);
            if (corner, heading) == (start, EAST) {
                break;
            }
        }
        paths.push(path);
    }
    paths
}

#[cfg(test)]
mod tests {
    use hicp_core::PixelRegion;

    use super::*;

    /// A view of a picture whose hashes are shown, its corner at (3, 2).
    fn view(rows: &[&str]) -> RenderedView {
        let mut view = RenderedView::default();
        view.reset(PixelRegion {
            u_min: 3,
            v_min: 2,
            u_max: 3 + rows[0].len() as u32,
            v_max: 2 + rows.len() as u32,
        });
        let (depth, _) = view.buffers_mut();
        for (depth, letter) in depth.iter_mut().zip(rows.concat().bytes()) {
            *depth = f32::from(u8::from(letter == b'#'));
        }
        view
    }

    fn lengths(rows: &[&str]) -> Vec<usize> {
        contours(&view(rows)).iter().map(Vec::len).collect()
    }

    #[test]
    fn every_side_is_passed_once_and_paths_are_closed() {
        assert_eq!(lengths(&["#"]), [4]);
        assert_eq!(lengths(&["###", "#.#", "###"]), [12, 4]);
        assert_eq!(lengths(&["#.", ".#"]), [4, 4]);
        assert_eq!(lengths(&["..#", "###", "#.."]), [12]);
        assert!(lengths(&["..", ".."]).is_empty());

        let rows = ["#.##.", "####.", ".#.##", "##..#"];
        let view = view(&rows);
        let paths = contours(&view);
        let mut sides: Vec<Side> = paths.concat();
        let count = sides.len();
        sides.sort_by_key(|side| (side.inside, side.outside));
        sides.dedup();
        assert_eq!(sides.len(), count);
        let mut expected = 0;
        for (u, v) in view.covered() {
            for (du, dv) in [(1, 0), (-1, 0), (0, 1), (0, -1_i64)] {
                let next_to = |x: u32, d: i64| u32::try_from(i64::from(x) + d).unwrap();
                let other = view.depth_at(next_to(u, du), next_to(v, dv));
                expected += usize::from(view.depth_at(u, v) > 0.0 && other == 0.0);
            }
        }
        assert_eq!(count, expected);
        // One side after the other.
        for path in &paths {
            for (a, b) in path.iter().zip(path.iter().cycle().skip(1)) {
                let apart = |a: u32, b: u32| a.abs_diff(b) <= 1;
                assert!(apart(a.inside.0, b.inside.0) && apart(a.inside.1, b.inside.1));
            }
        }
    }
}

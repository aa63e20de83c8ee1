//! Outlines of silhouettes: closed paths along the sides between pixels inside and outside.

use hybrid_icp::core::{PixelRegion, RenderedView};

/// A side between a pixel inside and a pixel outside the silhouette, as columns and rows of the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Side {
    pub(crate) inside: (u32, u32),
    /// May lie outside the image.
    pub(crate) outside: (i64, i64),
}

/// The direction of a path, which has its inside to the right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Heading {
    East,
    South,
    West,
    North,
}

impl Heading {
    fn right(self) -> Self {
        match self {
            Self::East => Self::South,
            Self::South => Self::West,
            Self::West => Self::North,
            Self::North => Self::East,
        }
    }

    fn step(self) -> (i64, i64) {
        match self {
            Self::East => (1, 0),
            Self::South => (0, 1),
            Self::West => (-1, 0),
            Self::North => (0, -1),
        }
    }

    /// Returns the pixels to the right and to the left of the side that starts at a corner.
    fn beside(self, (x, y): (i64, i64)) -> ((i64, i64), (i64, i64)) {
        match self {
            Self::East => ((x, y), (x, y - 1)),
            Self::South => ((x - 1, y), (x, y)),
            Self::West => ((x - 1, y - 1), (x - 1, y)),
            Self::North => ((x, y - 1), (x - 1, y - 1)),
        }
    }
}

/// Returns the outlines of a view's silhouettes and of their holes; each starts at its topmost row's first side.
///
/// Pixels that touch only at a corner belong to different silhouettes. Cost: the region's pixels.
pub(crate) fn contours(view: &RenderedView) -> Vec<Vec<Side>> {
    let region = view.region();
    let pixel = |(u, v): (i64, i64)| Some((u32::try_from(u).ok()?, u32::try_from(v).ok()?));
    let shown = |place| pixel(place).filter(|(u, v)| view.depth_at(*u, *v) > 0.0);
    let side = |heading: Heading, corner| {
        let (right, outside) = heading.beside(corner);
        let inside = shown(right)?;
        shown(outside).is_none().then_some(Side { inside, outside })
    };
    // Every closed path has a side toward the east, above a pixel of the region.
    let mut passed = vec![false; region.area()];
    let mut paths = Vec::new();
    for (u, v) in pixels(&region) {
        let start = (i64::from(u), i64::from(v));
        let known = region.index(u, v).is_none_or(|index| passed[index]);
        if known || side(Heading::East, start).is_none() {
            continue;
        }
        let mut path = Vec::new();
        let (mut corner, mut heading) = (start, Heading::East);
        while let Some(next) = side(heading, corner) {
            path.push(next);
            if heading == Heading::East
                && let Some(index) = region.index(next.inside.0, next.inside.1)
            {
                passed[index] = true;
            }
            let (dx, dy) = heading.step();
            corner = (corner.0 + dx, corner.1 + dy);
            let right = heading.right();
            let turns = [right, heading, right.right().right()];
            let turn = turns.into_iter().find(|turn| side(*turn, corner).is_some());
            heading = turn.unwrap_or(heading);
            if (corner, heading) == (start, Heading::East) {
                break;
            }
        }
        paths.push(path);
    }
    paths
}

/// Returns the pixels of a region, row by row.
pub(crate) fn pixels(region: &PixelRegion) -> impl Iterator<Item = (u32, u32)> + use<> {
    let columns = region.u_min..region.u_max;
    let rows = region.v_min..region.v_max;
    rows.flat_map(move |v| columns.clone().map(move |u| (u, v)))
}

#[cfg(test)]
mod tests {
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
        for (u, v) in pixels(&view.region()) {
            for (du, dv) in [(1, 0), (-1, 0), (0, 1), (0, -1_i64)] {
                let beside = |x: u32, d: i64| u32::try_from(i64::from(x) + d).unwrap();
                let other = view.depth_at(beside(u, du), beside(v, dv));
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

//! The lines of the legend of `bop show`: the estimates of both files by object.

use super::estimates::{Estimate, Estimates};

/// An object of the image, with its estimates in the first file and in the second.
#[derive(Debug)]
pub(super) struct Line {
    /// The object's id, and a letter if there are several of it.
    pub(super) tag: String,
    /// Indices into the estimates of both files.
    pub(super) estimates: [Option<usize>; 2],
}

/// Pairs the estimates of every object, the nearest first. The remaining ones have a line each.
///
/// `wanted` lists the objects that should be there, an entry per instance. Instances without an
/// estimate get an empty line.
pub(super) fn lines(files: &[Estimates], wanted: &[u32]) -> Vec<Line> {
    let of_file = |file: usize| files.get(file).map_or(&[][..], |found| &found.shown[..]);
    let (first, second) = (of_file(0), of_file(1));
    let all = first.iter().chain(second).map(|estimate| estimate.obj_id);
    let mut objects: Vec<u32> = all.chain(wanted.iter().copied()).collect();
    objects.sort_unstable();
    objects.dedup();
    let mut lines = Vec::new();
    for obj_id in objects {
        let mut pairs = pairs(obj_id, first, second);
        let wanted = wanted.iter().filter(|id| **id == obj_id).count();
        pairs.resize(pairs.len().max(wanted), [None; 2]);
        let several = pairs.len() > 1;
        for (index, estimates) in pairs.into_iter().enumerate() {
            let letter = if several {
                letters(index)
            } else {
                String::new()
            };
            let tag = format!("{obj_id}{letter}");
            lines.push(Line { tag, estimates });
        }
    }
    lines
}

/// a, b, …, z, aa, bb, …
fn letters(index: usize) -> String {
    let letter = ('a'..='z').nth(index % 26).map(String::from);
    letter.unwrap_or_default().repeat(1 + index / 26)
}

/// Pairs an object's estimates, in the order of the first file.
fn pairs(obj_id: u32, first: &[Estimate], second: &[Estimate]) -> Vec<[Option<usize>; 2]> {
    let of_object = |estimates: &[Estimate]| -> Vec<usize> {
        let indices = 0..estimates.len();
        indices
            .filter(|index| estimates[*index].obj_id == obj_id)
            .collect()
    };
    let (ours, mut left) = (of_object(first), of_object(second));
    let at = |estimate: &Estimate| estimate.camera_from_object.translation.vector;
    let apart = |(a, b): &(usize, usize)| (at(&first[*a]) - at(&second[*b])).norm();
    let all = ours.iter().flat_map(|a| left.iter().map(move |b| (*a, *b)));
    let mut by_distance: Vec<(usize, usize)> = all.collect();
    by_distance.sort_by(|a, b| apart(a).total_cmp(&apart(b)));
    let mut pairs: Vec<[Option<usize>; 2]> = ours.iter().map(|a| [Some(*a), None]).collect();
    for (a, b) in by_distance {
        let pair = pairs.iter_mut().find(|pair| **pair == [Some(a), None]);
        if let (Some(pair), true) = (pair, left.contains(&b)) {
            pair[1] = Some(b);
            left.retain(|other| *other != b);
        }
    }
    pairs.extend(left.into_iter().map(|b| [None, Some(b)]));
    pairs
}

/// Heads of the figures of an estimate.
pub(super) const HEADS: [&str; 4] = ["score", "MVE", "ADI mm", "VSD"];

/// Returns the legend as rows of cells, the heads first: the tag, and the figures of both files.
pub(super) fn grid(files: &[Estimates], lines: &[Line]) -> Vec<Vec<String>> {
    let heads = files.iter().flat_map(|_| HEADS);
    let heads = std::iter::once("object").chain(heads);
    let mut grid = vec![heads.map(str::to_owned).collect()];
    for line in lines {
        let mut row = vec![line.tag.clone()];
        for (file, index) in files.iter().zip(line.estimates) {
            row.extend(cells(index.map(|index| &file.shown[index])));
        }
        grid.push(row);
    }
    grid
}

/// Returns the figures of an estimate under [`HEADS`].
pub(super) fn cells(estimate: Option<&Estimate>) -> [String; 4] {
    let dash = || "–".to_owned();
    let Some(estimate) = estimate else {
        return [dash(), dash(), dash(), dash()];
    };
    let error = estimate.error;
    [
        format!("{:.3}", estimate.score),
        estimate.mve.map_or_else(dash, |mve| format!("{mve:.3}")),
        error.map_or_else(dash, |error| format!("{:.2}", 1e3 * error.adi_m)),
        error.map_or_else(dash, |error| format!("{:.3}", error.vsd)),
    ]
}

#[cfg(test)]
mod tests {
    use hybrid_icp::core::Isometry3;

    use super::*;

    fn estimate(obj_id: u32, x: f64) -> Estimate {
        Estimate {
            obj_id,
            camera_from_object: Isometry3::translation(x, 0.0, 1.0),
            score: 1.0,
            mve: Some(0.25),
            mask: None,
            error: None,
        }
    }

    #[test]
    fn estimates_are_paired_by_object_and_distance() {
        let first = [estimate(4, 0.0), estimate(7, 0.0), estimate(4, 1.0)];
        let second = [estimate(4, 0.9), estimate(4, 1.1), estimate(2, 0.0)];
        let cells_of_first = cells(Some(&first[0]));
        let files = [first.into(), second.into()].map(|shown| Estimates {
            shown,
            ..Estimates::default()
        });
        let lines = lines(&files, &[4, 4, 4, 9, 7]);
        let found: Vec<_> = lines
            .iter()
            .map(|line| (line.tag.as_str(), line.estimates))
            .collect();
        assert_eq!(
            found,
            [
                ("2", [None, Some(2)]),
                ("4a", [Some(0), Some(1)]),
                ("4b", [Some(2), Some(0)]),
                ("4c", [None, None]),
                ("7", [Some(1), None]),
                ("9", [None, None]),
            ]
        );
        assert_eq!(cells_of_first, ["1.000", "0.250", "–", "–"]);
        assert_eq!(cells(None), ["–"; 4]);
        assert_eq!(letters(27), "bb");
    }
}

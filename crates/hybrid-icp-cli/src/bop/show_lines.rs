//! The lines of the legend of `bop show`: which estimates of the two files are of the same object, and what is said of them.

use hybrid_icp::Isometry3;

use super::show_estimates::Estimate;

/// An object of the image, with its estimates in the one file and in the other.
#[derive(Debug)]
pub(crate) struct Line {
    /// The object's id, and a letter where there are several of it.
    pub(crate) tag: String,
    /// Indices into the estimates of the first file and of the second.
    pub(crate) estimates: [Option<usize>; 2],
}

/// Pairs the estimates of every object, the nearest first; what is left has a line of its own.
///
/// `wanted` has the objects that should be there, an entry per instance: those without an estimate get an empty line.
pub(crate) fn lines(of_files: [&[Estimate]; 2], wanted: &[u32]) -> Vec<Line> {
    let [first, second] = of_files;
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
        for (letter, estimates) in letters().zip(pairs) {
            let tag = match several {
                true => format!("{obj_id}{letter}"),
                false => obj_id.to_string(),
            };
            lines.push(Line { tag, estimates });
        }
    }
    lines
}

/// a, b, …, z, aa, ab, …
fn letters() -> impl Iterator<Item = String> {
    let single = || ('a'..='z').map(String::from);
    let more = (1..).flat_map(move |n| single().map(move |letter| letter.repeat(n)));
    more.take(26 * 100)
}

/// Pairs of an object's estimates, in the order of the first file.
fn pairs(obj_id: u32, first: &[Estimate], second: &[Estimate]) -> Vec<[Option<usize>; 2]> {
    let of_object = |estimates: &[Estimate]| -> Vec<usize> {
        let places = estimates.iter().enumerate();
        let places = places.filter(|(_, estimate)| estimate.obj_id == obj_id);
        places.map(|(place, _)| place).collect()
    };
    let (ours, theirs) = (of_object(first), of_object(second));
    let away = |a: usize, b: usize| {
        let at = |pose: &Isometry3<f64>| pose.translation.vector;
        (at(&first[a].camera_from_object) - at(&second[b].camera_from_object)).norm()
    };
    let ours_and_theirs = ours
        .iter()
        .flat_map(|a| theirs.iter().map(move |b| (*a, *b)));
    let mut by_distance: Vec<(usize, usize)> = ours_and_theirs.collect();
    by_distance.sort_by(|(a, b), (c, d)| away(*a, *b).total_cmp(&away(*c, *d)));
    let mut pairs: Vec<[Option<usize>; 2]> = ours.iter().map(|a| [Some(*a), None]).collect();
    let mut left: Vec<usize> = theirs.clone();
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

/// What the legend says of an estimate: its score, its MVE, and ADI in millimetres and mean VSD against the ground truth.
pub(crate) fn cells(estimate: Option<&Estimate>) -> [String; 4] {
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

/// The heads of [`cells`].
pub(crate) const HEADS: [&str; 4] = ["score", "MVE", "ADI mm", "VSD"];

#[cfg(test)]
mod tests {
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
        let lines = lines([&first, &second], &[4, 4, 4, 9, 7]);
        let told: Vec<_> = lines
            .iter()
            .map(|line| (line.tag.as_str(), line.estimates))
            .collect();
        assert_eq!(
            told,
            [
                ("2", [None, Some(2)]),
                ("4a", [Some(0), Some(1)]),
                ("4b", [Some(2), Some(0)]),
                ("4c", [None, None]),
                ("7", [Some(1), None]),
                ("9", [None, None]),
            ]
        );
        assert_eq!(cells(Some(&first[0])), ["1.000", "0.250", "–", "–"]);
        assert_eq!(cells(None), ["–"; 4]);
        assert_eq!(letters().nth(27).as_deref(), Some("bb"));
    }
}

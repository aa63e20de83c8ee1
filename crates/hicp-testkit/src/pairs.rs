//! The pairs on which filters and metrics are tested.

use hybrid_icp::association::{DataAssociation, NearestNeighbor, PointSelection, VisibleSurface};
use hybrid_icp::core::{Correspondences, Isometry3, Pair, Point3, Problem, UnitVector3, Vector3};

use crate::scenes::{Scene, scenes, workspace};

/// A set of pairs with a label for messages.
pub(crate) struct PairSet {
    pub(crate) label: String,
    pub(crate) problem: Problem<'static>,
    pub(crate) pairs: Correspondences,
}

/// Returns about 200 nearest-neighbor pairs of the visible surface with different weights.
fn matched(scene: &'static Scene, pose: &Isometry3<f64>) -> Correspondences {
    let mut workspace = workspace();
    let problem = scene.problem();
    let mut context = workspace.context(&problem);
    let (mut source, mut pairs) = (Vec::new(), Correspondences::new());
    VisibleSurface::default().select(&mut context, pose, &mut source);
    let step = (source.len() / 200).max(1);
    let source: Vec<_> = source.into_iter().step_by(step).collect();
    pairs.begin(pose, source.len());
    NearestNeighbor::default().associate(&mut context, &source, pose, &mut pairs);
    // Weights with few binary digits, so that doubling and adding them is exact.
    for (weight, pair) in [1.0, 0.5, 0.75, 1.0, 0.25]
        .iter()
        .cycle()
        .zip(pairs.as_mut_slice())
    {
        pair.weight = *weight;
    }
    pairs
}

/// Returns the pairs of every scene, at a pose near the true one and at one far away.
pub(crate) fn good_pairs() -> Vec<PairSet> {
    scenes()
        .iter()
        .flat_map(|scene| {
            [
                ("a pose near the true one", scene.near),
                ("a pose far from the true one", scene.far),
            ]
            .map(|(what, pose)| PairSet {
                label: format!("nearest-neighbor pairs of the {} at {what}", scene.name),
                problem: scene.problem(),
                pairs: matched(scene, &pose),
            })
        })
        .collect()
}

/// Returns too few pairs, degenerate pairs, and pairs that are not finite.
pub(crate) fn hard_pairs() -> Vec<PairSet> {
    let scene = &scenes()[0];
    let base = matched(scene, &scene.near);
    let all = base.as_slice();
    let with = |label: &str, pairs: Vec<Pair>| {
        let mut set = Correspondences::new();
        set.begin(base.camera_from_object(), pairs.len());
        set.extend(pairs);
        PairSet {
            label: label.to_owned(),
            problem: scene.problem(),
            pairs: set,
        }
    };
    let every = |change: fn(&mut Pair)| {
        let mut pairs = all.to_vec();
        pairs.iter_mut().for_each(change);
        pairs
    };
    let fifth = |change: fn(&mut Pair)| {
        let mut pairs = all.to_vec();
        change(&mut pairs[5]);
        pairs
    };
    let scaled = |factor: f32| {
        let mut pairs = all.to_vec();
        for pair in &mut pairs {
            for point in [&mut pair.source.point, &mut pair.target.point] {
                *point = point.map(|x| x.clamp(-1.0, 1.0) * factor);
            }
        }
        pairs
    };
    let mut on_a_line = all.to_vec();
    for (pair, millimeters) in on_a_line.iter_mut().zip((0..100_u8).cycle()) {
        pair.source.point = Point3::new(0.0, 0.0, 0.4 + f32::from(millimeters) * 1e-3);
    }
    vec![
        with("no pairs", Vec::new()),
        with("one pair", all[..1].to_vec()),
        with("two pairs", all[..2].to_vec()),
        with("five pairs", all[..5].to_vec()),
        with("one pair, many times", vec![all[0]; 40]),
        with("pairs without any distance", every(|p| p.target = p.source)),
        with("weights of zero", every(|p| p.weight = 0.0)),
        with("sources on a line", on_a_line),
        with(
            "sources in one point",
            every(|p| p.source.point = Point3::new(0.0, 0.0, 0.4)),
        ),
        with("one target of NaN", fifth(|p| p.target.point.x = f32::NAN)),
        with("one source of NaN", fifth(|p| p.source.point.y = f32::NAN)),
        with(
            "all targets infinite",
            every(|p| p.target.point.z = f32::INFINITY),
        ),
        with("one weight of NaN", fifth(|p| p.weight = f32::NAN)),
        with(
            "target normals of zero",
            every(|p| p.target.normal = UnitVector3::new_unchecked(Vector3::zeros())),
        ),
        with("the smallest lengths of f32", scaled(1e-38)),
        with("the largest lengths of f32", scaled(3e38)),
    ]
}

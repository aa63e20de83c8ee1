//! Tests of the scores for masks that are too large, too small, or boxes.

use crate::support::{RayCaster, cuboid, pose, render_depth};
use hicp_core::{
    Context, DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, Problem, RenderCache,
};
use hicp_score::{MeanVsd, SampledMve, Score};

const SIDE: usize = 96;

fn camera() -> PinholeCamera {
    PinholeCamera::new(150.0, 150.0, 47.6, 46.3, SIDE as u32, SIDE as u32).unwrap()
}

fn model() -> Model {
    Model::new(cuboid(0.08, 0.05, 0.11))
}

fn at() -> Isometry3<f64> {
    pose(0.003, -0.002, 0.4, 0.4, 0.8, 0.2)
}

/// Returns the depth of the object in front of a sloping table.
fn scene() -> (Vec<f32>, Vec<bool>) {
    scene_of(&model())
}

fn scene_of(model: &Model) -> (Vec<f32>, Vec<bool>) {
    let object = render_depth(model, &camera(), &at()).pixels().to_vec();
    let table = |i: usize| 1.0 / (2.0 + 0.006 * (i / SIDE) as f32 - 0.001 * (i % SIDE) as f32);
    let pixels = object.iter().enumerate();
    let depth = pixels.map(|(i, z)| if *z > 0.0 { *z } else { table(i) });
    (depth.collect(), object.iter().map(|z| *z > 0.0).collect())
}

fn observe(depth: Vec<f32>, mask: Vec<bool>) -> Observation {
    let depth = DepthImage::from_meters(SIDE as u32, SIDE as u32, depth).unwrap();
    let mask = Mask::new(SIDE as u32, SIDE as u32, mask).unwrap();
    Observation::new(depth, mask, camera()).unwrap()
}

fn score(score: impl Score, observation: &Observation, pose: &Isometry3<f64>) -> f64 {
    score_of(&model(), score, observation, pose)
}

fn score_of(
    model: &Model,
    mut score: impl Score,
    observation: &Observation,
    pose: &Isometry3<f64>,
) -> f64 {
    let mut renders = RenderCache::new(RayCaster);
    let problem = Problem::new(model, observation);
    let found = score.score(&mut Context::new(problem, &mut renders), pose);
    assert!((0.0..=1.0).contains(&found), "{found}");
    found
}

/// Returns a mask whose pixels are set if any or all of the pixels around are.
fn grown(mask: &[bool], radius: isize, all: bool) -> Vec<bool> {
    let at = |i: usize, du: isize, dv: isize| {
        let u = (i % SIDE).saturating_add_signed(du).min(SIDE - 1);
        let v = (i / SIDE).saturating_add_signed(dv).min(SIDE - 1);
        mask[v * SIDE + u]
    };
    let square = |radius: isize| {
        (-radius..=radius).flat_map(move |v| (-radius..=radius).map(move |u| (u, v)))
    };
    let new = |i: usize| {
        let mut around = square(radius).map(|(du, dv)| at(i, du, dv));
        if all {
            around.all(|on| on)
        } else {
            around.any(|on| on)
        }
    };
    (0..mask.len()).map(new).collect()
}

fn boxed(mask: &[bool]) -> Vec<bool> {
    let set = || (0..mask.len()).filter(|i| mask[*i]);
    let range = |place: fn(usize) -> usize| {
        set().map(place).min().unwrap()..=set().map(place).max().unwrap()
    };
    let (columns, rows) = (range(|i| i % SIDE), range(|i| i / SIDE));
    let inside = |i: usize| columns.contains(&(i % SIDE)) && rows.contains(&(i / SIDE));
    (0..mask.len()).map(inside).collect()
}

#[test]
fn a_thin_part_is_not_mistaken_for_the_table_around_it() {
    let model = Model::new(cuboid(0.15, 0.01, 0.01));
    let (depth, mask) = scene_of(&model);
    let observation = observe(depth, boxed(&mask));
    let mut ranked = SampledMve::imperfect_mask();
    ranked.pixels = 40;
    let found = score_of(&model, ranked, &observation, &at());
    // Coarse pixels that the bar covers in part count against it. The others would have the depth
    // of the table if all of the mask were in their medians, and this would be 0.83.
    assert!(found < 0.65, "{found}");
}

#[test]
fn the_true_pose_is_recognized_with_any_mask() {
    let (depth, mask) = scene();
    let masks = [
        mask.clone(),
        grown(&mask, 4, false),
        grown(&mask, 8, false),
        grown(&mask, 4, true),
        boxed(&mask),
    ];
    let wrong = [
        pose(0.03, -0.002, 0.4, 0.4, 0.8, 0.2),
        pose(0.003, -0.002, 0.36, 0.4, 0.8, 0.2),
        pose(0.003, -0.002, 0.44, 0.4, 0.8, 0.2),
        pose(0.003, -0.002, 0.4, 0.4, 2.0, 0.9),
    ];
    for (index, mask) in masks.into_iter().enumerate() {
        let observation = observe(depth.clone(), mask);
        let truth = score(MeanVsd::imperfect_mask(), &observation, &at());
        assert!(truth < 0.06, "{index}: {truth}");
        let strict = score(MeanVsd::default(), &observation, &at());
        assert_eq!(strict > 0.2, index > 0, "{index}: {strict}");
        let ranked = score(SampledMve::imperfect_mask(), &observation, &at());
        for pose in &wrong {
            let found = score(MeanVsd::imperfect_mask(), &observation, pose);
            assert!(found > truth + 0.1, "{index} {found} {truth}");
            let found = score(SampledMve::imperfect_mask(), &observation, pose);
            assert!(found > ranked + 0.05, "{index} {found} {ranked}");
        }
    }
}

#[test]
fn a_hidden_part_is_no_evidence_but_a_part_in_the_table_is() {
    let (depth, mask) = scene();
    let bar = |i: usize| (44..54).contains(&(i % SIDE));
    let hidden = depth.iter().enumerate();
    let hidden = hidden.map(|(i, z)| if bar(i) { 0.2 } else { *z }).collect();
    let rest = mask.iter().enumerate().map(|(i, on)| *on && !bar(i));
    let observation = observe(hidden, rest.collect());
    let truth = score(MeanVsd::imperfect_mask(), &observation, &at());
    assert!(truth < 0.06, "{truth}");

    // The camera sees the table where the rest of the object should be.
    let without = depth.iter().enumerate();
    let without = without.map(|(i, z)| if bar(i) { z.max(0.48) } else { *z });
    let seen_through = observe(without.collect(), observation.mask().pixels().to_vec());
    let found = score(MeanVsd::imperfect_mask(), &seen_through, &at());
    assert!(found > 0.15, "{found}");

    // A surface that touches the object at the left and contains it at the right.
    let slope = |i: usize| 0.46 - 0.0022 * (i % SIDE) as f32;
    let left = |i: usize| mask[i] && i % SIDE < 44;
    let left: Vec<bool> = (0..mask.len()).map(left).collect();
    let object = render_depth(&model(), &camera(), &at()).pixels().to_vec();
    let with_step = |step: f32| {
        let nearer = |i: usize| object[i] - slope(i) > 0.016;
        let depth = |i: usize| if nearer(i) { slope(i) - step } else { slope(i) };
        let observation = observe((0..SIDE * SIDE).map(depth).collect(), left.clone());
        score(MeanVsd::imperfect_mask(), &observation, &at())
    };
    let (inside, hidden) = (with_step(0.0), with_step(0.1));
    assert!(inside > hidden + 0.05, "{inside} {hidden}");
}

/// Sensors measure nothing along edges, so only the mask shows that a smaller object is wrong.
#[test]
fn a_masked_part_without_depth_is_evidence_against_a_pose_that_leaves_it_out() {
    let (depth, mask) = scene();
    let core = grown(&mask, 5, true);
    let pixels = depth.iter().zip(&core).zip(grown(&mask, 3, false));
    let without_edges = pixels.map(|((z, core), near)| if near && !core { 0.0 } else { *z });
    let observation = observe(without_edges.collect(), mask);
    let small = Model::new(cuboid(0.06, 0.036, 0.095));
    let of_object = score(MeanVsd::imperfect_mask(), &observation, &at());
    let of_small = score_of(&small, MeanVsd::imperfect_mask(), &observation, &at());
    assert!(of_object < 0.06 && of_small > 0.3, "{of_object} {of_small}");
    let of_object = score(SampledMve::imperfect_mask(), &observation, &at());
    let of_small = score_of(&small, SampledMve::imperfect_mask(), &observation, &at());
    assert!(of_small > of_object + 0.1, "{of_object} {of_small}");
}

/// Some users cut a mask to the pixels with a depth. The object is then larger than the mask.
#[test]
fn pixels_without_depth_along_a_cut_mask_do_not_count() {
    let (depth, mask) = scene();
    let (core, near) = (grown(&mask, 4, true), grown(&mask, 3, false));
    let pixels = || depth.iter().zip(core.iter().zip(&near));
    let band = pixels().map(|(z, (core, near))| if *core || !near { *z } else { 0.0 });
    let band = observe(band.collect(), core.clone());
    // The background may also be too far away to be measured.
    let alone = pixels().map(|(z, (core, _))| if *core { *z } else { 0.0 });
    let alone = observe(alone.collect(), core.clone());
    let [of_band, of_alone] = [&band, &alone].map(|observation| {
        [
            score(MeanVsd::imperfect_mask(), observation, &at()),
            score(SampledMve::imperfect_mask(), observation, &at()),
        ]
    });
    assert!(of_band[0] < 0.01 && of_band[1] < 0.1, "{of_band:?}");
    assert!(of_alone.iter().all(|mve| *mve > 0.25), "{of_alone:?}");
}

#[test]
fn a_mask_without_depth_explains_nothing() {
    let (depth, mask) = scene();
    for (depth, mask) in [
        (vec![0.0; depth.len()], mask),
        (depth.clone(), vec![false; depth.len()]),
        (vec![0.0; depth.len()], vec![true; depth.len()]),
    ] {
        let observation = observe(depth, mask);
        assert_eq!(score(MeanVsd::imperfect_mask(), &observation, &at()), 1.0);
        assert_eq!(
            score(SampledMve::imperfect_mask(), &observation, &at()),
            1.0
        );
    }
}

#[test]
fn an_object_that_continues_outside_a_box_is_not_the_one_of_the_mask() {
    let (mut depth, mask) = scene();
    // It stands next to the object, and nearer.
    for (i, z) in depth.iter_mut().enumerate() {
        if !mask[i] && i % SIDE >= 56 && (20..50).contains(&(i / SIDE)) {
            *z = 0.3;
        }
    }
    let observation = observe(depth, grown(&boxed(&mask), 8, false));
    let truth = score(MeanVsd::imperfect_mask(), &observation, &at());
    assert!(truth < 0.06, "{truth}");
}

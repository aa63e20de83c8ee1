//! Tests of scores of rendered poses: the MVE against the image, and VSD against a true pose.

use crate::support::{Numbers, RayCaster, camera, cuboid, observe, pose, render_depth, wedge};
use hicp_core::{Context, DepthImage, Isometry3, Mask, Model, Observation, Problem, RenderCache};
use hicp_score::{
    MaskTrust, MeanVsd, N_TOLERANCES, Occlusion, SampledMve, Score, VISIBILITY_TOLERANCE_METERS,
    Vsd, tolerances, vsd,
};

pub(crate) fn at() -> Isometry3<f64> {
    pose(0.003, -0.002, 0.25, 0.4, -0.3, 0.2)
}

pub(crate) fn score(
    score: &mut dyn Score,
    model: &Model,
    observation: &Observation,
    pose: &Isometry3<f64>,
) -> f64 {
    let mut renders = RenderCache::new(RayCaster);
    score.score(
        &mut Context::new(Problem::new(model, observation), &mut renders),
        pose,
    )
}

fn mve(
    mut mean_vsd: MeanVsd,
    model: &Model,
    observation: &Observation,
    pose: &Isometry3<f64>,
) -> f64 {
    score(&mut mean_vsd, model, observation, pose)
}

const BOTH: [MeanVsd; 2] = [
    MeanVsd {
        occlusion: Occlusion::Counted,
        mask: MaskTrust::Exact,
    },
    MeanVsd {
        occlusion: Occlusion::Tolerated {
            meters: VISIBILITY_TOLERANCE_METERS,
        },
        mask: MaskTrust::Exact,
    },
];

fn with_depth(observation: &Observation, mut change: impl FnMut(usize, f32) -> f32) -> Observation {
    let depth = observation.depth();
    let pixels = depth
        .pixels()
        .iter()
        .enumerate()
        .map(|(i, z)| change(i, *z))
        .collect();
    let depth = DepthImage::from_meters(depth.width(), depth.height(), pixels).unwrap();
    Observation::new(depth, observation.mask().clone(), *observation.camera()).unwrap()
}

#[test]
fn a_perfect_pose_scores_zero_and_an_unseen_one_one() {
    assert_eq!(MeanVsd::paper(), BOTH[0]);
    assert_eq!(MeanVsd::default(), BOTH[1]);
    let model = Model::new(wedge());
    let observation = observe(&model, &camera(), &at());
    assert!(observation.n_measured() > 300);
    for mean_vsd in BOTH {
        assert_eq!(mve(mean_vsd, &model, &observation, &at()), 0.0);
        for unseen in [
            pose(0.0, 0.0, -0.25, 0.0, 0.0, 0.0),
            pose(3.0, 0.0, 0.25, 0.0, 0.0, 0.0),
            Isometry3::translation(f64::NAN, 0.0, 0.25),
        ] {
            assert_eq!(mve(mean_vsd, &model, &observation, &unseen), 1.0);
        }
    }
}

#[test]
fn pitfall_24_an_empty_mask_is_wrong_for_every_pose() {
    let model = Model::new(wedge());
    let empty = Mask::new(64, 48, vec![false; 64 * 48]).unwrap();
    let nothing = DepthImage::from_meters(64, 48, vec![0.0; 64 * 48]).unwrap();
    let seen = render_depth(&model, &camera(), &at());
    for depth in [nothing, seen] {
        let observation = Observation::new(depth, empty.clone(), camera()).unwrap();
        for mean_vsd in BOTH {
            assert_eq!(mve(mean_vsd, &model, &observation, &at()), 1.0);
            let behind = pose(0.0, 0.0, -1.0, 0.0, 0.0, 0.0);
            assert_eq!(mve(mean_vsd, &model, &observation, &behind), 1.0);
        }
    }
}

#[test]
fn pitfall_24_masked_pixels_without_depth_do_not_count() {
    let model = Model::new(wedge());
    let whole = observe(&model, &camera(), &at());
    let holes = with_depth(&whole, |i, z| if i % 3 == 0 { 0.0 } else { z });
    assert!(holes.n_measured() < whole.n_measured() && holes.mask() == whole.mask());
    for mean_vsd in BOTH {
        assert_eq!(mve(mean_vsd, &model, &holes, &at()), 0.0);
        // At all other pixels, it equals the definition over the measured depths.
        let off = pose(0.02, -0.002, 0.27, 0.4, -0.3, 0.2);
        assert_eq!(
            mve(mean_vsd, &model, &holes, &off),
            by_definition(mean_vsd, &model, &holes, &off)
        );
    }
}

/// Computes the MVE pixel by pixel, from whole images.
fn by_definition(
    mean_vsd: MeanVsd,
    model: &Model,
    observation: &Observation,
    pose: &Isometry3<f64>,
) -> f64 {
    let rendered = render_depth(model, observation.camera(), pose);
    let rendered = rendered.to_distance(observation.camera()).unwrap();
    let measured = observation
        .depth()
        .to_distance(observation.camera())
        .unwrap();
    let mut sum = 0.0;
    for tau in tolerances() {
        let (mut union, mut wrong) = (0.0, 0.0);
        for ((r, m), masked) in rendered
            .pixels()
            .iter()
            .zip(measured.pixels())
            .zip(observation.mask().pixels())
        {
            let hidden = match mean_vsd.occlusion {
                Occlusion::Tolerated { meters } => r - m > meters,
                Occlusion::Lenient { meters } => r - m > -meters,
                _ => false,
            };
            let in_measured = *masked && *m > 0.0;
            let in_rendered = *r > 0.0
                && if *masked {
                    *m > 0.0
                } else {
                    !(*m > 0.0 && hidden)
                };
            if in_measured || in_rendered {
                union += 1.0;
                let right = in_measured && in_rendered && (r - m).abs() / model.diameter() < tau;
                wrong += if right { 0.0 } else { 1.0 };
            }
        }
        sum += if union == 0.0 { 1.0 } else { wrong / union };
    }
    sum / 10.0
}

#[test]
fn the_mve_equals_its_definition_at_every_pose() {
    let model = Model::new(wedge());
    let observation = observe(&model, &camera(), &at());
    // A pole in front of the left half, and a wall behind everything else.
    let scene = with_depth(&observation, |i, z| match i % 64 {
        20..=27 => 0.18,
        _ if z == 0.0 => 0.6,
        _ => z,
    });
    let mask =
        (0..64 * 48).map(|i| observation.mask().pixels()[i] && !(20..=27).contains(&(i % 64)));
    let mask = Mask::new(64, 48, mask.collect()).unwrap();
    let scene = Observation::new(scene.shared_depth().clone(), mask, camera()).unwrap();
    let mut numbers = Numbers(301);
    let mut between = 0;
    for _ in 0..40 {
        let nudge = Isometry3::new(numbers.vector() * 0.01, numbers.vector() * 0.2);
        let here = at() * nudge;
        for mean_vsd in [BOTH[0], BOTH[1], MeanVsd::lenient()] {
            for observation in [&observation, &scene] {
                let found = mve(mean_vsd, &model, observation, &here);
                let expected = by_definition(mean_vsd, &model, observation, &here);
                // Ten quotients of the same counts, added in the same order.
                assert!((found - expected).abs() < 1e-14, "{found} {expected}");
                between += usize::from(found > 0.05 && found < 0.95);
            }
        }
    }
    assert!(between > 80, "{between}");
}

#[test]
fn occluders_are_tolerated_on_request() {
    let model = Model::new(wedge());
    let whole = observe(&model, &camera(), &at());
    let occluded = |by: f32| {
        let scene = with_depth(
            &whole,
            |i, z| if i % 64 < 30 && z > 0.0 { z - by } else { z },
        );
        let mask = (0..64 * 48)
            .map(|i| whole.mask().pixels()[i] && i % 64 >= 30)
            .collect();
        Observation::new(
            scene.shared_depth().clone(),
            Mask::new(64, 48, mask).unwrap(),
            camera(),
        )
        .unwrap()
    };
    let (near, touching) = (occluded(0.05), occluded(0.01));
    let hidden = whole.n_measured() - near.n_measured();
    let share = hidden as f64 / whole.n_measured() as f64;
    assert!(share > 0.2);
    assert_eq!(mve(MeanVsd::default(), &model, &near, &at()), 0.0);
    // The paper's definition counts every rendered pixel outside the mask. So does an occluder
    // within the tolerance.
    assert!((mve(MeanVsd::paper(), &model, &near, &at()) - share).abs() < 1e-14);
    assert!((mve(MeanVsd::default(), &model, &touching, &at()) - share).abs() < 1e-14);
}

/// The left part of the object is missing from the mask, but not from the image.
#[test]
fn parts_missing_from_the_mask_are_tolerated_on_request() {
    let model = Model::new(wedge());
    let whole = observe(&model, &camera(), &at());
    let mask = (0..64 * 48).map(|i| whole.mask().pixels()[i] && i % 64 >= 30);
    let mask = Mask::new(64, 48, mask.collect()).unwrap();
    let seen = |behind: f32| {
        let scene = with_depth(&whole, |i, z| match i % 64 {
            0..30 if z > 0.0 => z + behind,
            _ => z,
        });
        Observation::new(scene.depth().clone(), mask.clone(), camera()).unwrap()
    };
    let count = |mask: &Mask| mask.n_set() as f64;
    let missing = 1.0 - count(&mask) / count(whole.mask());
    assert!(missing > 0.1);
    let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
    for mean_vsd in BOTH {
        assert!(near(mve(mean_vsd, &model, &seen(0.0), &at()), missing));
    }
    let lenient = |observation: &Observation| mve(MeanVsd::lenient(), &model, observation, &at());
    assert_eq!(lenient(&seen(0.0)), 0.0);
    assert_eq!(lenient(&seen(0.01)), 0.0);
    // The camera sees through the object, or has measured nothing.
    assert!(near(lenient(&seen(0.03)), missing));
    let holes = with_depth(&seen(0.0), |i, z| if i % 64 < 30 { 0.0 } else { z });
    assert!(near(lenient(&holes), missing));

    // The estimate from samples agrees within the limits of its pixels along the silhouette.
    let sampled = |mut sampled: SampledMve, observation: &Observation| {
        (sampled.samples, sampled.pixels) = (3000, 1000);
        score(&mut sampled, &model, observation, &at())
    };
    let (strict, forgiving) = (SampledMve::default, SampledMve::lenient);
    assert!(sampled(strict(), &seen(0.0)) > sampled(forgiving(), &seen(0.0)) + 0.5 * missing);
    assert!(near(
        sampled(strict(), &seen(0.03)),
        sampled(forgiving(), &seen(0.03))
    ));
}

#[test]
fn vsd_of_poses_equals_vsd_of_their_images() {
    let mut numbers = Numbers(302);
    for mesh in [wedge(), cuboid(0.09, 0.06, 0.05)] {
        let model = Model::new(mesh);
        // The observation only provides its camera.
        let observation = observe(&model, &camera(), &pose(0.1, 0.1, 0.5, 0.0, 0.0, 0.0));
        let mut renders = RenderCache::new(RayCaster);
        let mut context = Context::new(Problem::new(&model, &observation), &mut renders);
        let mut score = Vsd::new(at());
        assert_eq!(score.truth(), &at());
        let silhouette = |pose: &Isometry3<f64>| {
            let depth = render_depth(&model, &camera(), pose);
            let mask = Mask::measured(&depth);
            (depth.to_distance(&camera()).unwrap(), mask)
        };
        let (truth, truth_mask) = silhouette(&at());
        for _ in 0..20 {
            let here = at() * Isometry3::new(numbers.vector() * 0.01, numbers.vector() * 0.2);
            let (estimate, mask) = silhouette(&here);
            let expected = vsd(&estimate, &mask, &truth, &truth_mask, model.diameter()).unwrap();
            let found = score.errors(&mut context, &here);
            for (found, expected) in found.iter().zip(expected) {
                // (zₑ − zₜ) k and zₑ k − zₜ k may differ in the last digit and so decide one tie in
                // a pixel.
                assert!((found - expected).abs() < 1e-14, "{found} {expected}");
            }
            assert!(
                (score.score(&mut context, &here) - expected.iter().sum::<f64>() / 10.0).abs()
                    < 1e-14
            );
        }
        assert_eq!(score.errors(&mut context, &at()), [0.0; N_TOLERANCES]);
        let behind = pose(0.0, 0.0, -1.0, 0.0, 0.0, 0.0);
        assert_eq!(score.score(&mut context, &behind), 1.0);
        assert_eq!(Vsd::new(behind).score(&mut context, &behind), 1.0);
        assert_eq!(Vsd::new(behind).score(&mut context, &at()), 1.0);
    }
}

#[test]
fn a_score_renders_a_pose_once_also_if_boxed() {
    let model = Model::new(wedge());
    let observation = observe(&model, &camera(), &at());
    let here = pose(0.01, 0.0, 0.26, 0.4, -0.3, 0.2);
    let mut renders = RenderCache::new(RayCaster);
    let mut scores: [Box<dyn Score>; 2] = [Box::new(MeanVsd::default()), Box::new(Vsd::new(at()))];
    let boxed = scores.each_mut().map(|s| {
        s.score(
            &mut Context::new(Problem::new(&model, &observation), &mut renders),
            &here,
        )
    });
    assert_eq!(
        renders.renders(),
        2,
        "one of the pose, shared, and one of the truth"
    );
    let expected = [
        mve(MeanVsd::default(), &model, &observation, &here),
        score(&mut Vsd::new(at()), &model, &observation, &here),
    ];
    assert_eq!(boxed.map(f64::to_bits), expected.map(f64::to_bits));
    assert_eq!(scores.map(|s| Score::name(&s)), ["mve", "vsd"]);
}

#[test]
fn scores_report_their_names() {
    let truth = Vsd::new(at()).name();
    assert_eq!((MeanVsd::default().name(), truth), ("mve", "vsd"));
    // A score without a name is called after its type, also if boxed.
    struct Fair;
    impl Score for Fair {
        fn score(&mut self, _: &mut Context<'_>, _: &Isometry3<f64>) -> f64 {
            0.5
        }
    }
    assert_eq!(Fair.name(), "Fair");
    assert_eq!((Box::new(Fair) as Box<dyn Score>).name(), "Fair");
}

//! Invalid and impossible numbers.
//!
//! A constructor refuses them, or the outcome is truthful. A result is never NaN.

use hicp_sim::{Household, RelativeGaussian, Solid, rng};
use hicp_tests::OBJECTS;
use hicp_tests::starts::starts;
use hybrid_icp::checks::{ACCEPTED, warning_of_diameter, warnings, warnings_of_result};
use hybrid_icp::core::internal::pose_bits;
use hybrid_icp::core::{
    DepthImage, Isometry3, Mask, Model, ModelConfig, Observation, PinholeCamera, Point3, TriMesh,
    Vector3, se3,
};
use hybrid_icp::icp::{Termination, Verdict};
use hybrid_icp::raster::render_depth_image;
use hybrid_icp::score::Flatness;
use hybrid_icp::switch::PAPER_ALPHA;
use hybrid_icp::{Preset, Refinement, Refiner, Warning};

pub(crate) fn camera() -> PinholeCamera {
    PinholeCamera::new(300.0, 300.0, 79.5, 59.5, 160, 120).unwrap()
}

pub(crate) fn cuboid(sides: [f32; 3]) -> TriMesh {
    let sides = Vector3::from(sides).cast();
    Solid::cuboid(sides, 1).to_mesh().unwrap()
}

struct Scene {
    model: Model,
    truth: Isometry3<f64>,
    depth: DepthImage,
    mask: Mask,
}

fn scene() -> Scene {
    let mesh = cuboid([0.1, 0.06, 0.04]);
    let truth = Isometry3::new([0.01, -0.005, 0.4].into(), [0.6, -0.4, 0.3].into());
    let depth = render_depth_image(&mesh, &camera(), &truth);
    Scene {
        model: Model::new(mesh),
        truth,
        mask: Mask::measured(&depth),
        depth,
    }
}

impl Scene {
    fn observe(&self, depth: DepthImage) -> Observation {
        Observation::new(depth, self.mask.clone(), camera()).unwrap()
    }

    /// Returns the depth image with every pixel changed.
    fn changed(&self, change: impl Fn(f32) -> f32) -> DepthImage {
        let pixels = self.depth.pixels().iter().map(|z| change(*z)).collect();
        DepthImage::from_meters(160, 120, pixels).unwrap()
    }
}

/// Refines with every preset and checks the properties of any outcome.
#[track_caller]
pub(crate) fn refine_all(
    model: &Model,
    observation: &Observation,
    init: &Isometry3<f64>,
) -> [Refinement; Preset::ALL.len()] {
    Preset::ALL.map(|preset| {
        let refined = Refiner::preset(preset).refine(model, observation, init);
        let (pose, verdict) = (refined.outcome.camera_from_object, refined.outcome.verdict);
        if matches!(verdict, Verdict::KeptInitial(_)) {
            assert_eq!(pose_bits(&pose), pose_bits(init), "{preset}: {refined:?}");
        }
        if se3::is_finite(init) {
            assert!(se3::is_finite(&pose), "{preset}: {refined:?}");
            assert!(
                (pose.rotation.norm() - 1.0).abs() < 1e-9,
                "{preset}: {pose}"
            );
        } else {
            assert_eq!(
                verdict,
                Verdict::KeptInitial(Termination::NoPairs),
                "{preset}"
            );
            assert_eq!(refined.mve, 1.0, "{preset}");
        }
        for mve in [refined.mve, refined.mve_initial] {
            assert!((0.0..=1.0).contains(&mve), "{preset}: {refined:?}");
        }
        refined
    })
}

#[test]
fn invalid_depths_count_as_missing_and_the_rest_is_refined() {
    let scene = scene();
    let init = scene.truth * Isometry3::translation(0.003, 0.0, 0.0);
    let plain = Refiner::preset(Preset::Hybrid).refine(
        &scene.model,
        &scene.observe(scene.depth.clone()),
        &init,
    );
    assert_eq!(plain.outcome.verdict, Verdict::Refined);
    // Values that sensors write without a measurement: not a number, infinite, negative, denormal,
    // or absurdly far.
    for nothing in [
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        -0.4,
        -0.0,
        1e-40,
        1e30,
    ] {
        let mut number = 0;
        let pixels: Vec<f32> = scene
            .depth
            .pixels()
            .iter()
            .map(|z| {
                number += 1;
                if *z == 0.0 || number % 7 == 0 {
                    nothing
                } else {
                    *z
                }
            })
            .collect();
        let observation = scene.observe(DepthImage::from_meters(160, 120, pixels).unwrap());
        assert!(
            observation
                .depth()
                .pixels()
                .iter()
                .all(|z| *z == 0.0 || *z > 0.3),
            "{nothing}"
        );
        let [refined, ..] = refine_all(&scene.model, &observation, &init);
        assert_eq!(refined.outcome.verdict, Verdict::Refined, "{nothing}");
        let off = (refined.outcome.camera_from_object.translation.vector
            - scene.truth.translation.vector)
            .norm();
        assert!(off < 0.002, "{nothing}: {off} m");
    }
}

#[test]
fn depth_in_another_unit_causes_a_warning() {
    let scene = scene();
    assert_eq!(
        warnings(
            &scene.model,
            &scene.observe(scene.depth.clone()),
            &scene.truth
        ),
        []
    );
    for (factor, expected) in [(0.1, 0.04), (10.0, 4.0), (0.001, 0.0004)] {
        let observation = scene.observe(scene.changed(|z| z * factor));
        let found = warnings(&scene.model, &observation, &scene.truth);
        let [Warning::Depth { measured, .. }] = found[..] else {
            panic!("factor {factor}: expected a depth warning, found {found:?}");
        };
        assert!((measured / expected - 1.0).abs() < 0.2, "{measured}");
        refine_all(&scene.model, &observation, &scene.truth);
    }
    let nothing = scene.observe(scene.changed(|z| z * 1000.0 * 1000.0));
    assert_eq!(
        warnings(&scene.model, &nothing, &scene.truth),
        [Warning::NoDepth]
    );
}

#[test]
fn models_in_another_unit_or_far_from_their_origin_cause_a_warning() {
    let scene = scene();
    let observation = scene.observe(scene.depth.clone());
    for (scale, expected) in [
        (1000.0, "diameter is 123."),
        (0.001, "diameter is 1.233e-4 m"),
    ] {
        let model = Model::new(cuboid([0.1 * scale, 0.06 * scale, 0.04 * scale]));
        let found = warnings(&model, &observation, &scene.truth);
        assert!(found[0].to_string().contains(expected), "{found:?}");
        refine_all(&model, &observation, &scene.truth);
    }
    let mesh = cuboid([0.1, 0.06, 0.04]);
    let vertices = mesh
        .vertices()
        .iter()
        .map(|p| Point3::new(p.x + 4096.0, p.y, p.z))
        .collect();
    let model = Model::new(TriMesh::new(vertices, mesh.triangles().to_vec()).unwrap());
    let init = scene.truth * Isometry3::translation(-4096.0, 0.0, 0.0);
    let found = warnings(&model, &observation, &init);
    assert!(
        matches!(found[..], [Warning::CoarseCoordinates { step, .. }] if step > 4e-4),
        "{found:?}"
    );
}

/// A model in the wrong unit can have a plausible size, but not a plausible mask.
///
/// Objects that are thin and seen end-on, mostly occluded, or partly outside of the image also have
/// few pixels. They cause no warning.
#[test]
fn models_far_too_large_for_their_mask_cause_a_warning() {
    let scene = scene();
    let warn = |sides: [f32; 3], mask: &dyn Fn(usize, usize) -> bool, pose: &Isometry3<f64>| {
        let pixels = (0..160 * 120).map(|i| mask(i % 160, i / 160)).collect();
        let mask = Mask::new(160, 120, pixels).unwrap();
        let depth = DepthImage::from_meters(160, 120, vec![0.4; 160 * 120]).unwrap();
        let observation = Observation::new(depth, mask, camera()).unwrap();
        // A far vertex that no triangle uses is not part of the object.
        let mesh = cuboid(sides);
        let mut vertices = mesh.vertices().to_vec();
        vertices.push(Point3::new(90.0, 80.0, 70.0));
        let mesh = TriMesh::new(vertices, mesh.triangles().to_vec()).unwrap();
        warnings(&Model::new(mesh), &observation, pose)
    };
    let seen = |u: usize, v: usize| scene.mask.pixels()[v * 160 + u];
    let found = warn([1.0, 0.6, 0.4], &seen, &scene.truth);
    assert!(matches!(found[..], [Warning::Sliver { .. }]), "{found:?}");
    assert_eq!(warn([0.1, 0.06, 0.04], &seen, &scene.truth), []);
    let ahead = Isometry3::translation(0.0, 0.0, 0.4);
    let square = |from: usize, to: usize| {
        move |u: usize, v: usize| (from..to).contains(&u) && (from..to).contains(&v)
    };
    // A pen of 150 × 8 × 8 mm covers 6 × 6 pixels if seen along its length.
    assert_eq!(warn([0.008, 0.008, 0.15], &square(57, 63), &ahead), []);
    // Its side of 60 × 40 mm has 1,350 pixels. With 81 visible pixels there is no warning.
    assert_eq!(warn([0.1, 0.06, 0.04], &square(51, 60), &ahead), []);
    let found = warn([0.1, 0.06, 0.04], &square(51, 59), &ahead);
    assert!(
        matches!(found[..], [Warning::Sliver { pixels: 64, at_least, .. }] if (at_least - 1350.0).abs() < 1e-3),
        "{found:?}"
    );
    assert_eq!(warn([0.1, 0.06, 0.04], &square(0, 8), &ahead), []);
    assert_eq!(warn([0.6, 0.6, 0.0], &square(51, 59), &ahead), []);
}

/// A stated diameter may belong to another version of the mesh, but not to another object.
///
/// Vertices that no triangle uses do not count.
#[test]
fn a_stated_diameter_that_differs_from_the_mesh_causes_a_warning() {
    let mesh = cuboid([0.1, 0.06, 0.04]);
    let own = Model::new(mesh.clone()).diameter();
    let mut vertices = mesh.vertices().to_vec();
    vertices.push(Point3::new(5.0, 0.0, 0.0));
    let stray = TriMesh::new(vertices, mesh.triangles().to_vec()).unwrap();
    for mesh in [mesh, stray] {
        let warning_of = |factor: f64| {
            let diameter = Some(factor * own);
            let config = ModelConfig {
                diameter,
                ..ModelConfig::default()
            };
            warning_of_diameter(&Model::with_config(mesh.clone(), config))
        };
        for near in [0.951, 1.0, 1.049] {
            assert_eq!(warning_of(near), None);
        }
        for far in [0.001, 0.949, 1.051, 1000.0] {
            let expected = Warning::StatedDiameter {
                stated: far * own,
                measured: own,
            };
            assert_eq!(warning_of(far), Some(expected));
        }
    }
}

/// Checks the scores above which a result causes a warning.
#[test]
fn results_with_bad_scores_cause_a_warning() {
    let (half, nearly, doubtful) = (0.5, 0.4_f64.next_down(), 0.5_f64.next_down());
    assert_eq!(warnings_of_result(half, nearly, half, None), []);
    // A good pose in an imperfect mask has a high MVE.
    assert_eq!(warnings_of_result(half, 0.4, ACCEPTED, None), []);
    assert_eq!(
        warnings_of_result(half, 0.4, ACCEPTED.next_down(), None),
        [Warning::Unexplained { mve: 0.4 }]
    );
    let found = warnings_of_result(half, nearly, doubtful, None);
    assert_eq!(
        found,
        [Warning::Doubtful {
            confidence: doubtful
        }]
    );
    assert_eq!(
        found[0].to_string(),
        "confidence 0.50: the pose is more likely wrong than right"
    );
    let below = 0.9_f64.next_down();
    assert_eq!(warnings_of_result(below, nearly, half, None), []);
    assert_eq!(warnings_of_result(0.9, nearly, ACCEPTED, None), []);
    let found = warnings_of_result(0.9, nearly, ACCEPTED.next_down(), None);
    assert!(
        matches!(found[..], [Warning::FoundElsewhere { mve_initial: 0.9, mve }] if mve == nearly),
        "{found:?}"
    );
    // A pose that does not explain the image causes one warning only.
    assert_eq!(
        warnings_of_result(1.0, 0.4, 0.0, None),
        [Warning::Unexplained { mve: 0.4 }]
    );
    assert_eq!(warnings_of_result(0.2, 0.2, 1.0, None), []);
    let flatness = Flatness::new(0.01, 0.002, 0.0123, 0.2);
    assert_eq!(warnings_of_result(half, 0.4, 0.0, Some(flatness)).len(), 1);
    // No depth image is as flat as rounding allows, so the message states at least 1 mm.
    let exact = Flatness::new(0.01, 1e-16, 0.0123, 0.2);
    let found = warnings_of_result(half, nearly, half, Some(exact));
    assert!(found[0].to_string().contains("flat to 0.0010 m"));
    let found = warnings_of_result(half, nearly, half, Some(flatness));
    assert_eq!(found, [Warning::Flat { flatness }]);
    assert_eq!(
        found[0].to_string(),
        "the mask may show a wall or a table: the measured surface is flat to 0.0020 m, but the model's surface there only to 0.0123 m, and they \
         are 0.0100 m apart"
    );
    let found = warnings_of_result(0.2, 0.3, half, None);
    assert_eq!(
        found[0].to_string(),
        "the returned pose explains the image worse than the initial one (MVE 0.300, was 0.200)"
    );
    assert!(
        matches!(
            warnings_of_result(0.95, 0.97, 0.0, None)[..],
            [Warning::Worse { .. }, Warning::Unexplained { .. }]
        ),
        "expected both warnings"
    );
}

/// An ambiguous pose with a lower score is not described as if it were a worse one.
#[test]
fn the_warning_of_ambiguity_states_which_score_is_lower() {
    let message = |gap| {
        let rotation_degrees = 180.0;
        let warning = Warning::Ambiguous {
            gap,
            rotation_degrees,
        };
        warning.to_string()
    };
    let usual = "ambiguous: 2 poses within 0.01, 180° apart";
    assert_eq!(message(0.004), usual);
    assert_eq!(
        message(-0.004),
        format!("{usual}, and the other has the lower score")
    );
}

/// Objects without a flat side, found on a wall, cause a warning.
///
/// An object with a flat side may fit a wall as well as its true place.
#[test]
fn an_object_found_on_a_wall_causes_a_warning() {
    const ROUND: [Household; 3] = [Household::Mug, Household::Bottle, Household::Bowl];
    let mut refiner = Refiner::preset(Preset::Auto);
    let mut explained = 0;
    for (index, start) in starts(2, 0.3).iter().enumerate() {
        let (scene, observation) = (&start.scene, &start.scene.observation);
        let refined = refiner.refine(&scene.model, observation, &start.init);
        let flat = |warning: &Warning| matches!(warning, Warning::Flat { .. });
        assert!(!refined.warnings().iter().any(flat), "{refined:?}");
        if !ROUND.contains(&OBJECTS[index / 2]) {
            continue;
        }
        // The wall replaces the object, nearer than its center by a fifth of its diameter.
        let center = scene.truth * scene.model.center();
        let z = center.z - 0.2 * scene.model.diameter();
        let (width, height) = (observation.depth().width(), observation.depth().height());
        let wall = vec![z as f32; observation.depth().pixels().len()];
        let wall = DepthImage::from_meters(width, height, wall).unwrap();
        let wall = RelativeGaussian { percent: 0.3 }.apply(&mut rng(3), &wall);
        let camera = *observation.camera();
        let observation = Observation::new(wall, observation.mask().clone(), camera).unwrap();
        let refined = refiner.refine(&scene.model, &observation, &start.init);
        let found = refined.warnings();
        assert!(!found.is_empty(), "{refined:?}");
        assert!(refined.confidence < 0.5, "{refined:?}");
        // The score alone does not reveal some of the walls.
        if refined.mve < PAPER_ALPHA {
            explained += 1;
            assert!(found.iter().any(flat), "{found:?}");
        }
    }
    assert!(explained > 1, "{explained}");
}

#[test]
fn poses_very_far_away_or_not_finite_end_truthfully() {
    let scene = scene();
    let observation = scene.observe(scene.depth.clone());
    for direction in 0..3 {
        for length in [
            1e6,
            -1e6,
            1e12,
            -1e300,
            f64::MIN_POSITIVE,
            f64::NAN,
            f64::INFINITY,
        ] {
            let mut init = scene.truth;
            init.translation.vector[direction] += length;
            refine_all(&scene.model, &observation, &init);
            let z = (init * scene.model.center()).z;
            let behind = warnings(&scene.model, &observation, &init);
            let behind = behind
                .iter()
                .any(|warning| matches!(warning, Warning::BehindCamera { .. }));
            let valid = init.translation.vector.iter().all(|x| x.is_finite());
            assert_eq!(behind, !valid || z <= 0.0, "{length}");
        }
    }
}

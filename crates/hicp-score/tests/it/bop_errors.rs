//! Tests of MSSD, MSPD and VSD as BOP evaluates them.
//!
//! They cover the golden case of its reference code, the definitions, and invariances.

use std::f64::consts::{PI, TAU};

use crate::pose_error::{corners, golden_poses, rotation};
use crate::support::{Numbers, RayCaster, camera, cuboid, pose, render_depth, wedge};
use hicp_core::{
    DepthImage, Isometry3, Model, ModelConfig, PinholeCamera, Point3, RenderedView, Renderer,
    Symmetries, SymmetryAxis, TriMesh, Vector3,
};
use hicp_score::{
    ModelPoints, ScoreError, VISIBILITY_TOLERANCE_METERS, add, adi, bop_vsd, mspd, mssd,
    spheres_overlap, visibility_masks, vsd,
};

fn half_turn() -> Isometry3<f64> {
    Isometry3::from_parts(Vector3::zeros().into(), rotation(Vector3::z(), PI))
}

#[test]
fn the_golden_case() {
    let corners = corners();
    let [truth, estimate] = golden_poses();
    let camera = PinholeCamera::new(572.4114, 573.57043, 325.2611, 242.04899, 640, 480).unwrap();
    let found = mssd(&estimate, &truth, &corners, &[]);
    assert!((found - 15.251_303_772_020_26).abs() < 1e-11, "{found}");
    let found = mspd(&estimate, &truth, &corners, &[], &camera);
    assert!((found - 10.022_087_027_643_682).abs() < 1e-10, "{found}");

    // A half turn maps the box onto itself.
    let flipped = truth * half_turn();
    let found = mssd(&flipped, &truth, &corners, &[]);
    assert!((found - 72.111_025_509_279_78).abs() < 1e-11, "{found}");
    assert!(mssd(&flipped, &truth, &corners, &[half_turn()]) < 2e-14);
    assert!(mspd(&flipped, &truth, &corners, &[half_turn()], &camera) < 1e-12);
}

/// Returns two poses in front of the camera, near each other.
fn two_poses(numbers: &mut Numbers) -> (Isometry3<f64>, Isometry3<f64>) {
    let forward = Isometry3::translation(0.0, 0.0, 0.6);
    (forward * numbers.pose(0.02), forward * numbers.pose(0.02))
}

fn random_points(numbers: &mut Numbers, n: usize) -> Vec<Point3<f32>> {
    (0..n)
        .map(|_| Point3::from((numbers.vector() * 0.03).cast()))
        .collect()
}

fn random_symmetries(numbers: &mut Numbers) -> Vec<Isometry3<f64>> {
    (0..5).map(|_| numbers.pose(0.005)).collect()
}

#[test]
fn each_error_equals_its_definition() {
    let mut numbers = Numbers(811);
    let camera = camera();
    for _ in 0..100 {
        let points = random_points(&mut numbers, 30);
        let (a, b) = two_poses(&mut numbers);
        let mut symmetries = vec![Isometry3::identity()];
        symmetries.extend(random_symmetries(&mut numbers));
        let by_definition = |distance: &dyn Fn(Point3<f64>, Point3<f64>) -> f64| {
            let of_symmetry = |s: &Isometry3<f64>| {
                let distances = points.iter().map(|x| {
                    let x = x.cast::<f64>();
                    distance(a * x, b * (s * x))
                });
                distances.fold(0.0, f64::max)
            };
            let all = symmetries.iter().map(of_symmetry);
            all.fold(f64::INFINITY, f64::min)
        };
        let expected = by_definition(&|p, q| (p - q).norm());
        assert!((mssd(&a, &b, &points, &symmetries) - expected).abs() < 1e-14);
        let expected = by_definition(&|p, q| {
            (camera.project(&p).unwrap() - camera.project(&q).unwrap()).norm()
        });
        let found = mspd(&a, &b, &points, &symmetries, &camera);
        assert!((found - expected).abs() < 1e-10, "{found} {expected}");
    }
}

#[test]
fn symmetries_never_raise_an_error_and_mssd_is_not_below_add() {
    let mut numbers = Numbers(812);
    for _ in 0..100 {
        let points = random_points(&mut numbers, 30);
        let (a, b) = two_poses(&mut numbers);
        let symmetries = random_symmetries(&mut numbers);
        let errors = |count: usize| {
            let some = &symmetries[..count];
            (
                mssd(&a, &b, &points, some),
                mspd(&a, &b, &points, some, &camera()),
            )
        };
        assert!(errors(0).0 >= add(&a, &b, &points));
        for count in 0..5 {
            assert!(errors(count + 1).0 <= errors(count).0);
            assert!(errors(count + 1).1 <= errors(count).1);
        }
        let common = numbers.pose(1.0);
        let moved = mssd(&(common * a), &(common * b), &points, &symmetries);
        assert!((moved - errors(5).0).abs() < 1e-14);
    }
}

fn symmetric_model() -> Model {
    let symmetries = Symmetries {
        discrete: vec![half_turn()],
        continuous: Vec::new(),
    };
    let config = ModelConfig {
        symmetries,
        ..ModelConfig::default()
    };
    Model::with_config(cuboid(0.03, 0.05, 0.08), config)
}

#[test]
fn a_symmetric_equivalent_has_no_mssd_mspd_and_adi() {
    let points = ModelPoints::new(&symmetric_model());
    assert_eq!(points.points(), symmetric_model().mesh().vertices());
    assert!(points.is_symmetric() && points.symmetries().len() == 2);
    let truth = pose(0.01, -0.02, 0.5, 0.4, -0.3, 0.2);
    let flipped = truth * half_turn();
    assert!(points.mssd(&flipped, &truth) < 1e-15);
    assert!(points.mspd(&flipped, &truth, &camera()) < 1e-12);
    assert!(points.adi(&flipped, &truth) < 1e-15);
    assert!(points.add(&flipped, &truth) > 0.02);
}

#[test]
fn a_model_without_symmetries_has_the_errors_of_its_points() {
    let model = Model::new(wedge());
    let points = ModelPoints::new(&model);
    assert!(!points.is_symmetric());
    assert_eq!(points.symmetries(), [Isometry3::identity()]);
    assert_eq!(points.diameter(), model.diameter());
    let mut numbers = Numbers(814);
    for _ in 0..10 {
        let (a, b) = two_poses(&mut numbers);
        assert_eq!(points.add(&a, &b), add(&a, &b, points.points()));
        assert_eq!(points.adi(&a, &b), adi(&a, &b, points.points()));
        assert!(points.adi(&a, &b) > 1e-3);
    }
}

#[test]
fn a_continuous_symmetry_has_315_steps() {
    // A prism of 63 corners around a displaced axis: 63 divides 315.
    let axis = SymmetryAxis::new(Vector3::z(), Point3::new(0.01, -0.02, 0.0)).unwrap();
    let vertices: Vec<Point3<f32>> = (0..126_u8)
        .map(|i| {
            let turn = axis.rotation(TAU * f64::from(i % 63) / 63.0);
            let z = if i < 63 { 0.0 } else { 0.1 };
            (turn * Point3::new(0.04, -0.02, z)).cast()
        })
        .collect();
    let triangles = (0..124).map(|i| [i, i + 1, i + 2]).collect();
    let config = ModelConfig {
        symmetries: Symmetries {
            discrete: Vec::new(),
            continuous: vec![axis],
        },
        ..ModelConfig::default()
    };
    let model = Model::with_config(TriMesh::new(vertices, triangles).unwrap(), config);
    let points = ModelPoints::new(&model);
    assert_eq!(points.symmetries().len(), 315);
    let truth = pose(0.01, -0.02, 0.5, 0.4, -0.3, 0.2);
    let turned = |angle: f64| truth * axis.rotation(angle);
    // f32 vertices rotate exactly up to 1e-9 m.
    assert!(points.mssd(&turned(TAU * 44.0 / 315.0), &truth) < 1e-12);
    assert!(points.mspd(&turned(TAU * 44.0 / 315.0), &truth, &camera()) < 1e-9);
    // Half a step: 2 r sin(π / 630).
    let half_step = points.mssd(&turned(TAU * 44.5 / 315.0), &truth);
    assert!(
        (half_step - 2.0 * 0.03 * (PI / 630.0).sin()).abs() < 1e-8,
        "{half_step}"
    );
}

#[test]
fn points_behind_the_camera_have_an_infinite_mspd() {
    let points = ModelPoints::new(&symmetric_model());
    let (front, behind) = (
        Isometry3::translation(0.0, 0.0, 0.5),
        Isometry3::translation(0.0, 0.0, -0.5),
    );
    for (a, b) in [(front, behind), (behind, front)] {
        assert_eq!(points.mspd(&a, &b, &camera()), f64::INFINITY);
        assert!((points.mssd(&a, &b) - 1.0).abs() < 1e-12);
        assert!(!spheres_overlap(&a, &b, points.diameter()));
    }
    let nowhere = Isometry3::translation(0.0, f64::NAN, 0.5);
    assert_eq!(points.mssd(&nowhere, &front), f64::INFINITY);
    assert_eq!(points.mspd(&nowhere, &front, &camera()), f64::INFINITY);
    assert!(!spheres_overlap(&nowhere, &front, 1.0));
}

#[test]
fn spheres_overlap_by_their_projections() {
    let at = |x: f64, z: f64| Isometry3::translation(x, 0.0, z);
    assert!(spheres_overlap(&at(0.0, 1.0), &at(0.099, 1.0), 0.1));
    assert!(!spheres_overlap(&at(0.0, 1.0), &at(0.101, 1.0), 0.1));
    // One behind the other covers it at any distance.
    assert!(spheres_overlap(&at(0.1, 1.0), &at(0.2, 2.0), 0.1));
    // In units of the focal length, the radii are 0.05 / 0.5 and 0.05 / 2, which is 0.125 from
    // center to center.
    for (x, expected) in [(0.12, true), (0.13, false)] {
        let near = spheres_overlap(&at(0.5 * x, 0.5), &at(0.0, 2.0), 0.1);
        let far = spheres_overlap(&at(0.0, 0.5), &at(2.0 * x, 2.0), 0.1);
        assert_eq!((near, far), (expected, expected), "{x}");
    }
    // Touching spheres do not overlap.
    assert!(!spheres_overlap(&at(0.0, 1.0), &at(0.25, 1.0), 0.25));
    // Behind the camera there is no image, wherever the other one is.
    assert!(!spheres_overlap(&at(0.0, 0.5), &at(0.0, -1.0), 0.1));
    assert!(!spheres_overlap(&at(0.0, -1.0), &at(0.0, 0.5), 0.1));
}

fn view(model: &Model, pose: &Isometry3<f64>) -> RenderedView {
    let mut view = RenderedView::default();
    RayCaster.render(
        model.mesh(),
        &camera(),
        pose,
        &projected_box(model, pose),
        &mut view,
    );
    view
}

/// Returns the part of the image that the model's vertices span.
fn projected_box(model: &Model, pose: &Isometry3<f64>) -> hicp_core::PixelRegion {
    let mut pixels = Vec::new();
    for vertex in model.mesh().vertices() {
        pixels.push(camera().project(&(pose * vertex.cast::<f64>())).unwrap());
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // Clamped to the image.
    let bound = |value: f64, side: u32| value.clamp(0.0, f64::from(side)) as u32;
    let span = |of: fn(&hicp_core::Point2<f64>) -> f64| {
        let values = pixels.iter().map(of);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
            (a.min(x), b.max(x))
        })
    };
    let (u, v) = (span(|p| p.x), span(|p| p.y));
    hicp_core::PixelRegion {
        u_min: bound(u.0.floor(), 64),
        v_min: bound(v.0.floor(), 48),
        u_max: bound(u.1 + 2.0, 64),
        v_max: bound(v.1 + 2.0, 48),
    }
}

/// Computes the same from whole images, with the functions that the golden cases of VSD test.
fn vsd_of_whole_images(
    test: &DepthImage,
    model: &Model,
    a: &Isometry3<f64>,
    b: &Isometry3<f64>,
) -> [f64; 10] {
    let whole = |pose: &Isometry3<f64>| {
        let depth = render_depth(model, &camera(), pose);
        depth.to_distance(&camera()).unwrap()
    };
    let (a, b) = (whole(a), whole(b));
    let test = test.to_distance(&camera()).unwrap();
    let (v_a, v_b) = visibility_masks(&test, &a, &b, VISIBILITY_TOLERANCE_METERS).unwrap();
    vsd(&a, &v_a, &b, &v_b, model.diameter()).unwrap()
}

#[test]
fn vsd_of_renders_equals_vsd_of_whole_images() {
    let model = Model::new(wedge());
    let mut numbers = Numbers(813);
    let mut different = 0;
    for round in 0..40 {
        let truth = pose(0.003, -0.002, 0.25, 0.4, -0.3, 0.2);
        let size = if round % 2 == 0 { 0.01 } else { 0.04 };
        let shift = numbers.vector() * size;
        let estimate = Isometry3::translation(shift.x, shift.y, shift.z) * truth;
        // An occluder in front of a part of it, a wall behind it, and holes.
        let mut pixels = render_depth(&model, &camera(), &truth).pixels().to_vec();
        for (index, z) in pixels.iter_mut().enumerate() {
            match index % 64 {
                0..28 => *z = 0.15,
                40..43 => *z = 0.0,
                _ if *z == 0.0 => *z = 0.6,
                _ => {}
            }
        }
        let test = DepthImage::from_meters(64, 48, pixels).unwrap();
        let found = bop_vsd(
            &test,
            &camera(),
            &view(&model, &estimate),
            &view(&model, &truth),
            model.diameter(),
            VISIBILITY_TOLERANCE_METERS,
        );
        let found = found.unwrap();
        assert_eq!(found, vsd_of_whole_images(&test, &model, &estimate, &truth));
        different += usize::from(found[0] > 0.0 && found[9] < 1.0);
    }
    assert!(different > 20, "{different}");
}

#[test]
fn vsd_of_equal_poses_is_zero_and_of_invisible_ones_one() {
    let model = Model::new(wedge());
    let truth = pose(0.003, -0.002, 0.25, 0.4, -0.3, 0.2);
    let render = view(&model, &truth);
    let nothing = RenderedView::default();
    let errors = |test: &DepthImage, a: &RenderedView, b: &RenderedView| {
        bop_vsd(test, &camera(), a, b, model.diameter(), 0.015).unwrap()
    };
    let seen = render_depth(&model, &camera(), &truth);
    let hidden = DepthImage::from_meters(64, 48, vec![0.1; 64 * 48]).unwrap();
    assert_eq!(errors(&seen, &render, &render), [0.0; 10]);
    assert_eq!(errors(&hidden, &render, &render), [1.0; 10]);
    assert_eq!(errors(&seen, &nothing, &render), [1.0; 10]);
    assert_eq!(errors(&seen, &nothing, &nothing), [1.0; 10]);
    let small = DepthImage::from_meters(2, 2, vec![0.1; 4]).unwrap();
    assert!(matches!(
        bop_vsd(&small, &camera(), &render, &render, 0.1, 0.015),
        Err(ScoreError::Size { .. })
    ));
    assert!(matches!(
        bop_vsd(&seen, &camera(), &render, &render, 0.0, 0.015),
        Err(ScoreError::Diameter { .. })
    ));
}

//! Tests of flatness against known planes and distances.

use crate::evidence::near;
use crate::support::{Numbers, RayCaster, cuboid, pose, render_depth};
use hicp_core::{
    Context, DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, Problem, RenderCache,
    Vector3,
};
use hicp_score::Flatness;

/// A camera of twenty by twenty pixels, which are all compared.
fn camera() -> PinholeCamera {
    PinholeCamera::new(40.0, 42.0, 9.7, 9.2, 20, 20).unwrap()
}

/// A cube with an edge toward the camera, like a roof.
fn cube() -> Model {
    Model::new(cuboid(0.07, 0.07, 0.07))
}

fn at() -> Isometry3<f64> {
    pose(0.003, -0.002, 0.25, 0.1, 0.8, 0.0)
}

fn observe(
    camera: &PinholeCamera,
    depth: impl Fn(u32, u32) -> f64,
    masked: impl Fn(u32, u32) -> bool,
) -> Observation {
    let (width, height) = (camera.width(), camera.height());
    let pixels = || (0..height).flat_map(|v| (0..width).map(move |u| (u, v)));
    let depth = pixels().map(|(u, v)| depth(u, v) as f32).collect();
    let depth = DepthImage::from_meters(width, height, depth).unwrap();
    let mask = Mask::new(width, height, pixels().map(|(u, v)| masked(u, v)).collect()).unwrap();
    Observation::new(depth, mask, *camera).unwrap()
}

/// Returns the depth of a plane through (0, 0, `z`).
fn plane(camera: &PinholeCamera, normal: [f64; 3], z: f64) -> impl Fn(u32, u32) -> f64 {
    let (camera, normal) = (*camera, Vector3::from(normal));
    move |u, v| {
        let ray = camera.unproject(f64::from(u), f64::from(v), 1.0).coords;
        normal.z * z / normal.dot(&ray)
    }
}

fn flatness(model: &Model, observation: &Observation, pose: &Isometry3<f64>) -> Option<Flatness> {
    let mut renders = RenderCache::new(RayCaster);
    let problem = Problem::new(model, observation);
    Flatness::at(&mut Context::new(problem, &mut renders), pose)
}

/// Returns the distance that seven tenths of the distances stay below.
fn seven_tenths(mut distances: Vec<f64>) -> f64 {
    distances.sort_by(f64::total_cmp);
    distances[(distances.len() as f64 * 0.7) as usize]
}

#[test]
fn a_wall_is_flat_and_the_model_has_its_distance_from_it() {
    let (camera, model) = (camera(), cube());
    let rendered = render_depth(&model, &camera, &at());
    let z = |u: u32, v: u32| f64::from(rendered.pixels()[(v * 20 + u) as usize]);
    for normal in [[0.0, 0.0, -1.0], [0.3, 0.2, -1.0], [-0.5, 0.1, -1.0]] {
        let wall = plane(&camera, normal, 0.24);
        // Holes and pixels outside the mask are ignored.
        let measured = |u, v| {
            if (u + v) % 5 == 0 { 0.0 } else { wall(u, v) }
        };
        let observation = observe(&camera, measured, |u, _| u != 9);
        let flatness = flatness(&model, &observation, &at()).unwrap();
        let pixels = (0..20).flat_map(|v| (0..20).map(move |u| (u, v)));
        let pixels: Vec<(u32, u32)> = pixels
            .filter(|&(u, v)| z(u, v) > 0.0 && u != 9 && (u + v) % 5 != 0)
            .collect();
        assert!(pixels.len() > 64);
        let distances = pixels.iter().map(|&(u, v)| (wall(u, v) - z(u, v)).abs());
        near(flatness.residual, seven_tenths(distances.collect()), 1e-6);
        assert!(flatness.measured < 1e-7, "{flatness:?}");
        // Two of its faces are visible.
        assert!(flatness.rendered > 2e-3, "{flatness:?}");
        assert_eq!(flatness.diameter, model.diameter());
    }
}

#[test]
fn at_the_true_pose_both_surfaces_agree() {
    let (camera, model) = (camera(), cube());
    let rendered = render_depth(&model, &camera, &at());
    for offset in [0.0, 0.004] {
        let z = |u: u32, v: u32| f64::from(rendered.pixels()[(v * 20 + u) as usize]);
        let measured = |u, v| if z(u, v) > 0.0 { z(u, v) + offset } else { 0.0 };
        let observation = observe(&camera, measured, |_, _| true);
        let flatness = flatness(&model, &observation, &at()).unwrap();
        near(flatness.residual, offset, 1e-6);
        near(
            flatness.measured,
            flatness.rendered,
            0.1 * flatness.rendered,
        );
        assert!(!flatness.is_flat(), "{flatness:?}");
    }
}

#[test]
fn a_face_is_flat_anywhere_despite_a_tenth_of_outliers() {
    let (camera, model) = (camera(), Model::new(cuboid(0.1, 0.1, 0.04)));
    let face = pose(0.0, 0.0, 0.22, 0.0, 0.0, 0.0);
    let wall = plane(&camera, [0.2, 0.0, -1.0], 0.2);
    for strays in [false, true] {
        let measured = |u, v| {
            let stray = strays && (7 * u + 3 * v) % 11 == 0;
            wall(u, v) + if stray { 0.05 } else { 0.0 }
        };
        let observation = observe(&camera, measured, |_, _| true);
        let flatness = flatness(&model, &observation, &face).unwrap();
        assert!(flatness.rendered < 1e-7, "{flatness:?}");
        assert!(flatness.measured < 1e-7, "{flatness:?}");
        assert!(!flatness.is_flat(), "{flatness:?}");
    }
}

#[test]
fn noise_determines_the_flatness_of_a_plane() {
    let (camera, model) = (camera(), Model::new(cuboid(0.1, 0.1, 0.04)));
    let mut numbers = Numbers(7);
    let noise: Vec<f64> = (0..400).map(|_| 0.002 * numbers.normal()).collect();
    let wall = plane(&camera, [0.2, 0.1, -1.0], 0.2);
    let measured = |u: u32, v: u32| wall(u, v) + noise[(v * 20 + u) as usize];
    let observation = observe(&camera, measured, |_, _| true);
    let face = pose(0.0, 0.0, 0.22, 0.0, 0.0, 0.0);
    let flatness = flatness(&model, &observation, &face).unwrap();
    // Seven tenths of a normal distribution are within 1.036 of its standard deviations.
    near(flatness.measured, 0.002 * 1.036, 3e-4);
}

#[test]
fn few_pixels_and_pixels_on_a_line_give_no_flatness() {
    let (camera, model) = (camera(), Model::new(cuboid(0.2, 0.2, 0.04)));
    let face = pose(0.0, 0.0, 0.22, 0.0, 0.0, 0.0);
    let wall = plane(&camera, [0.0, 0.0, -1.0], 0.2);
    let with = |n: u32| {
        // Whole rows of twelve in the middle of the image.
        let masked =
            move |u: u32, v: u32| (4..16).contains(&u) && v >= 4 && (v - 4) * 12 + u - 4 < n;
        flatness(&model, &observe(&camera, &wall, masked), &face)
    };
    assert_eq!(with(0), None);
    assert_eq!(with(63), None);
    assert!(with(64).is_some());
    for unseen in [
        pose(0.0, 0.0, -0.25, 0.0, 0.0, 0.0),
        pose(3.0, 0.0, 0.25, 0.0, 0.0, 0.0),
        Isometry3::translation(f64::NAN, 0.0, 0.25),
    ] {
        let observation = observe(&camera, &wall, |_, _| true);
        assert_eq!(flatness(&model, &observation, &unseen), None);
    }
    // One row, one column.
    for (width, height) in [(300, 1), (1, 300)] {
        let camera = PinholeCamera::new(600.0, 600.0, 0.0, 0.0, width, height).unwrap();
        let model = Model::new(cuboid(1.0, 1.0, 0.04));
        let observation = observe(&camera, |_, _| 0.2, |_, _| true);
        assert_eq!(flatness(&model, &observation, &face), None);
    }
}

/// A large image is compared on a grid, for all proportions.
#[test]
fn a_grid_of_pixels_gives_the_same_flatness() {
    let coarse = flatness_of_cube(1);
    for scale in [3, 8, 13] {
        let fine = flatness_of_cube(scale);
        near(fine.residual, coarse.residual, 0.1 * coarse.residual);
        near(fine.rendered, coarse.rendered, 0.15 * coarse.rendered);
        assert!(fine.measured < 1e-7);
    }
    for (width, height, told) in [
        // Every second of two rows is one row.
        (256, 2, true),
        (257, 2, false),
        (2, 256, true),
        (2, 257, false),
        (2000, 3, false),
        (3, 2000, false),
        (23, 23, true),
        (30, 2000, true),
    ] {
        let camera = PinholeCamera::new(600.0, 600.0, 0.0, 0.0, width, height).unwrap();
        let model = Model::new(cuboid(9.0, 9.0, 0.04));
        let wall = plane(&camera, [0.1, 0.2, -1.0], 0.2);
        let observation = observe(&camera, wall, |_, _| true);
        let face = pose(0.0, 0.0, 0.23, 0.0, 0.0, 0.0);
        let flatness = flatness(&model, &observation, &face);
        assert_eq!(flatness.is_some(), told, "{width} {height}");
    }
}

/// Tests objects with few pixels of their box, but enough in total.
///
/// They are a bar across its box, and a face of which only a corner is left.
#[test]
fn a_small_part_of_a_large_box_is_sampled_densely() {
    let camera = PinholeCamera::new(400.0, 400.0, 99.5, 99.5, 200, 200).unwrap();
    let wall = || plane(&camera, [0.1, 0.2, -1.0], 0.25);
    let bar = Model::new(cuboid(0.2, 0.006, 0.006));
    let across = pose(0.0, 0.0, 0.25, 0.0, 0.0, std::f64::consts::FRAC_PI_4);
    let flatness_of_bar = flatness(&bar, &observe(&camera, wall(), |_, _| true), &across);
    assert!(flatness_of_bar.unwrap().measured < 1e-7);
    let sheet = Model::new(cuboid(0.3, 0.3, 0.04));
    let face = pose(0.0, 0.0, 0.27, 0.0, 0.0, 0.0);
    let corners = |side: u32| {
        // Two patches of the mask, at opposite ends of its box.
        let masked = move |u: u32, v: u32| u.max(v) < side || u.min(v) >= 200 - side;
        flatness(&sheet, &observe(&camera, wall(), masked), &face)
    };
    for side in [6, 8, 12, 20, 33, 50, 80] {
        assert!(corners(side).unwrap().measured < 1e-7, "{side}");
    }
    assert_eq!(corners(5), None);
}

/// A cube before a wall, in an image of `scale` times twenty pixels.
fn flatness_of_cube(scale: u32) -> Flatness {
    let s = f64::from(scale);
    let camera = PinholeCamera::new(40.0 * s, 42.0 * s, 9.7 * s, 9.2 * s, 20 * scale, 20 * scale);
    let camera = camera.unwrap();
    let observation = observe(&camera, plane(&camera, [0.3, 0.2, -1.0], 0.24), |_, _| true);
    flatness(&cube(), &observation, &at()).unwrap()
}

#[test]
fn flat_means_explained_by_a_plane_and_not_by_the_model() {
    let at = |residual: f64, measured: f64, rendered: f64| {
        Flatness::new(residual, measured, rendered, 0.2).is_flat()
    };
    assert!(at(0.006, 0.003, 0.006));
    // The pose explains it as well, or nearly.
    assert!(at(0.0046, 0.003, 0.006) && !at(0.0045, 0.003, 0.006));
    // The model is as flat.
    assert!(at(0.006, 0.003, 0.0031) && !at(0.006, 0.003, 0.003));
    // The measured surface is not flat.
    assert!(at(0.03, 0.0059, 0.03) && !at(0.03, 0.006, 0.03));
    // A hundredth of the diameter does not count.
    assert!(at(0.0021, 0.0, 0.0021));
    assert!(!at(0.002, 0.0, 0.006) && !at(0.006, 0.0, 0.002));
}

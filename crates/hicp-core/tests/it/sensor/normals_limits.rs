//! Tests of normals at limits: steps, depths, supports, and cameras.

use crate::support::{Numbers, degrees_between};
use hicp_core::{
    DepthImage, MAX_DEPTH_METERS, MAX_FOCAL_LENGTH, MIN_FOCAL_LENGTH, Mask, Observation,
    PinholeCamera, Vector3,
};

fn image(camera: &PinholeCamera, depth: impl Fn(u32, u32) -> f32) -> Observation {
    let (width, height) = (camera.width(), camera.height());
    let pixels = camera.region().pixels();
    let depth = pixels.map(|(u, v)| depth(u, v)).collect();
    let depth = DepthImage::from_meters(width, height, depth).unwrap();
    Observation::new(depth, Mask::full(width, height), *camera).unwrap()
}

/// The largest angle between a normal and the axis, degrees.
fn worst(observation: &Observation) -> f64 {
    let angle = |s: &hicp_core::Surfel| {
        let normal = s.normal.into_inner().cast::<f64>();
        degrees_between(&normal, &-Vector3::z())
    };
    let angles = observation.surfels(1).map(|(_, s)| angle(s));
    angles.fold(0.0, f64::max)
}

/// Two walls with a step of exactly tan 85° per pixel are one surface.
///
/// With the next larger number they are two.
#[test]
fn an_edge_is_steeper_than_85_degrees() {
    let focal = 32.0 * 85_f64.to_radians().tan();
    let camera = PinholeCamera::new(focal, focal, 15.5, 15.5, 32, 32).unwrap();
    for upright in [true, false] {
        let walls = |far: f32| {
            image(&camera, |u, v| {
                if (if upright { u } else { v }) < 16 {
                    1.0
                } else {
                    far
                }
            })
        };
        let (surface, edge) = (
            walls(1.0 + 1.0 / 32.0),
            walls((1.0_f32 + 1.0 / 32.0).next_up()),
        );
        assert_eq!((surface.n_surfels(), edge.n_surfels()), (1024, 1024));
        // A window of five across the step has 0.3 times the slope of the step.
        assert!(worst(&surface) > 70.0, "{}", worst(&surface));
        assert!(worst(&edge) < 1e-5, "{}", worst(&edge));
    }
}

#[test]
fn depths_from_a_tenth_of_a_millimeter_on_have_a_normal() {
    let camera = PinholeCamera::new(60.0, 60.0, 4.0, 4.0, 9, 9).unwrap();
    for (depth, expected) in [(1e-4, 81), (1e-4_f32.next_down(), 0)] {
        let observation = image(&camera, |_, _| depth);
        assert_eq!(
            (observation.n_surfels(), observation.n_measured()),
            (expected, 81)
        );
        // Among such pixels, a pixel with a valid depth has no usable neighbors.
        let one = image(&camera, |u, v| if (u, v) == (4, 4) { 0.5 } else { depth });
        assert_eq!(one.surfel_at(4, 4), None);
    }
}

/// A corner of 3 × 3 pixels whose plane passes through the camera, which does not see it.
///
/// There, least squares of 1/z gives (8a + 5(b + b′) + 2(c + c′ + d) − e − e′ − 4f)/18. It is 0 if
/// the three far pixels are at 1/4 m.
#[test]
fn a_plane_through_the_camera_has_no_normal() {
    let camera = PinholeCamera::new(1.0, 1.0, 0.0, 0.0, 3, 3).unwrap();
    let corner = |far: f32| {
        let observation = image(&camera, |u, v| if u + v < 3 { 1.0 } else { far });
        observation.surfel_at(0, 0).copied()
    };
    assert!(corner(0.25_f32.next_up()).is_some());
    assert_eq!(corner(0.25), None);
    assert_eq!(corner(0.25_f32.next_down()), None);
}

/// The noise gives windows of 21 × 21 pixels, so that lines of every slope have enough pixels in
/// one.
#[test]
fn lines_of_every_slope_determine_no_normal() {
    let (width, height) = (128, 64);
    let camera = PinholeCamera::new(600.0, 620.0, 60.0, 30.0, width, height).unwrap();
    let mut numbers = Numbers(71);
    for (p, q) in [
        (1, 0),
        (0, 1),
        (1, 1),
        (2, 1),
        (1, 2),
        (3, 1),
        (1, 3),
        (3, 2),
        (2, 3),
    ] {
        // Lines upward and downward, next to a wall on which the noise is measured.
        for upwards in [false, true] {
            let line: Vec<(u32, u32)> = (0..64)
                .map(|k| (k * p, k * q))
                .take_while(|(u, v)| *u < 36 && *v < height)
                .map(|(u, v)| (u, if upwards { height - 1 - v } else { v }))
                .collect();
            let (mut depth, mut mask) = (Vec::new(), Vec::new());
            for (u, v) in camera.region().pixels() {
                let on_line = line.contains(&(u, v));
                let wall = 0.6 * (1.0 + 0.03 * numbers.normal());
                // The line is as rough as possible, so that its sums are rounded.
                let z = if on_line {
                    numbers.between(0.2, 3.0)
                } else {
                    wall
                };
                depth.push(z as f32);
                mask.push(on_line || u >= 48);
            }
            let depth = DepthImage::from_meters(width, height, depth).unwrap();
            let mask = Mask::new(width, height, mask).unwrap();
            let observation = Observation::new(depth, mask, camera).unwrap();
            for (u, v) in &line {
                assert_eq!(
                    observation.surfel_at(*u, *v),
                    None,
                    "({p}, {q}): ({u}, {v})"
                );
            }
            assert!(line.len() > 11);
            assert_eq!(observation.n_surfels(), 80 * 64);
        }
    }
}

/// Checks the widest and the narrowest rays, along one axis or both, for the nearest and the
/// farthest surfaces. Points, their squared distances and normals must stay finite.
#[test]
fn a_camera_at_its_limits_has_finite_surfels() {
    for focal in [MIN_FOCAL_LENGTH, MAX_FOCAL_LENGTH] {
        let mut n_surfels = 0;
        for (cx, cy) in [(-1e9, 0.0), (0.0, 1e9), (1e9, 1e9), (-1e9, 1e9), (4.0, 4.0)] {
            let camera = PinholeCamera::new(focal, focal, cx, cy, 9, 9).unwrap();
            // The slope is at most one pixel width per pixel.
            let slope = (1.0 / focal).min(1.0) as f32;
            for scale in [2e-4, 1.0, 1.5 * MAX_DEPTH_METERS] {
                let observation = image(&camera, |u, v| {
                    scale * (0.5 + slope * (0.01 * u as f32 + 0.003 * v as f32))
                });
                assert_eq!(observation.n_measured(), 81);
                n_surfels += observation.n_surfels();
                for (_, surfel) in observation.surfels(1) {
                    assert!(surfel.point.coords.norm_squared().is_finite());
                    assert!(
                        (surfel.normal.norm() - 1.0).abs() < 1e-6,
                        "{focal} {cx} {cy} {scale} {surfel:?}"
                    );
                }
            }
        }
        assert!(n_surfels > 0, "{focal}");
    }
}

//! Tests of surface normals against the normals of analytic surfaces (pitfall 21).

use crate::support::{
    Numbers, degrees_between, depth_image, median, observe_depth, plane_depth, sphere_depth,
};
use hicp_core::{DepthImage, Mask, Observation, PinholeCamera, Vector3};

/// A camera with a non-integer principal point and two different focal lengths.
fn camera() -> PinholeCamera {
    PinholeCamera::new(590.3, 611.7, 63.37, 55.81, 128, 112).unwrap()
}

/// Returns the normal, toward the camera, of a tilted plane at 0.6 m on the optical axis.
///
/// The plane is tilted around an axis in the image.
fn tilted(degrees: f64, about: f64) -> Vector3<f64> {
    let (sine, cosine) = degrees.to_radians().sin_cos();
    Vector3::new(sine * about.cos(), sine * about.sin(), -cosine)
}

fn plane(normal: &Vector3<f64>) -> DepthImage {
    depth_image(&camera(), |ray| plane_depth(normal, 0.6 * normal.z, &ray))
}

/// Angles in degrees between the estimated normals and those of the surface, over all surfels.
fn errors(observation: &Observation, truth: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Vec<f64> {
    observation
        .surfels(1)
        .map(|(_, s)| {
            let (point, normal) = (
                s.point.coords.cast::<f64>(),
                s.normal.into_inner().cast::<f64>(),
            );
            degrees_between(&normal, &truth(&point))
        })
        .collect()
}

fn noisy(depth: &DepthImage, relative: f64, seed: u64) -> DepthImage {
    let mut numbers = Numbers(seed);
    #[allow(clippy::cast_possible_truncation)]
    let pixels = depth
        .pixels()
        .iter()
        .map(|z| z * (1.0 + relative * numbers.normal()) as f32)
        .collect();
    DepthImage::from_meters(depth.width(), depth.height(), pixels).unwrap()
}

const CENTER: Vector3<f64> = Vector3::new(0.006, -0.003, 0.55);
const RADIUS: f64 = 0.045;

fn sphere() -> DepthImage {
    depth_image(&camera(), |ray| sphere_depth(&CENTER, RADIUS, &ray))
}

fn sphere_normal(point: &Vector3<f64>) -> Vector3<f64> {
    (point - CENTER).normalize()
}

#[test]
fn pitfall_21_normals_of_planes_are_accurate_at_every_tilt() {
    for tilt in [0.0, 10.0, 20.0, 30.0, 45.0, 60.0, 70.0, 75.0] {
        for about in [0.0, 0.7, 1.9, 3.3, 5.0] {
            let normal = tilted(tilt, about);
            let observation = observe_depth(plane(&normal), &camera());
            assert_eq!(
                observation.n_surfels(),
                128 * 112,
                "every pixel of a plane has a normal"
            );
            let mut errors = errors(&observation, |_| normal);
            let (median, worst) = (median(&mut errors), errors[errors.len() - 1]);
            // f32 rounds depth by up to 6e-8 of its value. The slope of a 5×5 window is f Σ u δ /
            // 50 with Σ|u| = 30. It is off by at most 2.2e-5 per axis, 1.8e-3° in both. That of a
            // corner's 3×3 window (6/6) is off by at most 3e-3°. Independent roundings (3.5e-8 RMS)
            // give f · 3.5e-8/√50 per axis, and a median of 1.18 times that: 2e-4°.
            assert!(median < 4e-4 && worst < 3e-3, "{tilt}°: {median} {worst}");
        }
    }
}

#[test]
fn pitfall_21_normals_of_a_sphere_are_accurate() {
    let observation = observe_depth(sphere(), &camera());
    let mut errors = errors(&observation, sphere_normal);
    assert!(errors.len() > 6000, "{}", errors.len());
    let middle = median(&mut errors);
    assert!(middle < 0.5, "{middle}");
    // Curvature tilts the one-sided windows of the silhouette. Nine in ten pixels are inside of it.
    let ninety = errors[errors.len() * 9 / 10];
    assert!(ninety < 2.0, "{ninety}");
}

/// The expected median error of a frontal normal.
///
/// Depth noise of `relative` over a window of half side `radius` changes a frontal normal by a
/// vector whose components have a deviation of f · relative/√Σu². The median length of such a
/// vector is 1.18 times that.
fn expected_median(relative: f64, radius: f64) -> f64 {
    let side = 2.0 * radius + 1.0;
    let sum_of_squares = side * side * radius * (radius + 1.0) / 3.0;
    (1.18 * 601.0 * relative / sum_of_squares.sqrt()).to_degrees()
}

/// Windows grow with the noise until the deviation of the slope is 0.1.
///
/// They are 15 × 15 at 1 % and 21 × 21, the largest, at 3 %. The measured frontal medians are 6.6°
/// and 10.8°; the theory of full windows gives 6.3° and 9.6°.
#[test]
fn normals_of_a_noisy_plane_are_as_accurate_as_their_windows_allow() {
    for (relative, radius) in [(0.01, 7.0), (0.03, 10.0)] {
        let expected = expected_median(relative, radius);
        for tilt in [0.0, 30.0, 60.0] {
            let normal = tilted(tilt, 0.7);
            let observation = observe_depth(noisy(&plane(&normal), relative, 41), &camera());
            let mut errors = errors(&observation, |_| normal);
            let middle = median(&mut errors);
            // A fifth is allowed for the windows that the image's border clips. On a tilted plane,
            // depth changes faster per pixel, and normals become better.
            assert!(
                middle < 1.2 * expected,
                "{tilt}° {relative}: {middle}, expected {expected}"
            );
            assert_eq!(observation.n_surfels(), 128 * 112, "noise is not an edge");
        }
    }
}

/// The measured medians are 6.0° and 12.0°. They exceed the plane's because a sphere of 49 pixels'
/// radius is curved within a window.
#[test]
fn normals_of_a_noisy_sphere_are_nearly_as_accurate() {
    for (relative, radius) in [(0.01, 7.0), (0.03, 10.0)] {
        let observation = observe_depth(noisy(&sphere(), relative, 42), &camera());
        let mut errors = errors(&observation, sphere_normal);
        let middle = median(&mut errors);
        let expected = expected_median(relative, radius);
        assert!(
            middle < 1.4 * expected,
            "{relative}: {middle}, expected {expected}"
        );
        assert_eq!(
            errors.len(),
            observation.n_measured(),
            "noise is not an edge"
        );
    }
}

/// Two oblique walls, one in front of the other. A window must not use both.
#[test]
fn pitfall_21_no_normal_mixes_the_two_sides_of_a_depth_edge() {
    let camera = camera();
    let (near, far) = (tilted(25.0, 0.4), tilted(15.0, 2.0));
    // The edge threshold is tan(85°)/f, about 1.9 % of the depth: jumps just above it, and far
    // above.
    for jump in [0.022, 0.03, 0.036, 0.05, 0.2, 2.0] {
        for slanted in [false, true] {
            let front = |ray: &Vector3<f64>| ray.x < if slanted { 0.4 * ray.y } else { 0.001 };
            let depth = depth_image(
                &camera,
                |ray| {
                    if front(&ray) { 0.6 } else { 0.6 * (1.0 + jump) }
                },
            );
            let observation = observe_depth(depth, &camera);
            let mut worst = 0.0_f64;
            for (_, surfel) in observation.surfels(1) {
                let normal = surfel.normal.into_inner().cast::<f64>();
                worst = worst.max(degrees_between(&normal, &-Vector3::z()));
            }
            assert!(worst < 0.1, "jump {jump}, slanted {slanted}: {worst}°");
            assert_eq!(observation.n_surfels(), 128 * 112);
        }
    }
    // Tilted walls with a step of 5 cm.
    let depth = depth_image(&camera, |ray| {
        if ray.x < 0.001 {
            plane_depth(&near, 0.6 * near.z, &ray)
        } else {
            plane_depth(&far, 0.65 * far.z, &ray)
        }
    });
    let observation = observe_depth(depth, &camera);
    let errors = errors(&observation, |p| if p.x / p.z < 0.001 { near } else { far });
    let worst = errors.iter().copied().fold(0.0, f64::max);
    assert!(worst < 1.0, "{worst}°");
}

#[test]
fn a_flying_pixel_has_no_normal_and_does_not_affect_others() {
    let mut pixels = vec![0.5; 128 * 112];
    // In the middle of the step, and a speck directly in front of the lens.
    for (u, v, z) in [
        (40, 50, 0.43),
        (90, 30, 1e-12),
        (20, 80, 1e-30),
        (100, 100, 900.0),
    ] {
        pixels[v * 128 + u] = z;
    }
    let depth = DepthImage::from_meters(128, 112, pixels).unwrap();
    let observation = Observation::new(depth, Mask::full(128, 112), camera()).unwrap();
    for (u, v) in [(40, 50), (90, 30), (20, 80), (100, 100)] {
        assert_eq!(observation.surfel_at(u, v), None);
    }
    assert_eq!(observation.n_surfels(), 128 * 112 - 4);
    for (index, surfel) in observation.surfels(1) {
        let (u, v) = observation.pixel(index);
        let normal = surfel.normal.into_inner().cast::<f64>();
        let error = degrees_between(&normal, &-Vector3::z());
        assert!(error < 1e-3, "({u}, {v}): {error}°");
    }
}

#[test]
fn lines_of_pixels_determine_no_normal() {
    for (width, height) in [(40, 1), (1, 40), (2, 2), (1, 1), (5, 1)] {
        let camera = PinholeCamera::new(60.0, 60.0, 3.0, 3.0, width, height).unwrap();
        let depth = depth_image(&camera, |_| 0.5);
        let observation = observe_depth(depth, &camera);
        assert_eq!(observation.n_surfels(), 0, "{width}x{height}");
        assert_eq!(observation.n_measured(), (width * height) as usize);
    }
    // A diagonal line in a full image.
    let camera = PinholeCamera::new(60.0, 60.0, 15.0, 15.0, 32, 32).unwrap();
    let mask = (0..32 * 32).map(|i| i % 33 == 0).collect();
    let mask = Mask::new(32, 32, mask).unwrap();
    let observation = Observation::new(depth_image(&camera, |_| 0.5), mask, camera).unwrap();
    assert_eq!((observation.n_surfels(), observation.n_measured()), (0, 32));
}

#[test]
fn equal_images_give_equal_normals() {
    let make = || observe_depth(noisy(&sphere(), 0.02, 43), &camera());
    let (a, b) = (make(), make());
    assert!(a.surfels(1).eq(b.surfels(1)));
    assert_ne!(a.id(), b.id());
}

//! Tests of observations and the images they are made of.

use std::sync::Arc;

use crate::support::Numbers;
use hicp_core::{
    DepthImage, DistanceImage, ImageError, MAX_DEPTH_METERS, Mask, NormalWindow, Observation,
    PinholeCamera, PixelRegion,
};
use proptest::prelude::*;

fn camera(width: u32, height: u32) -> PinholeCamera {
    PinholeCamera::new(60.0, 66.0, 14.3, 11.8, width, height).unwrap()
}

/// A wall with a ragged mask and holes.
fn ragged(width: u32, height: u32, seed: u64) -> Observation {
    let mut numbers = Numbers(seed);
    let depth = (0..width * height)
        .map(|_| if numbers.unit() < 0.1 { 0.0 } else { 0.5 })
        .collect();
    let masked = PixelRegion {
        u_min: 3,
        v_min: 5,
        u_max: width - 4,
        v_max: height - 2,
    };
    Observation::new(
        DepthImage::from_meters(width, height, depth).unwrap(),
        Mask::in_region(width, height, &masked, |_, _| numbers.unit() < 0.9),
        camera(width, height),
    )
    .unwrap()
}

#[test]
fn a_box_is_rounded_to_the_pixels_of_the_image() {
    let outside = [
        [9e9, 0.0, 9.0, 9.0],
        [-50.0, -50.0, 20.0, 20.0],
        [f64::NAN; 4],
        [0.0; 4],
    ];
    for bbox in outside {
        assert_eq!(Mask::in_box(64, 48, bbox).n_set(), 0, "{bbox:?}");
    }
    let mask = Mask::in_box(64, 48, [-1e300, -1e300, f64::INFINITY, f64::INFINITY]);
    assert_eq!(mask, Mask::full(64, 48));
    assert_eq!(
        Mask::in_box(64, 48, [9.5, 9.4, 2.0, 2.0]).get(10, 9),
        Some(true)
    );
}

#[test]
fn a_window_of_normals_that_is_too_small_or_too_large_is_an_error() {
    for (half_side, valid) in [(0, false), (1, true), (10, true), (11, false)] {
        let depth = DepthImage::from_meters(4, 3, vec![1.0; 12]).unwrap();
        let window = NormalWindow::HalfSide(half_side);
        let made = Observation::with_normal_window(depth, Mask::full(4, 3), camera(4, 3), window);
        assert_eq!(made.is_ok(), valid, "{half_side}");
        if let Err(error) = made {
            let expected = format!(
                "window of normals has a half side of {half_side} pixels, expected 1 to 10"
            );
            assert_eq!(error.to_string(), expected);
        }
    }
}

#[test]
fn errors_name_the_sizes_that_differ() {
    let depth = || DepthImage::from_meters(4, 3, vec![1.0; 12]).unwrap();
    let wrong_mask = Observation::new(depth(), Mask::full(3, 4), camera(4, 3)).unwrap_err();
    assert_eq!(
        wrong_mask.to_string(),
        "mask is 3x4 but depth image is 4x3: expected the same size"
    );
    let wrong_camera = Observation::new(depth(), Mask::full(4, 3), camera(4, 4)).unwrap_err();
    assert_eq!(
        wrong_camera.to_string(),
        "camera is 4x4 but depth image is 4x3: expected the same size"
    );
    let expected = ImageError::PixelCount {
        width: 4,
        height: 3,
        expected: 12,
        found: 11,
    };
    assert_eq!(
        DepthImage::from_meters(4, 3, vec![1.0; 11]).unwrap_err(),
        expected
    );
    assert_eq!(
        DistanceImage::new(4, 3, vec![1.0; 11]).unwrap_err(),
        expected
    );
    assert_eq!(Mask::new(4, 3, vec![true; 11]).unwrap_err(), expected);
}

#[test]
fn depths_that_no_camera_measures_are_missing() {
    let given = vec![
        f32::NAN,
        f32::INFINITY,
        -1.0,
        -0.0,
        0.0,
        1000.1,
        MAX_DEPTH_METERS,
        0.25,
    ];
    let collected = DepthImage::collect(8, 1, given.iter().copied()).unwrap();
    let depth = DepthImage::from_meters(8, 1, given).unwrap();
    assert_eq!(
        depth.pixels(),
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, MAX_DEPTH_METERS, 0.25]
    );
    assert!(depth.pixels()[3].is_sign_positive());
    assert_eq!(collected, depth);
    let short = DepthImage::collect(8, 1, [0.5; 7]).unwrap_err();
    assert_eq!(
        short.to_string(),
        DepthImage::from_meters(8, 1, vec![0.5; 7])
            .unwrap_err()
            .to_string()
    );
}

#[test]
fn pixels_are_row_major_and_none_outside() {
    let depth = DepthImage::from_meters(3, 2, vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).unwrap();
    for v in 0..4 {
        for u in 0..5 {
            let inside = u < 3 && v < 2;
            let expected = inside.then(|| (1 + u + 3 * v) as f32);
            assert_eq!(depth.get(u, v), expected, "({u}, {v})");
        }
    }
    assert_eq!(depth.get(u32::MAX, u32::MAX), None);
}

#[test]
fn observations_of_one_image_share_its_depth() {
    let depth = Arc::new(DepthImage::from_meters(32, 24, vec![0.5; 32 * 24]).unwrap());
    let half = |left: bool| {
        let mask = (0..32 * 24).map(|i| (i % 32 < 16) == left).collect();
        Mask::new(32, 24, mask).unwrap()
    };
    let seen = [true, false]
        .map(|left| Observation::new(Arc::clone(&depth), half(left), camera(32, 24)).unwrap());
    let apart = Observation::new((*depth).clone(), half(true), camera(32, 24)).unwrap();
    for observation in &seen {
        assert!(Arc::ptr_eq(observation.shared_depth(), &depth));
        assert!(std::ptr::eq(observation.depth(), &raw const *depth));
    }
    // A clone shares it too. The maps equal those of an observation with a separate depth image.
    assert_eq!(Arc::strong_count(&depth), 3);
    assert!(Arc::ptr_eq(seen[0].clone().shared_depth(), &depth));
    assert!(seen[0].surfels(1).eq(apart.surfels(1)));
    assert_eq!(seen[1].region().u_min, 16);
}

#[test]
fn bounding_regions_of_full_and_empty_masks() {
    for (width, height) in [(5, 4), (1, 1), (0, 0), (0, 3), (3, 0)] {
        let area = (width * height) as usize;
        let full = Mask::full(width, height);
        assert_eq!(full, Mask::new(width, height, vec![true; area]).unwrap());
        assert_eq!(full.bounding_region().area(), area);
    }
}

#[test]
fn an_empty_mask_and_an_image_of_zeros_have_no_surfels() {
    let empty = Mask::new(32, 24, vec![false; 32 * 24]).unwrap();
    let wall = DepthImage::from_meters(32, 24, vec![0.5; 32 * 24]).unwrap();
    let nothing = DepthImage::from_meters(32, 24, vec![0.0; 32 * 24]).unwrap();
    for (depth, mask) in [(wall, empty), (nothing, Mask::full(32, 24))] {
        let observation = Observation::new(depth, mask, camera(32, 24)).unwrap();
        assert_eq!((observation.n_surfels(), observation.n_measured()), (0, 0));
        assert_eq!(observation.surfels(1).count(), 0);
        assert_eq!(observation.surfel_at(5, 5), None);
        assert_eq!(observation.surfel_near(5.0, 5.0), None);
    }
}

#[test]
fn surfels_exist_only_at_measured_pixels_and_at_their_depth() {
    let observation = ragged(40, 30, 31);
    let (mut measured, mut surfels) = (0, 0);
    for (u, v) in observation.camera().region().pixels() {
        let usable =
            observation.mask().get(u, v) == Some(true) && observation.depth().get(u, v) > Some(0.0);
        measured += usize::from(usable);
        let Some(surfel) = observation.surfel_at(u, v) else {
            continue;
        };
        surfels += 1;
        assert!(usable, "({u}, {v}) is not masked or has no depth");
        let expected = observation.camera().unproject(u.into(), v.into(), 0.5);
        assert!((surfel.point.cast::<f64>() - expected).norm() < 1e-7);
        assert!((surfel.normal.norm() - 1.0).abs() < 1e-6);
        assert!(
            surfel.normal.dot(&surfel.point.coords) < 0.0,
            "a normal faces the camera"
        );
    }
    assert_eq!(
        (observation.n_measured(), observation.n_surfels()),
        (measured, surfels)
    );
    assert!(surfels > 500, "the fixture must have surfels: {surfels}");
    assert_eq!(observation.surfel_at(40, 0), None);
    assert_eq!(observation.surfel_at(u32::MAX, u32::MAX), None);
}

#[test]
fn surfels_of_a_stride_are_the_brute_force_grid_in_row_major_order() {
    let observation = ragged(41, 33, 32);
    for stride in [0, 1, 2, 3, 4, 7, 40, 1000, u32::MAX] {
        let step = stride.max(1);
        let mut expected = Vec::new();
        for (u, v) in observation.camera().region().pixels() {
            if u % step == 0
                && v % step == 0
                && let Some(surfel) = observation.surfel_at(u, v)
            {
                expected.push((u, v, surfel));
            }
        }
        let found: Vec<_> = observation
            .surfels(stride)
            .map(|(index, surfel)| {
                let (u, v) = observation.pixel(index);
                assert_eq!(observation.surfel(index), Some(surfel));
                (u, v, surfel)
            })
            .collect();
        assert_eq!(found, expected, "stride {stride}");
    }
}

#[test]
fn surfels_are_estimated_once_for_an_observation_and_its_clones() {
    let observation = ragged(40, 30, 35);
    let clone = observation.clone();
    let maps = std::thread::scope(|scope| {
        [&observation, &clone]
            .map(|seen| scope.spawn(|| seen.surfel_map().as_ptr() as usize))
            .map(|thread| thread.join().unwrap())
    });
    assert_eq!(maps[0], maps[1]);
    let present = observation.surfel_map().iter().filter(|s| s.point.z > 0.0);
    assert_eq!(present.count(), observation.n_surfels());
    assert_eq!(observation.surfel_map().len(), observation.region().area());
}

#[test]
fn the_depth_near_a_position_is_that_of_its_masked_pixel() {
    let observation = ragged(40, 30, 36);
    for v in 0..30_u16 {
        for u in 0..40_u16 {
            let (column, row) = (u32::from(u), u32::from(v));
            let masked = observation.mask().get(column, row) == Some(true);
            let measured = observation.depth().get(column, row).filter(|z| *z > 0.0);
            let near = observation.depth_near(f32::from(u) + 0.4, f32::from(v) - 0.4);
            assert_eq!(near, measured.filter(|_| masked), "({u}, {v})");
        }
    }
    for (u, v) in [(f32::NAN, 3.0), (-0.6, 3.0), (39.6, 3.0), (3.0, 1e30)] {
        assert_eq!(observation.depth_near(u, v), None);
    }
}

#[test]
fn fewer_than_three_measured_pixels_are_no_surface() {
    for count in 0..5 {
        let mask = Mask::new(4, 3, (0..12).map(|pixel| pixel < count).collect()).unwrap();
        let wall = DepthImage::from_meters(4, 3, vec![0.5; 12]).unwrap();
        let observation = Observation::new(wall, mask, camera(4, 3)).unwrap();
        assert_eq!(observation.has_surface(), count >= 3);
        assert!(observation.has_surface() || observation.n_surfels() == 0);
    }
}

/// Pixel squares are half-open and extend half a pixel to every side: floor(x + ½), computed in
/// f64.
fn reference(observation: &Observation, u: f32, v: f32) -> Option<hicp_core::Surfel> {
    let (column, row) = ((f64::from(u) + 0.5).floor(), (f64::from(v) + 0.5).floor());
    let (width, height) = (observation.depth().width(), observation.depth().height());
    let inside =
        (0.0..f64::from(width)).contains(&column) && (0.0..f64::from(height)).contains(&row);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    inside
        .then(|| observation.surfel_at(column as u32, row as u32).copied())
        .flatten()
}

#[test]
fn pitfall_22_rounding_at_the_borders_of_pixels_and_image() {
    let depth = DepthImage::from_meters(16, 12, vec![0.5; 192]).unwrap();
    let observation = Observation::new(depth, Mask::full(16, 12), camera(16, 12)).unwrap();
    let at = |u: f32, v: f32| observation.surfel_near(u, v);
    let pixel = |u, v| observation.surfel_at(u, v);
    // The image extends from −½ (included) to W − ½ (excluded). Truncation would accept (−1, 0).
    assert_eq!(at(-0.5, -0.5), pixel(0, 0));
    assert_eq!(at(-0.500_001, 3.0), None);
    assert_eq!(at(-0.999, 3.0), None);
    assert_eq!(at(3.0, -0.75), None);
    assert_eq!(at(15.499, 11.499), pixel(15, 11));
    assert_eq!(at(15.5, 5.0), None);
    assert_eq!(at(5.0, 11.5), None);
    assert_eq!(at(2.5, 4.5), pixel(3, 5));
    assert_eq!(at(2.499, 4.499), pixel(2, 4));
    assert!(pixel(0, 0).is_some() && pixel(15, 11).is_some() && pixel(3, 5).is_some());
    for bad in [
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        1e30,
        -1e30,
        f32::MAX,
    ] {
        assert_eq!(at(bad, 3.0), None);
        assert_eq!(at(3.0, bad), None);
    }
}

#[test]
fn pitfall_22_surfel_near_is_its_reference_everywhere() {
    let observation = ragged(40, 30, 33);
    let mut numbers = Numbers(34);
    let mut hits = 0;
    for _ in 0..20_000 {
        #[allow(clippy::cast_possible_truncation)]
        let (u, v) = (
            numbers.between(-3.0, 43.0) as f32,
            numbers.between(-3.0, 33.0) as f32,
        );
        // Within one rounding of a border, either side is valid.
        let border = |x: f32| ((x + 0.5).round() - (x + 0.5)).abs() < 1e-5;
        if border(u) || border(v) {
            continue;
        }
        let found = observation.surfel_near(u, v).copied();
        assert_eq!(found, reference(&observation, u, v), "({u}, {v})");
        hits += usize::from(found.is_some());
    }
    assert!(hits > 5000, "{hits}");
    // Halves and integers are exact in f32.
    for v in -4..=64_i16 {
        for u in -4..=84_i16 {
            let (u, v) = (f32::from(u) / 2.0, f32::from(v) / 2.0);
            assert_eq!(
                observation.surfel_near(u, v).copied(),
                reference(&observation, u, v)
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(128) })]

    #[test]
    fn bounding_region_is_the_brute_force_box(
        (width, height, pixels) in (1_u32..12, 1_u32..12).prop_flat_map(|(w, h)| {
            let pixels = proptest::collection::vec(proptest::bool::weighted(0.06), (w * h) as usize);
            (Just(w), Just(h), pixels)
        })
    ) {
        let set: Vec<(u32, u32)> = PixelRegion::of_image(width, height)
            .pixels()
            .filter(|(u, v)| pixels[(v * width + u) as usize])
            .collect();
        let expected = if set.is_empty() {
            PixelRegion::default()
        } else {
            PixelRegion {
                u_min: set.iter().map(|p| p.0).min().unwrap(),
                v_min: set.iter().map(|p| p.1).min().unwrap(),
                u_max: set.iter().map(|p| p.0).max().unwrap() + 1,
                v_max: set.iter().map(|p| p.1).max().unwrap() + 1,
            }
        };
        let region = Mask::new(width, height, pixels.clone()).unwrap().bounding_region();
        prop_assert_eq!(region, expected);
        prop_assert_eq!(region.is_empty(), set.is_empty());
    }

    #[test]
    fn an_intersection_contains_the_common_pixels(a in region(), b in region()) {
        let common = a.intersection(&b);
        let mut count = 0;
        for (u, v) in PixelRegion::of_image(8, 8).pixels() {
            let inside = a.contains(u, v) && b.contains(u, v);
            prop_assert_eq!(common.contains(u, v), inside);
            prop_assert_eq!(common.index(u, v).is_some(), inside);
            if inside {
                prop_assert_eq!(common.index(u, v), Some(count));
                count += 1;
            }
        }
        prop_assert_eq!(common.area(), count);
        prop_assert_eq!(common.is_empty(), count == 0);
    }
}

fn region() -> impl Strategy<Value = PixelRegion> {
    (0_u32..8, 0_u32..8, 0_u32..8, 0_u32..8).prop_map(|(u_min, v_min, u_max, v_max)| PixelRegion {
        u_min,
        v_min,
        u_max,
        v_max,
    })
}

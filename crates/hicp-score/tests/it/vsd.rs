//! Tests of VSD: the golden case of BOP's reference code, and the properties of the definition
//! (pitfall 24).

use hicp_core::{DistanceImage, ImageError, Mask, PinholeCamera};
use hicp_score::{N_TOLERANCES, ScoreError, tolerances, visibility_masks, vsd};
use proptest::prelude::*;

const WIDTH: u32 = 7;
const HEIGHT: u32 = 6;
const N: usize = 42;

/// The reference's depths in millimeters.
///
/// Its camera has fx = 10, fy = 12, cx = 3, cy = 2.5.
const TEST: [u16; N] = [
    0, 1000, 1000, 1000, 1000, 1000, 1000, //
    1000, 500, 500, 500, 500, 1000, 1000, //
    1000, 500, 505, 510, 480, 1000, 1000, //
    1000, 500, 0, 510, 480, 1000, 1000, //
    1000, 500, 505, 300, 500, 1000, 1000, //
    1000, 1000, 1000, 1000, 1000, 1000, 1000,
];
const TRUTH: [u16; N] = [
    0, 0, 0, 0, 0, 0, 0, //
    0, 500, 500, 500, 500, 0, 0, //
    0, 500, 505, 510, 515, 0, 0, //
    0, 500, 505, 510, 515, 0, 0, //
    0, 500, 505, 510, 515, 0, 0, //
    0, 0, 0, 0, 0, 0, 0,
];
const ESTIMATE: [u16; N] = [
    0, 0, 0, 0, 0, 0, 0, //
    0, 0, 502, 504, 506, 540, 0, //
    0, 0, 507, 530, 519, 525, 0, //
    0, 0, 509, 512, 560, 527, 0, //
    0, 0, 509, 512, 514, 527, 0, //
    0, 0, 0, 0, 0, 0, 0,
];

fn distances(depths: &[u16; N], unit: f64) -> DistanceImage {
    let camera = PinholeCamera::new(10.0, 12.0, 3.0, 2.5, WIDTH, HEIGHT).unwrap();
    let pixels = (0..HEIGHT)
        .flat_map(|v| (0..WIDTH).map(move |u| (u, v)))
        .zip(depths)
        .map(|((u, v), z)| unit * f64::from(*z) * camera.distance_per_depth(u.into(), v.into()));
    DistanceImage::new(WIDTH, HEIGHT, pixels.collect()).unwrap()
}

fn mask(rows: [&str; 6]) -> Mask {
    let pixels = rows
        .iter()
        .flat_map(|row| row.chars().map(|c| c == '1'))
        .collect();
    Mask::new(WIDTH, HEIGHT, pixels).unwrap()
}

fn count(mask: &Mask) -> usize {
    mask.n_set()
}

fn assert_errors(found: [f64; N_TOLERANCES], expected: [f64; N_TOLERANCES]) {
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-15, "{found} {expected}");
    }
}

#[test]
fn the_golden_case_at_15_mm() {
    for unit in [1.0, 1e-3] {
        let [test, truth, estimate] =
            [TEST, TRUTH, ESTIMATE].map(|depths| distances(&depths, unit));
        let (v_estimate, v_truth) =
            visibility_masks(&test, &estimate, &truth, 15.0 * unit).unwrap();
        assert_eq!(
            v_truth,
            mask([
                "0000000", "0111100", "0111000", "0111000", "0110000", "0000000"
            ])
        );
        assert_eq!(
            v_estimate,
            mask([
                "0000000", "0011110", "0011010", "0011010", "0010110", "0000000"
            ])
        );
        let errors = vsd(&estimate, &v_estimate, &truth, &v_truth, 100.0 * unit).unwrap();
        let of = |n: u8| f64::from(n) / 17.0;
        let nine = of(9);
        let expected = [
            of(11),
            of(10),
            of(10),
            of(10),
            nine,
            nine,
            nine,
            nine,
            nine,
            nine,
        ];
        assert_errors(errors, expected);
        assert!((errors.iter().sum::<f64>() / 10.0 - 0.558_823_529_4).abs() < 1e-10);
    }
}

#[test]
fn the_golden_case_at_5_mm() {
    for unit in [1.0, 1e-3] {
        let [test, truth, estimate] =
            [TEST, TRUTH, ESTIMATE].map(|depths| distances(&depths, unit));
        let (v_estimate, v_truth) = visibility_masks(&test, &estimate, &truth, 5.0 * unit).unwrap();
        assert_eq!((count(&v_truth), count(&v_estimate)), (12, 12));
        let errors = vsd(&estimate, &v_estimate, &truth, &v_truth, 100.0 * unit).unwrap();
        assert_errors(
            errors,
            [0.625, 0.5625, 0.5625, 0.5625, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5],
        );
        assert!((errors.iter().sum::<f64>() / 10.0 - 0.531_25).abs() < 1e-12);
    }
}

#[test]
fn tolerances_are_multiples_of_a_twentieth() {
    for (k, tolerance) in (1_u8..).zip(tolerances()) {
        assert_eq!(tolerance.to_bits(), (f64::from(k) * 0.05).to_bits());
    }
    assert_eq!(tolerances().len(), N_TOLERANCES);
}

fn row(distances: &[f64]) -> DistanceImage {
    DistanceImage::new(
        u32::try_from(distances.len()).unwrap(),
        1,
        distances.to_vec(),
    )
    .unwrap()
}

#[test]
fn pitfall_24_a_difference_of_exactly_tau_is_wrong() {
    let full = Mask::full(1, 1);
    for (k, tolerance) in tolerances().into_iter().enumerate() {
        for (difference, correct_from) in [(tolerance.next_down(), k), (tolerance, k + 1)] {
            let errors = vsd(&row(&[difference]), &full, &row(&[0.0]), &full, 1.0).unwrap();
            for (i, error) in errors.into_iter().enumerate() {
                assert_eq!(
                    error,
                    if i >= correct_from { 0.0 } else { 1.0 },
                    "{difference} {i}"
                );
            }
        }
    }
}

#[test]
fn pitfall_24_empty_unions_and_disjoint_masks_are_all_wrong() {
    let image = row(&[0.5, 0.5]);
    let none = Mask::new(2, 1, vec![false; 2]).unwrap();
    let (left, right) = (
        Mask::new(2, 1, vec![true, false]).unwrap(),
        Mask::new(2, 1, vec![false, true]).unwrap(),
    );
    assert_eq!(
        vsd(&image, &none, &image, &none, 1.0).unwrap(),
        [1.0; N_TOLERANCES]
    );
    assert_eq!(
        vsd(&image, &left, &image, &right, 1.0).unwrap(),
        [1.0; N_TOLERANCES]
    );
    assert_eq!(
        vsd(&image, &none, &image, &right, 1.0).unwrap(),
        [1.0; N_TOLERANCES]
    );
    assert_eq!(
        vsd(&image, &left, &image, &left, 1.0).unwrap(),
        [0.0; N_TOLERANCES]
    );
}

#[test]
fn nan_agrees_with_nothing() {
    let full = Mask::full(1, 1);
    for (a, b) in [
        (f64::NAN, 0.5),
        (0.5, f64::NAN),
        (f64::INFINITY, f64::INFINITY),
        (f64::INFINITY, 0.5),
    ] {
        let errors = vsd(&row(&[a]), &full, &row(&[b]), &full, 1.0).unwrap();
        assert_eq!(errors, [1.0; N_TOLERANCES], "{a} {b}");
    }
}

#[test]
fn pitfall_24_missing_depth_is_visible_and_occluded_surface_is_not() {
    // The test distances: missing, far behind, δ in front of the surface, slightly more than δ,
    // equal.
    let test = row(&[0.0, 2.0, 0.75, 0.75, 1.0]);
    let truth = row(&[1.0, 1.0, 1.0, 1.000_001, 1.0]);
    let nothing = row(&[0.0; 5]);
    let (v_estimate, v_truth) = visibility_masks(&test, &nothing, &truth, 0.25).unwrap();
    assert_eq!(v_truth.pixels(), [true, true, true, false, true]);
    assert_eq!(v_estimate.pixels(), [false; 5]);
    // An estimate hidden by δ or more counts only where the truth is visible.
    let (v_estimate, v_truth) = visibility_masks(&test, &row(&[3.0; 5]), &truth, 0.25).unwrap();
    assert_eq!(v_estimate.pixels(), v_truth.pixels());
    let (v_estimate, _) = visibility_masks(&test, &row(&[3.0; 5]), &nothing, 0.25).unwrap();
    assert_eq!(v_estimate.pixels(), [true, false, false, false, false]);
}

#[test]
fn invalid_sizes_and_diameters_are_refused() {
    let (a, b) = (row(&[0.5; 3]), row(&[0.5; 2]));
    let (mask_a, mask_b) = (Mask::full(3, 1), Mask::full(2, 1));
    let size = |what| ScoreError::Size {
        what,
        found: (2, 1),
        expected: (3, 1),
    };
    assert_eq!(
        vsd(&a, &mask_b, &a, &mask_a, 1.0).unwrap_err(),
        size("mask of the estimate")
    );
    assert_eq!(
        vsd(&a, &mask_a, &b, &mask_a, 1.0).unwrap_err(),
        size("true distance image")
    );
    assert_eq!(
        vsd(&a, &mask_a, &a, &mask_b, 1.0).unwrap_err(),
        size("true mask")
    );
    assert_eq!(
        visibility_masks(&a, &b, &a, 1.0).unwrap_err(),
        size("estimated distance image")
    );
    assert_eq!(
        visibility_masks(&a, &a, &b, 1.0).unwrap_err(),
        size("true distance image")
    );
    for value in [0.0, -1.0, f64::INFINITY, f64::NAN] {
        let Err(ScoreError::Diameter { value: found }) = vsd(&a, &mask_a, &a, &mask_a, value)
        else {
            unreachable!("accepted {value}");
        };
        assert_eq!(found.to_bits(), value.to_bits());
    }
    let error = ImageError::PixelCount {
        width: 1,
        height: 1,
        expected: 1,
        found: 2,
    };
    assert_eq!(
        ScoreError::from(error.clone()).to_string(),
        error.to_string()
    );
}

/// An image of a dozen pixels: the distance, and whether the pixel is in the mask.
fn side() -> impl Strategy<Value = Vec<(f64, bool)>> {
    proptest::collection::vec((0.4_f64..0.6, proptest::bool::ANY), 12)
}

fn images(side: &[(f64, bool)], unit: f64) -> (DistanceImage, Mask) {
    let distances: Vec<f64> = side.iter().map(|(d, _)| d * unit).collect();
    let mask = Mask::new(12, 1, side.iter().map(|(_, set)| *set).collect()).unwrap();
    (row(&distances), mask)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(256) })]

    #[test]
    fn vsd_equals_its_definition_is_symmetric_and_falls_with_tau(a in side(), b in side(), diameter in 0.05_f64..0.6) {
        let ((da, ma), (db, mb)) = (images(&a, 1.0), images(&b, 1.0));
        let errors = vsd(&da, &ma, &db, &mb, diameter).unwrap();
        prop_assert_eq!(errors, vsd(&db, &mb, &da, &ma, diameter).unwrap());
        let union = a.iter().zip(&b).filter(|(a, b)| a.1 || b.1).count();
        for (error, tau) in errors.into_iter().zip(tolerances()) {
            let wrong = a.iter().zip(&b).filter(|(a, b)| {
                (a.1 || b.1) && !(a.1 && b.1 && (a.0 - b.0).abs() / diameter < tau)
            });
            let expected = if union == 0 { 1.0 } else { wrong.count() as f64 / union as f64 };
            prop_assert!((error - expected).abs() < 1e-15, "{} {}", error, expected);
            prop_assert!((0.0..=1.0).contains(&error));
        }
        prop_assert!(errors.windows(2).all(|pair| pair[1] <= pair[0]));
        if ma.pixels().contains(&true) {
            prop_assert_eq!(vsd(&da, &ma, &da, &ma, diameter).unwrap(), [0.0; N_TOLERANCES]);
        }
    }

    #[test]
    fn vsd_does_not_depend_on_the_unit(a in side(), b in side(), test in side(), power in -12_i32..12) {
        // Powers of two scale without rounding, so that even ties are decided alike.
        let unit = 2_f64.powi(power);
        let score = |unit: f64| {
            let [a, b, test] = [&a, &b, &test].map(|side| images(side, unit).0);
            let (ma, mb) = visibility_masks(&test, &a, &b, 0.0625 * unit).unwrap();
            (vsd(&a, &ma, &b, &mb, 0.25 * unit).unwrap(), ma, mb)
        };
        prop_assert_eq!(score(unit), score(1.0));
    }
}

//! Tests of matching and recalls, on cases small enough to count by hand.

use hicp_score::{PoseErrors, Recalls, TargetErrors, match_instances, most_visible, top_estimates};

const DIAMETER: f64 = 0.2;

/// Returns errors that are the same share of the units of their thresholds: the diameter, and 100
/// pixels.
fn errors(share: f64) -> PoseErrors {
    PoseErrors {
        vsd: [share; 10],
        mssd_m: share * DIAMETER,
        mspd_px: share * 100.0,
        add_m: share * DIAMETER,
        adi_m: share * DIAMETER,
        translation_m: 0.0,
    }
}

fn target(instances: usize, estimates: Vec<Vec<PoseErrors>>) -> TargetErrors {
    TargetErrors {
        diameter_m: DIAMETER,
        image_width: 640,
        symmetric: false,
        instances,
        estimates,
    }
}

fn recalls(targets: &[TargetErrors]) -> Recalls {
    let mut recalls = Recalls::default();
    for target in targets {
        recalls.count(target);
    }
    recalls
}

/// Returns AR_VSD, AR_MSSD, AR_MSPD and the recall of AD.
fn all(recalls: &Recalls) -> [f64; 4] {
    [recalls.vsd(), recalls.mssd(), recalls.mspd(), recalls.ad()]
}

#[track_caller]
fn assert_all(found: &Recalls, expected: [f64; 4]) {
    for (found, expected) in all(found).into_iter().zip(expected) {
        assert!((found - expected).abs() < 1e-15, "{found} {expected}");
    }
}

#[test]
fn a_perfect_estimate_is_found_at_every_threshold() {
    let perfect = recalls(&[target(1, vec![vec![errors(0.0)]])]);
    assert_all(&perfect, [1.0; 4]);
    assert!((perfect.average() - 1.0).abs() < 1e-15);
    assert_eq!((perfect.instances(), perfect.missing()), (1, 0));
}

#[test]
fn correct_errors_are_strictly_below_the_threshold() {
    // 0.12 lies below the thresholds 0.15, …, 0.50: eight of ten.
    assert_all(
        &recalls(&[target(1, vec![vec![errors(0.12)]])]),
        [0.8, 0.8, 0.8, 0.0],
    );
    assert_all(
        &recalls(&[target(1, vec![vec![errors(0.099)]])]),
        [0.9, 0.9, 0.9, 1.0],
    );
    // 0.25 is exact in binary and not below itself: 0.30, …, 0.50.
    let exact = recalls(&[target(1, vec![vec![errors(0.25)]])]);
    assert_all(&exact, [0.5, 0.5, 0.5, 0.0]);
    assert_all(&recalls(&[target(1, vec![vec![errors(0.5)]])]), [0.0; 4]);
}

#[test]
fn every_tolerance_of_vsd_counts_separately() {
    let mut one = errors(0.0);
    // Below all ten thresholds at eight tolerances, below nine at the others.
    one.vsd[0] = 0.07;
    one.vsd[1] = 0.07;
    let found = recalls(&[target(1, vec![vec![one]])]);
    assert!((found.vsd() - 0.98).abs() < 1e-15);
    assert!((found.average() - (0.98 + 2.0) / 3.0).abs() < 1e-15);
}

#[test]
fn mspd_refers_to_images_640_pixels_wide() {
    let mut wide = target(1, vec![vec![errors(0.12)]]);
    // 12 pixels are 6 in an image half as wide: below 10, …, 50.
    wide.image_width = 1280;
    assert_all(&recalls(&[wide]), [0.8, 0.8, 0.9, 0.0]);
}

#[test]
fn ad_is_adi_for_symmetric_objects() {
    let mut turned = errors(0.3);
    turned.adi_m = 0.0;
    let mut one = target(1, vec![vec![turned]]);
    assert_eq!(recalls(std::slice::from_ref(&one)).ad(), 0.0);
    one.symmetric = true;
    assert_eq!(recalls(&[one]).ad(), 1.0);
}

#[test]
fn mssd_counts_at_a_tenth_of_the_diameter_and_in_millimeters() {
    let mut one = errors(0.06);
    one.mssd_m = 0.0075;
    one.add_m = 0.0;
    let mut other = target(1, vec![vec![one]]);
    let found = recalls(std::slice::from_ref(&other));
    assert_eq!(
        found.mssd_below_tenth(),
        f64::from(u8::from(0.0075 < 0.1 * DIAMETER))
    );
    assert_eq!(found.mssd_mm()[..4], [0.0, 0.0, 0.0, 1.0]);
    assert_eq!(found.add(), Some(1.0));
    // ADD says nothing about symmetric objects.
    other.symmetric = true;
    assert_eq!(recalls(std::slice::from_ref(&other)).add(), None);
    let mut both = recalls(&[target(3, vec![vec![one]])]);
    both.merge(&recalls(&[other]));
    assert_eq!(both.add(), Some(1.0 / 3.0));
    assert_eq!(both.mssd_mm()[9], 0.5);
}

#[test]
fn estimates_a_diameter_apart_are_wrong_for_every_error() {
    let mut apart = errors(0.0);
    apart.translation_m = DIAMETER;
    let found = recalls(&[target(1, vec![vec![apart]])]);
    assert_all(&found, [1.0, 0.0, 1.0, 0.0]);
    apart.translation_m = 0.99 * DIAMETER;
    assert_all(&recalls(&[target(1, vec![vec![apart]])]), [1.0; 4]);
}

#[test]
fn missing_estimates_count_as_not_found_and_recalls_are_not_averaged() {
    // One of one, and one of three: two of four, and not the mean of 1 and 1/3.
    let full = target(1, vec![vec![errors(0.0)]]);
    let sparse = target(3, vec![vec![errors(0.0); 3]]);
    let mut together = recalls(std::slice::from_ref(&full));
    assert_eq!(recalls(std::slice::from_ref(&sparse)).missing(), 2);
    together.merge(&recalls(std::slice::from_ref(&sparse)));
    assert_all(&together, [0.5; 4]);
    assert_eq!(together, recalls(&[full, sparse]));
    assert_eq!((together.instances(), together.missing()), (4, 2));
    assert_all(&recalls(&[target(2, Vec::new())]), [0.0; 4]);
    assert_all(&Recalls::default(), [0.0; 4]);
}

#[test]
fn an_instance_is_found_only_once() {
    // Both estimates are right about the first instance and wrong about the second.
    let twice = vec![
        vec![errors(0.0), errors(1.0)],
        vec![errors(0.01), errors(1.0)],
    ];
    assert_all(&recalls(&[target(2, twice)]), [0.5; 4]);
}

#[test]
fn matching_is_greedy_by_score() {
    // The first estimate selects its nearest instance, although the second has no alternative.
    let greedy = [vec![0.1, 0.2], vec![0.05, 9.0]];
    assert_eq!(match_instances(&greedy, 2, 0.5), [Some(0), None]);
    // In the opposite order, both are matched.
    let turned = [vec![0.05, 9.0], vec![0.1, 0.2]];
    assert_eq!(match_instances(&turned, 2, 0.5), [Some(0), Some(1)]);
    // The threshold is strict. Of equal errors, the first instance is selected. Infinity and NaN
    // match nothing.
    assert_eq!(match_instances(&[vec![0.5, 0.5]], 2, 0.5), [None, None]);
    assert_eq!(match_instances(&[vec![0.4, 0.4]], 2, 0.5), [Some(0), None]);
    let useless = [vec![f64::INFINITY, f64::NAN]];
    assert_eq!(match_instances(&useless, 2, f64::INFINITY), [None, None]);
    assert_eq!(match_instances(&[], 1, 0.5), [None]);
}

#[test]
fn the_best_scores_and_the_most_visible_are_selected() {
    assert_eq!(top_estimates(&[0.2, 0.9, 0.5], 2), [1, 2]);
    // Of equal scores, the first one.
    assert_eq!(top_estimates(&[0.5, 0.9, 0.5, 0.5], 3), [1, 0, 2]);
    assert_eq!(most_visible(&[0.1, 0.3], 5), [1, 0]);
    assert!(most_visible(&[0.1], 0).is_empty());
}

#[test]
fn instances_have_the_adi_of_their_estimate() {
    let two = target(
        2,
        vec![
            vec![errors(0.3), errors(0.1)],
            vec![errors(0.2), errors(0.0)],
        ],
    );
    let found = two.adi_of_instances();
    // The best score selects the second instance, and the other estimate gets the remaining one.
    assert_eq!(found, [Some(0.2 * DIAMETER), Some(0.1 * DIAMETER)]);
    assert_eq!(target(1, Vec::new()).adi_of_instances(), [None]);
}

#[test]
fn origins_are_apart_from_a_diameter_on_and_for_nan() {
    let at = |translation_m| PoseErrors {
        translation_m,
        ..errors(0.0)
    };
    assert!(!at(0.0).is_apart(DIAMETER));
    assert!(!at(DIAMETER * (1.0 - 1e-12)).is_apart(DIAMETER));
    assert!(at(DIAMETER).is_apart(DIAMETER));
    assert!(at(f64::INFINITY).is_apart(DIAMETER));
    assert!(at(f64::NAN).is_apart(DIAMETER));
}

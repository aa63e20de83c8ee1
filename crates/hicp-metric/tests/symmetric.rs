//! The symmetric metric: exact in one step, and what it skips.
#![allow(clippy::unwrap_used)]

mod scenes;

use hicp_core::{Correspondences, Isometry3, Vector3};
use hicp_metric::{ErrorMetric, PointToPlane, Symmetric};
use scenes::{Numbers, advanced, center, difference, ellipsoid, exact, messy, surfel};

#[test]
fn exact_pairs_are_aligned_in_one_step() {
    let mut numbers = Numbers(21);
    for degrees in [0.0, 0.1, 5.0, 15.0, 30.0, 60.0] {
        for _ in 0..10 {
            let source = ellipsoid(&mut numbers, 300);
            let motion = numbers.motion(&center(), degrees, 0.05);
            let pairs = exact(&source, &motion);
            let step = Symmetric.minimize(&pairs).unwrap();
            let (angle, distance) = difference(&step.increment, &motion);
            // Points rounded to f32 at 0.6 m: 3e-8 m against 5 cm.
            assert!(
                angle < 2e-6 && distance < 2e-7,
                "{degrees}: {angle} {distance}"
            );
        }
    }
    // Point-to-plane is not: that is the point.
    let source = ellipsoid(&mut numbers, 300);
    let motion = numbers.motion(&center(), 30.0, 0.0);
    let linear = PointToPlane.minimize(&exact(&source, &motion)).unwrap();
    assert!(difference(&linear.increment, &motion).0 > 0.01);
}

#[test]
fn weights_count_and_its_minimum_is_that_of_its_rows() {
    let mut numbers = Numbers(22);
    let mut pairs = messy(&mut numbers, 200);
    // Repeated steps come to rest where the gradient of the linearised rows vanishes, up to terms of the residuals.
    for _ in 0..30 {
        let step = Symmetric.minimize(&pairs).unwrap();
        pairs = advanced(&pairs, &step.increment);
    }
    let system = Symmetric.system(&pairs).unwrap();
    let rest = system.solve().unwrap();
    let (angle, distance) = difference(&rest, &Isometry3::identity());
    assert!(angle < 5e-3 && distance < 3e-4, "{angle} {distance}");
    // A pair of weight zero is not there.
    let mut with = messy(&mut numbers, 50);
    let without: Correspondences = with.as_slice()[..40].iter().copied().collect();
    for pair in &mut with.as_mut_slice()[40..] {
        pair.weight = 0.0;
    }
    let (a, b) = (
        Symmetric.minimize(&with).unwrap(),
        Symmetric.minimize(&without).unwrap(),
    );
    assert!((a.mean_loss - b.mean_loss).abs() < 1e-15);
    assert!(difference(&a.increment, &b.increment).0 < 1e-12);
}

#[test]
fn pairs_that_see_different_sides_count_for_nothing() {
    let mut numbers = Numbers(23);
    let pairs = messy(&mut numbers, 60);
    let mut more = pairs.clone();
    for _ in 0..20 {
        let mut wrong = pairs.as_slice()[0];
        wrong.target = surfel(
            center() + numbers.vector(),
            -wrong.source.normal.cast::<f64>().into_inner(),
        );
        assert_eq!(Symmetric.squared_error(&wrong), 0.0);
        more.push(wrong);
    }
    assert_eq!(Symmetric.minimize(&more), Symmetric.minimize(&pairs));
    assert_eq!(Symmetric.mean_loss(&more), Symmetric.mean_loss(&pairs));
    // Perpendicular ones too, and nothing else left is no step.
    let source = surfel(center(), Vector3::x());
    let across = hicp_core::Pair::new(0, source, 0, surfel(center(), Vector3::y()));
    let only: Correspondences = [across; 20].into_iter().collect();
    assert_eq!(Symmetric.minimize(&only), None);
    assert_eq!(Symmetric.mean_loss(&only), None);
}

#[test]
fn a_plane_comes_down_without_sliding() {
    let mut numbers = Numbers(24);
    let source: Vec<_> = (0..200)
        .map(|_| {
            let offset = Vector3::new(numbers.sign() * 0.1, numbers.sign() * 0.1, 0.0);
            surfel(center() + offset, -Vector3::z())
        })
        .collect();
    // The counterparts are elsewhere on the plane: point pairs would slide by 4 cm.
    let pairs = exact(&source, &Isometry3::translation(0.04, 0.0, 0.005));
    let step = Symmetric.minimize(&pairs).unwrap();
    let expected = Isometry3::translation(0.0, 0.0, 0.005);
    let (angle, distance) = difference(&step.increment, &expected);
    assert!(angle < 1e-6 && distance < 1e-7, "{angle} {distance}");
}

//! Tests that only ratios of weights and only ratios of lengths matter.

use crate::scenes::{AtStart, Numbers, carried, center, exact, messy, resized, surfel};
use hicp_core::{Correspondences, Isometry3, Vector3};
use hicp_metric::Minimize;
use hicp_metric::{
    Conditioned, Degeneracy, Frozen, GaussNewton, Generalized, Kernel, LevenbergMarquardt,
    PlaneToPoint, PointToPlane, PointToPoint, Robust, Scale, Symmetric, WeightedSum,
    sandwich_covariance,
};

/// 2⁻⁴⁰ and 2⁴⁰: far from 1, and without rounding.
const FACTORS: [f32; 2] = [1.0 / 1_099_511_627_776.0, 1_099_511_627_776.0];

fn weighing(pairs: &Correspondences, factor: f32) -> Correspondences {
    let mut pairs = pairs.clone();
    for pair in pairs.as_mut_slice() {
        pair.weight *= factor;
    }
    pairs
}

/// A plane not along an axis, lifted by 4 mm, with counterparts elsewhere on it.
fn plane(numbers: &mut Numbers) -> Correspondences {
    let source: Vec<_> = (0..200)
        .map(|_| Vector3::new(numbers.sign(), numbers.sign(), 0.0) * 0.1)
        .map(|offset| surfel(center() + offset, -Vector3::z()))
        .collect();
    let motion = numbers.motion(&center(), 70.0, 0.2);
    carried(
        &exact(&source, &Isometry3::translation(0.03, 0.01, 0.004)),
        &motion,
    )
}

fn conditioned(policy: Degeneracy) -> Box<dyn Minimize> {
    Box::new(Conditioned {
        metric: PointToPlane,
        policy,
        threshold: Degeneracy::THRESHOLD,
    })
}

/// Metrics without a parameter that is a length.
fn metrics() -> Vec<Box<dyn Minimize>> {
    let scale = Scale::Mad { floor_meters: 0.0 };
    vec![
        Box::new(PointToPoint),
        Box::new(PointToPlane),
        Box::new(PlaneToPoint),
        Box::new(Symmetric),
        Box::new(Generalized::default()),
        Box::new(WeightedSum {
            terms: ((1.0, PointToPlane), (0.1, PointToPoint)),
        }),
        Box::new(WeightedSum {
            terms: vec![(1.0, PointToPlane), (0.5, PointToPlane)],
        }),
        Box::new(Robust::new(PointToPlane, Kernel::default(), scale)),
        Box::new(Frozen {
            metric: PointToPlane,
            rotation: [false, true, false],
            ..Frozen::default()
        }),
        conditioned(Degeneracy::Damp),
        conditioned(Degeneracy::Freeze),
        conditioned(Degeneracy::Refuse),
        Box::new(GaussNewton::new(PointToPlane)),
        Box::new(LevenbergMarquardt::new(PointToPlane)),
    ]
}

#[test]
fn steps_depend_only_on_the_ratios_of_weights() {
    let mut numbers = Numbers(301);
    for pairs in [messy(&mut numbers, 60), plane(&mut numbers)] {
        for factor in FACTORS {
            let heavy = weighing(&pairs, factor);
            for mut metric in metrics() {
                let (name, step) = (metric.label(), metric.step(&pairs));
                let same = metric.step(&heavy);
                assert_eq!(step.is_some(), same.is_some(), "{name} {factor}");
                let (Some(a), Some(b)) = (step, same) else {
                    continue;
                };
                let (angle, distance) = crate::scenes::difference(&a.increment, &b.increment);
                assert!(angle < 1e-12 && distance < 1e-12, "{name} {factor}");
                assert!((a.mean_loss - b.mean_loss).abs() <= 1e-12 * a.mean_loss);
            }
        }
    }
}

#[test]
fn covariances_depend_only_on_the_ratios_of_weights() {
    let mut numbers = Numbers(302);
    let pairs = messy(&mut numbers, 60);
    for factor in FACTORS {
        let heavy = weighing(&pairs, factor);
        let plain = |pairs| {
            PointToPlane
                .normal_equations(pairs)
                .unwrap()
                .covariance()
                .unwrap()
        };
        let (a, b) = (plain(&pairs), plain(&heavy));
        assert!((a - b).amax() <= 1e-12 * a.amax(), "{factor}");
        let sandwich = |pairs| sandwich_covariance(&PointToPlane, pairs).unwrap();
        let (a, b) = (sandwich(&pairs), sandwich(&heavy));
        assert!((a - b).amax() <= 1e-12 * a.amax(), "{factor}");
    }
}

/// From a tenth of a millimeter to a hundred kilometers.
#[test]
fn steps_depend_only_on_the_ratios_of_lengths() {
    let mut numbers = Numbers(303);
    let pairs = messy(&mut numbers, 60);
    for factor in [1.0 / 1024.0, 1024.0, 1_048_576.0, 1.0 / 64.0] {
        let resized = resized(&pairs, factor);
        for mut metric in metrics() {
            let (name, a) = (metric.label(), metric.step(&pairs).unwrap());
            let b = metric.step(&resized).unwrap();
            let turn = a.increment.rotation.inverse() * b.increment.rotation;
            assert!(turn.angle() < 1e-14, "{name} {factor}: {}", turn.angle());
            let factor = f64::from(factor);
            let shift = b.increment.translation.vector / factor;
            assert!((shift - a.increment.translation.vector).norm() < 1e-14);
            let loss = b.mean_loss / factor.powi(2);
            assert!((loss - a.mean_loss).abs() < 1e-14 * a.mean_loss);
        }
    }
}

//! Tests of outlier filters: their limits and their chains.

use crate::support::{Numbers, cuboid, depth_image};
use hicp_association::{MaxDistance, MaxNormalAngle, OutlierFilter};
use hicp_core::Iteration;
use hicp_core::{
    Correspondences, Mask, Model, ModelConfig, Observation, Pair, PinholeCamera, Point3, Problem,
    Surfel, UnitVector3, Vector3,
};

fn observation() -> Observation {
    let camera = PinholeCamera::new(10.0, 10.0, 3.5, 3.5, 8, 8).unwrap();
    Observation::new(depth_image(&camera, |_| 1.0), Mask::full(8, 8), camera).unwrap()
}

fn pair(distance: f32, angle: f64) -> Pair {
    let surfel = |x, angle: f64| Surfel {
        point: Point3::new(x, 0.0, 1.0),
        normal: UnitVector3::new_unchecked(
            Vector3::new(angle.sin(), 0.0, -angle.cos()).cast::<f32>(),
        ),
    };
    Pair {
        source: surfel(0.0, 0.0),
        target: surfel(distance, angle),
        weight: 1.0,
        source_index: 0,
        target_index: 0,
    }
}

fn kept(filter: &mut dyn OutlierFilter, pairs: &[Pair]) -> Vec<u32> {
    let mut pairs: Correspondences = (0..)
        .zip(pairs)
        .map(|(i, p)| Pair {
            source_index: i,
            ..*p
        })
        .collect();
    let config = ModelConfig {
        diameter: Some(0.5),
        ..ModelConfig::default()
    };
    let (model, observation) = (
        Model::with_config(cuboid(0.1, 0.1, 0.1), config),
        observation(),
    );
    filter.filter(&at(Problem::new(&model, &observation)), &mut pairs);
    pairs.as_slice().iter().map(|p| p.source_index).collect()
}

#[test]
fn distances_up_to_the_limit_are_kept() {
    let limit = 0.125_f32;
    let pairs = [0.0, limit.next_down(), limit, limit.next_up(), 1.0].map(|d| pair(d, 0.0));
    assert_eq!(
        kept(&mut MaxDistance::meters(f64::from(limit)), &pairs),
        [0, 1, 2]
    );
    // A quarter of a diameter of 0.5 m.
    assert_eq!(kept(&mut MaxDistance::diameters(0.25), &pairs), [0, 1, 2]);
    assert_eq!(
        kept(&mut MaxDistance::meters(f64::INFINITY), &pairs),
        [0, 1, 2, 3, 4]
    );
    assert_eq!(kept(&mut MaxDistance::meters(0.0), &pairs), [0]);
    for none in [-1.0, f64::NAN] {
        assert_eq!(kept(&mut MaxDistance::meters(none), &pairs), [0_u32; 0]);
        assert_eq!(kept(&mut MaxDistance::diameters(none), &pairs), [0_u32; 0]);
    }
}

#[test]
fn angles_up_to_the_limit_are_kept() {
    let degrees = [0.0, 29.9, 30.0, 30.1, 89.9, 90.1, 179.9, 180.0];
    let pairs = degrees.map(|d: f64| pair(0.0, d.to_radians()));
    let at = |limit| kept(&mut MaxNormalAngle::degrees(limit), &pairs);
    assert_eq!(at(30.0), [0, 1, 2]);
    assert_eq!(at(90.0), [0, 1, 2, 3, 4]);
    assert_eq!(at(0.0), [0]);
    for all in [180.0, 360.0, f64::INFINITY] {
        assert_eq!(at(all), [0, 1, 2, 3, 4, 5, 6, 7]);
    }
    for none in [-1.0, f64::NAN] {
        assert_eq!(at(none), [0_u32; 0]);
    }
}

#[test]
fn limits_of_0_and_180_degrees_allow_for_rounding() {
    let mut numbers = Numbers(221);
    let mut pairs = Vec::new();
    for _ in 0..200 {
        let mut pair = pair(0.0, 0.0);
        let normal = UnitVector3::new_normalize(numbers.vector().cast::<f32>());
        (pair.source.normal, pair.target.normal) = (normal, normal);
        pairs.push(pair);
    }
    assert_eq!(kept(&mut MaxNormalAngle::degrees(0.0), &pairs).len(), 200);
    pairs
        .iter_mut()
        .for_each(|p| p.target.normal = -p.target.normal);
    assert_eq!(kept(&mut MaxNormalAngle::degrees(180.0), &pairs).len(), 200);
    assert_eq!(kept(&mut MaxNormalAngle::degrees(179.0), &pairs).len(), 0);
}

/// Doubles the weights, which counts the calls per pair.
struct Doubling;

impl OutlierFilter for Doubling {
    fn filter(&mut self, _: &Iteration<'_>, pairs: &mut Correspondences) {
        pairs
            .as_mut_slice()
            .iter_mut()
            .for_each(|p| p.weight *= 2.0);
    }
}

/// Keeps the first half.
struct Half;

impl OutlierFilter for Half {
    fn filter(&mut self, _: &Iteration<'_>, pairs: &mut Correspondences) {
        let keep = pairs.len() / 2;
        let mut seen = 0;
        pairs.retain(|_| {
            seen += 1;
            seen <= keep
        });
    }
}

#[test]
fn tuples_apply_their_members_in_order() {
    let mut numbers = Numbers(222);
    let pairs: Vec<Pair> = (0..64)
        .map(|_| pair(numbers.between(0.0, 0.2) as f32, numbers.between(0.0, 2.0)))
        .collect();
    let in_turn = |filters: &mut [&mut dyn OutlierFilter]| {
        let mut left: Vec<(u32, Pair)> = (0..).zip(pairs.iter().copied()).collect();
        for filter in filters {
            let now: Vec<Pair> = left.iter().map(|(_, p)| *p).collect();
            left = kept(*filter, &now)
                .iter()
                .map(|i| left[*i as usize])
                .collect();
        }
        left.iter().map(|(i, _)| *i).collect::<Vec<u32>>()
    };
    let (mut distance, mut angle) = (MaxDistance::meters(0.1), MaxNormalAngle::degrees(60.0));
    // `Half` does not commute with the others, so the order matters.
    let a = kept(&mut (distance, angle, Half), &pairs);
    assert_eq!(a, in_turn(&mut [&mut distance, &mut angle, &mut Half]));
    let b = kept(&mut (Half, angle, distance), &pairs);
    assert_eq!(b, in_turn(&mut [&mut Half, &mut angle, &mut distance]));
    assert_ne!(a, b, "the fixture must distinguish orders");
    assert_eq!(kept(&mut (Half, Half, Half, Half, Half, Half), &pairs), [0]);
    assert_eq!(kept(&mut (), &pairs).len(), 64);
    assert_eq!(kept(&mut (distance,), &pairs), kept(&mut distance, &pairs));
    assert_eq!(kept(&mut None::<MaxDistance>, &pairs).len(), 64);
    assert_eq!(
        kept(&mut Some(distance), &pairs),
        kept(&mut distance, &pairs)
    );
    let mut boxed: Box<dyn OutlierFilter> = Box::new((distance, angle));
    assert_eq!(
        kept(&mut boxed, &pairs),
        kept(&mut (distance, angle), &pairs)
    );
}

#[test]
fn filters_may_change_weights_and_keep_the_order() {
    let mut pairs: Correspondences = (0..5)
        .map(|i| Pair {
            source_index: i,
            ..pair(0.0, 0.0)
        })
        .collect();
    let (model, observation) = (Model::new(cuboid(0.1, 0.1, 0.1)), observation());
    (Doubling, Doubling).filter(&at(Problem::new(&model, &observation)), &mut pairs);
    assert!(pairs.as_slice().iter().all(|p| p.weight == 4.0));
    assert!(pairs.as_slice().iter().map(|p| p.source_index).eq(0..5));
}

/// Returns the first iteration of a stage over a problem.
fn at(problem: Problem<'_>) -> Iteration<'_> {
    Iteration::new(0, &hicp_core::Isometry3::identity(), problem)
}

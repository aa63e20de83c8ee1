//! Tests of filters and weights against their definitions.

// References are written like the definitions. Their cost does not matter, since tests are small.

use std::sync::OnceLock;

use crate::common::{Scene, ball_scene};
use crate::support::Numbers;
use hicp_association::{
    BoundaryTargets, ConstantWeight, DistanceWeight, Length, MadDistance, MaxDistance,
    MaxNormalAngle, MedianDistance, MinPairs, NormalWeight, OneToOne, OutlierFilter, SensorNoise,
    SensorNoiseWeight, Stride, Trimmed, VarTrimmed,
};
use hicp_core::{Pair, Point3, Surfel, UnitVector3, Vector3};
use proptest::prelude::*;

fn scene() -> &'static Scene {
    static SCENE: OnceLock<Scene> = OnceLock::new();
    SCENE.get_or_init(ball_scene)
}

fn run(mut filter: impl OutlierFilter, pairs: &[Pair]) -> Vec<Pair> {
    scene().filter(&mut filter, pairs)
}

/// Pairs at the given distances, each with its own source and target index and a weight of 2.
fn pairs_at(distances: &[f32]) -> Vec<Pair> {
    (0..)
        .zip(distances)
        .map(|(i, distance)| {
            let target = Surfel {
                point: Point3::new(0.0, 0.0, 0.5),
                normal: -Vector3::z_axis(),
            };
            // Away from the z axis, where the sum of squares keeps small distances exact.
            let source = Surfel {
                point: Point3::new(*distance, 0.0, 0.5),
                ..target
            };
            Pair {
                weight: 2.0,
                ..Pair::new(i, source, i, target)
            }
        })
        .collect()
}

fn indices(pairs: &[Pair]) -> Vec<u32> {
    pairs.iter().map(|p| p.source_index).collect()
}

/// Filters that depend on distances, with their defaults.
fn distance_filters() -> Vec<Box<dyn OutlierFilter>> {
    vec![
        Box::new(MaxDistance(Length::Meters(f64::INFINITY))),
        Box::new(MedianDistance::default()),
        Box::new(MadDistance::default()),
        Box::new(MadDistance::new(3.0, 0.0)),
        Box::new(Trimmed::default()),
        Box::new(VarTrimmed::default()),
        Box::new(OneToOne::new()),
        Box::new(DistanceWeight::default()),
    ]
}

fn all_filters() -> Vec<Box<dyn OutlierFilter>> {
    let mut filters = distance_filters();
    filters.push(Box::new(MaxNormalAngle::degrees(60.0)));
    filters.push(Box::new(BoundaryTargets::default()));
    filters.push(Box::new(MinPairs::default()));
    filters.push(Box::new(ConstantWeight::default()));
    filters.push(Box::new(NormalWeight));
    filters.push(Box::new(SensorNoiseWeight::default()));
    filters
}

#[test]
fn equal_distances_are_all_kept() {
    for distances in [
        vec![0.0; 30],
        vec![0.003; 30],
        vec![0.7; 1],
        vec![0.0],
        vec![],
    ] {
        for mut filter in distance_filters() {
            let kept = scene().filter(&mut filter, &pairs_at(&distances));
            assert_eq!(kept.len(), distances.len(), "{distances:?}");
        }
    }
}

#[test]
fn distances_that_are_not_finite_are_removed_and_ignored() {
    let distances = [
        0.002,
        f32::NAN,
        0.001,
        f32::INFINITY,
        0.0015,
        f32::INFINITY,
        f32::NAN,
        0.0011,
    ];
    let finite: Vec<f32> = distances.into_iter().filter(|d| d.is_finite()).collect();
    for mut filter in distance_filters() {
        let kept = scene().filter(&mut filter, &pairs_at(&distances));
        let expected = scene().filter(&mut filter, &pairs_at(&finite));
        let of = |pairs: &[Pair]| pairs.iter().map(Pair::distance).collect::<Vec<_>>();
        assert_eq!(of(&kept), of(&expected));
        assert!(!kept.is_empty());
        let kept = scene().filter(&mut filter, &pairs_at(&[f32::INFINITY; 5]));
        assert!(kept.is_empty());
    }
}

#[test]
fn weights_stay_finite_and_not_negative() {
    let mut random = Numbers(3);
    let mut pairs: Vec<Pair> = (0..50)
        .map(|i| Pair::new(i, random.surfel(0.5), i % 7, random.surfel(0.5)))
        .collect();
    pairs[3].source.point.x = f32::NAN;
    pairs[4].target.point.z = f32::INFINITY;
    pairs[5].target.point.z = f32::NAN;
    pairs[6].target.normal = UnitVector3::new_unchecked(Vector3::repeat(f32::NAN));
    let noise = SensorNoise {
        constant: f64::NAN,
        linear: f64::INFINITY,
        ..SensorNoise::stereo()
    };
    let mut filters = all_filters();
    filters.push(Box::new(SensorNoiseWeight { noise }));
    filters.push(Box::new(ConstantWeight { weight: f64::NAN }));
    filters.push(Box::new(ConstantWeight { weight: -1.0 }));
    for (name, mut filter) in filters.into_iter().enumerate() {
        for list in [&pairs[..], &pairs[..1], &[]] {
            for pair in scene().filter(&mut filter, list) {
                assert!(
                    pair.weight.is_finite() && pair.weight >= 0.0,
                    "{name} {pair:?}"
                );
            }
        }
    }
}

/// Returns the sorted distances.
fn sorted(distances: &[f32]) -> Vec<f32> {
    let mut sorted = distances.to_vec();
    sorted.sort_by(f32::total_cmp);
    sorted
}

fn within(pairs: &[Pair], limit: f32) -> Vec<Pair> {
    let near = pairs.iter().filter(|p| p.distance() <= limit);
    near.copied().collect()
}

fn distances() -> impl Strategy<Value = Vec<f32>> {
    // Integer millimeters, so that many are equal.
    prop::collection::vec((0_u16..40).prop_map(|mm| f32::from(mm) * 0.001), 1..120)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn median_and_mad_equal_their_definitions(d in distances(), factor in 0.0_f32..4.0, floor in 0.0_f32..0.01) {
        let pairs = pairs_at(&d);
        let median = |values: &[f32]| sorted(values)[values.len() / 2];
        let center = median(&d);
        prop_assert_eq!(run(MedianDistance::new(f64::from(factor)), &pairs), within(&pairs, factor * center));
        let spread: Vec<f32> = d.iter().map(|d| (d - center).abs()).collect();
        let limit = center + factor * (1.4826 * median(&spread)).max(floor);
        prop_assert_eq!(run(MadDistance::new(f64::from(factor), f64::from(floor)), &pairs), within(&pairs, limit));
    }

    #[test]
    fn trimmed_keeps_the_closest_share(d in distances(), percent in 0_u8..110) {
        let pairs = pairs_at(&d);
        let kept = run(Trimmed::new(f64::from(percent) / 100.0), &pairs);
        // In integers: ⌈percent·n/100⌉
        let count = (usize::from(percent.min(100)) * d.len()).div_ceil(100);
        let limit = count.checked_sub(1).map_or(f32::NAN, |rank| sorted(&d)[rank]);
        prop_assert_eq!(&kept, &within(&pairs, limit));
        prop_assert!(kept.len() >= count);
    }

    #[test]
    fn var_trimmed_minimizes_the_fractional_rmsd(d in distances(), lambda in 0.1..3.0) {
        let pairs = pairs_at(&d);
        let kept = run(VarTrimmed::new(0.1, 0.9, lambda), &pairs);
        let (sorted, n) = (sorted(&d), d.len() as f64);
        let frmsd = |k: usize| {
            let sum: f64 = sorted[..k].iter().map(|d| f64::from(*d).powi(2)).sum();
            (k as f64 / n).powf(-lambda) * (sum / k as f64).sqrt()
        };
        let fewest = d.len().div_ceil(10);
        let most = (9 * d.len()).div_ceil(10).max(fewest);
        let best = (fewest..=most).map(frmsd).fold(f64::INFINITY, f64::min);
        let chosen = (fewest..=most).rev().find(|k| frmsd(*k) <= best * (1.0 + 1e-12)).unwrap();
        prop_assert_eq!(kept, within(&pairs, sorted[chosen - 1]));
    }

    #[test]
    fn one_to_one_keeps_the_closest_of_every_target(d in distances(), seed: u64) {
        let mut random = Numbers(seed);
        let mut pairs = pairs_at(&d);
        for pair in &mut pairs {
            pair.target_index = random.below(20) as u32;
        }
        let expected: Vec<Pair> = pairs.iter().enumerate().filter(|(i, pair)| {
            pairs.iter().enumerate().all(|(j, other)| {
                other.target_index != pair.target_index
                    || pair.distance() < other.distance()
                    || (pair.distance() == other.distance() && *i <= j)
            })
        }).map(|(_, pair)| *pair).collect();
        prop_assert_eq!(run(OneToOne::new(), &pairs), expected);
    }

    #[test]
    fn one_to_one_keeps_every_pair_whose_target_is_unlisted(d in distances()) {
        let mut pairs = pairs_at(&d);
        for pair in &mut pairs {
            pair.target_index = if pair.source_index % 3 == 0 { 7 } else { Pair::UNLISTED };
        }
        let kept = run(OneToOne::new(), &pairs);
        let unlisted = |pairs: &[Pair]| -> Vec<Pair> {
            pairs.iter().filter(|pair| pair.target_index == Pair::UNLISTED).copied().collect()
        };
        prop_assert_eq!(unlisted(&kept), unlisted(&pairs));
        prop_assert_eq!(kept.len() - unlisted(&kept).len(), 1.min(pairs.len()));
    }

    #[test]
    fn the_order_of_the_pairs_does_not_change_the_result(d in distances(), seed: u64) {
        let pairs = pairs_at(&d);
        let mut shuffled = pairs.clone();
        Numbers(seed).shuffle(&mut shuffled);
        for mut filter in all_filters() {
            let plain = scene().filter(&mut filter, &pairs);
            let mut other = scene().filter(&mut filter, &shuffled);
            let mut in_order = shuffled.iter().map(|p| p.source_index).filter(|i| indices(&plain).contains(i));
            prop_assert!(other.iter().all(|p| Some(p.source_index) == in_order.next()));
            other.sort_by_key(|p| p.source_index);
            for (a, b) in plain.iter().zip(&other) {
                prop_assert_eq!(a.source_index, b.source_index);
                prop_assert!((a.weight - b.weight).abs() < 1e-5);
            }
            prop_assert_eq!(plain.len(), other.len());
        }
    }
}

#[test]
fn parameters_out_of_range_act_as_documented() {
    let pairs = pairs_at(&[0.001, 0.002, 0.003, 0.004]);
    for nothing in [f64::NAN, -1.0] {
        assert!(run(MedianDistance::new(nothing), &pairs).is_empty());
        assert!(run(Trimmed::new(nothing), &pairs).is_empty());
        assert!(run(MaxDistance::meters(nothing), &pairs).is_empty());
        let weights = run(
            DistanceWeight {
                max: Length::Meters(nothing),
            },
            &pairs,
        );
        assert!(weights.len() == 4 && weights.iter().all(|p| p.weight == 0.0));
    }
    assert!(run(MadDistance::new(f64::NAN, 0.0), &pairs).is_empty());
    assert_eq!(run(MadDistance::new(0.0, f64::NAN), &pairs).len(), 3);
    assert!(run(Trimmed::new(0.0), &pairs).is_empty());
    assert_eq!(run(Trimmed::new(7.0), &pairs).len(), 4);
    assert_eq!(run(Trimmed::new(1.0e-6), &pairs).len(), 1);
    assert_eq!(run(VarTrimmed::new(0.5, 0.1, 0.95), &pairs).len(), 2);
    assert_eq!(
        run(VarTrimmed::new(f64::NAN, f64::NAN, 0.95), &pairs).len(),
        1
    );
    assert_eq!(run(VarTrimmed::new(0.1, 1.0, f64::NAN), &pairs).len(), 4);
}

#[test]
fn too_few_pairs_are_all_removed() {
    let pairs = pairs_at(&[0.001; 5]);
    assert_eq!(run(MinPairs { count: 5 }, &pairs), pairs);
    assert!(run(MinPairs { count: 6 }, &pairs).is_empty());
    assert!(run(MinPairs { count: 1 }, &[]).is_empty());
    let chain = (
        MaxDistance::meters(1.0),
        (),
        (),
        None::<()>,
        (),
        (),
        (),
        MinPairs { count: 6 },
    );
    assert!(run(chain, &pairs).is_empty());
}

#[test]
fn weights_multiply() {
    let pairs = pairs_at(&[0.0, 0.01, 0.02, 0.05]);
    let weights = |filtered: Vec<Pair>| filtered.iter().map(|p| p.weight).collect::<Vec<_>>();
    let constant = |weight| weights(run(ConstantWeight { weight }, &pairs));
    assert_eq!(constant(0.25), [0.5; 4]);
    assert_eq!(constant(f64::INFINITY), [0.0; 4]);
    let distance = |max| weights(run(DistanceWeight { max }, &pairs));
    assert_eq!(distance(Length::Meters(0.02)), [2.0, 1.0, 0.0, 0.0]);
    // A twentieth of the diameter, and the same in meters.
    let meters = 0.05 * scene().model.diameter();
    assert_eq!(
        distance(Length::Diameters(0.05)),
        distance(Length::Meters(meters))
    );
    let mut turned = pairs.clone();
    let at = |degrees: f32| {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        UnitVector3::new_normalize(Vector3::new(sine, 0.0, -cosine))
    };
    for (pair, degrees) in turned.iter_mut().zip([0.0, 60.0, 90.1, 180.0]) {
        pair.source.normal = at(degrees);
    }
    let found = weights(run(NormalWeight, &turned));
    for (found, expected) in found.iter().zip([2.0, 1.0, 0.0, 0.0]) {
        assert!((found - expected).abs() < 1e-5, "{found} {expected}");
    }
}

#[test]
fn sensor_noise_equals_its_formula() {
    // The published values at 0.5 m, 1 m and 2 m, in millimeters.
    let ahn = SensorNoise::d435_ahn2019_axial();
    let facing = |z: f32, degrees: f32| {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        Surfel {
            point: Point3::new(0.0, 0.0, z),
            normal: UnitVector3::new_normalize(Vector3::new(0.0, sine, -cosine)),
        }
    };
    for (z, millimetres) in [(0.5, 2.41), (1.0, 5.74), (2.0, 18.3)] {
        let sigma = ahn.sigma(&facing(z, 40.0)) * 1000.0;
        assert!((sigma - millimetres).abs() < 0.01 * millimetres, "{sigma}");
    }
    let tilted = SensorNoise { tilt: 0.022, ..ahn };
    for (degrees, millimetres) in [
        (0.0, 0.0),
        (20.0, 1.8),
        (40.0, 7.1),
        (60.0, 30.0),
        (75.0, 149.0),
        (89.0, 149.0),
    ] {
        let extra =
            (tilted.sigma(&facing(0.5, degrees)) - ahn.sigma(&facing(0.5, degrees))) * 1000.0;
        assert!(
            (extra - millimetres).abs() <= 0.03 * millimetres,
            "{degrees} {extra}"
        );
    }
    let mut pairs = pairs_at(&[0.01; 3]);
    for (pair, z) in pairs.iter_mut().zip([0.4, 0.8, 0.8]) {
        pair.target.point.z = z;
    }
    let weighted = run(
        SensorNoiseWeight {
            noise: SensorNoise::stereo(),
        },
        &pairs,
    );
    // 1/z⁴ over its mean, times the previous weight.
    let mean = (1.0 + 2.0 / 16.0) / 3.0;
    for (pair, expected) in weighted.iter().zip([1.0, 1.0 / 16.0, 1.0 / 16.0]) {
        assert!((pair.weight - 2.0 * expected / mean).abs() < 1e-5);
    }
    assert_eq!(
        run(SensorNoiseWeight::default(), &pairs[1..])[0].weight,
        2.0
    );
}

#[test]
fn strides_and_lengths_accept_any_value() {
    assert_eq!(Stride::Pixels(0).pixels(100), 1);
    assert_eq!(Stride::AboutPoints(0).pixels(0), 1);
    let scene = scene();
    let problem = scene.problem();
    assert_eq!(Length::Meters(-1.0).meters(&problem), -1.0);
    assert!(Length::Diameters(f64::NAN).meters(&problem).is_nan());
}

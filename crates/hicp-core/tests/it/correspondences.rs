//! Tests of the list that associations write and metrics read.

use hicp_core::{Correspondences, Isometry3, Pair, Point3, Surfel, UnitVector3, Vector3};

fn pair(x: f32) -> Pair {
    let surfel = Surfel {
        point: Point3::new(x, 0.0, 1.0),
        normal: UnitVector3::new_unchecked(Vector3::new(0.0, 0.0, -1.0)),
    };
    Pair::new(0, surfel, 1, surfel)
}

#[test]
fn begin_stores_pose_and_candidates_and_removes_the_pairs() {
    let mut pairs = Correspondences::new();
    pairs.push(pair(1.0));
    let pose = Isometry3::translation(0.1, 0.2, 0.3);
    pairs.begin(&pose, 7);
    assert!(pairs.is_empty());
    assert_eq!(
        (pairs.camera_from_object(), pairs.n_candidates()),
        (&pose, 7)
    );
    // An association from the observation has as many candidates as observed points.
    pairs.set_candidates(9);
    assert_eq!(
        (pairs.camera_from_object(), pairs.n_candidates()),
        (&pose, 9)
    );
}

#[test]
fn reserved_memory_is_used_and_kept() {
    let mut pairs = Correspondences::new();
    pairs.reserve(100);
    pairs.push(pair(0.0));
    let place = pairs.as_slice().as_ptr();
    for i in 1..100_u8 {
        pairs.push(pair(f32::from(i)));
    }
    assert_eq!((pairs.len(), pairs.as_slice().as_ptr()), (100, place));
    let kept = (&pairs).into_iter().map(|p| p.source.point.x);
    assert!(kept.eq((0..100_u8).map(f32::from)));
    assert!(!pairs.is_empty());
    pairs.begin(&Isometry3::identity(), 0);
    pairs.push(pair(0.0));
    assert_eq!(pairs.as_slice().as_ptr(), place);
}

/// Two lists that grow in alternation would move, because each blocks the other.
#[test]
fn reserved_memory_avoids_moving_the_pairs() {
    let mut lists = [Correspondences::new(), Correspondences::new()];
    for list in &mut lists {
        list.reserve(1000);
        list.push(pair(0.0));
    }
    let places = lists.each_ref().map(|list| list.as_slice().as_ptr());
    for _ in 1..1000 {
        for list in &mut lists {
            list.push(pair(1.0));
        }
    }
    assert_eq!(lists.map(|list| list.as_slice().as_ptr()), places);
}

#[test]
fn reweighting_retaining_and_extending_keep_the_order() {
    let xs = |pairs: &Correspondences| -> Vec<f32> {
        let x = |p: &Pair| p.source.point.x;
        pairs.as_slice().iter().map(x).collect()
    };
    let mut pairs: Correspondences = [4.0, 1.0, 3.0, 2.0].map(pair).into_iter().collect();
    // All collected pairs count as candidates, at the identity pose.
    assert_eq!((pairs.n_candidates(), pairs.len()), (4, 4));
    assert_eq!(pairs.camera_from_object(), &Isometry3::identity());
    assert_eq!(xs(&pairs), [4.0, 1.0, 3.0, 2.0]);
    pairs.retain(|p| p.source.point.x != 1.0);
    assert_eq!(xs(&pairs), [4.0, 3.0, 2.0]);
    pairs.extend([5.0, 1.0].map(pair));
    assert_eq!(xs(&pairs), [4.0, 3.0, 2.0, 5.0, 1.0]);
    assert_eq!(pairs.n_candidates(), 4);
    for pair in pairs.as_mut_slice() {
        pair.weight = pair.source.point.x / 2.0;
    }
    let weights = pairs.as_slice().iter().map(|p| p.weight);
    assert!(weights.eq([2.0, 1.5, 1.0, 2.5, 0.5]));
}

#[test]
fn the_distance_of_a_pair_is_that_of_its_points() {
    let mut pair = pair(1.0);
    assert_eq!(pair.distance(), 0.0);
    pair.target.point = Point3::new(3.0, -3.0, 7.0);
    // 2² + 3² + 6² = 7²
    assert_eq!(pair.distance(), 7.0);
    std::mem::swap(&mut pair.source, &mut pair.target);
    assert_eq!((pair.distance(), pair.weight), (7.0, 1.0));
}

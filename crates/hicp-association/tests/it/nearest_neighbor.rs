//! Tests of nearest neighbors against brute force (pitfall 26).

use crate::support::{
    Numbers, RayCaster, camera, cuboid, depth_image, observe_depth, sphere_depth,
};
use hicp_association::{DataAssociation, NearestNeighbor, PointSearch, SearchIndex, Stride};
use hicp_core::{
    Cloud, Context, Correspondences, DepthImage, Isometry3, Mask, Model, Observation,
    PinholeCamera, Point3, Problem, RenderCache, RigidTransform, Surfel, UnitVector3, Vector3,
};

const INDEXES: &[SearchIndex] = &[
    SearchIndex::BoxTree,
    #[cfg(feature = "kiddo")]
    SearchIndex::KdTree,
];

fn nearest_neighbors(targets: Stride) -> impl Iterator<Item = NearestNeighbor> {
    let new = move |index: &SearchIndex| NearestNeighbor::new(targets, *index);
    INDEXES.iter().map(new)
}

fn surfels(numbers: &mut Numbers, count: usize, scale: f64) -> Vec<Surfel> {
    (0..count)
        .map(|_| Surfel {
            point: Point3::from((numbers.vector() * scale).cast::<f32>()),
            normal: UnitVector3::new_normalize(numbers.vector().cast::<f32>()),
        })
        .collect()
}

pub fn associate(
    association: &mut dyn DataAssociation,
    observation: &Observation,
    source: &[Surfel],
    pose: &Isometry3<f64>,
) -> Correspondences {
    let model = Model::new(cuboid(0.1, 0.1, 0.1));
    let mut renders = RenderCache::new(RayCaster);
    let mut context = Context::new(Problem::new(&model, observation), &mut renders);
    let mut pairs = Correspondences::new();
    association.associate(&mut context, source, pose, &mut pairs);
    pairs
}

/// Checks that every source has a pair, in order, and that no target of the stride is nearer.
fn assert_nearest(
    observation: &Observation,
    stride: u32,
    source: &[Surfel],
    pose: &Isometry3<f64>,
) {
    for mut association in nearest_neighbors(Stride::Pixels(stride)) {
        let pairs = associate(&mut association, observation, source, pose);
        assert_eq!(pairs.len(), source.len());
        let targets: Vec<&Surfel> = observation.surfels(stride).map(|(_, s)| s).collect();
        let mover = RigidTransform::new(pose);
        for (i, (pair, surfel)) in pairs.as_slice().iter().zip(source).enumerate() {
            assert_eq!((pair.source_index as usize, pair.weight), (i, 1.0));
            assert_eq!(pair.source, mover.surfel(surfel));
            assert!(
                targets.contains(&&pair.target),
                "the target is an observed surfel of the stride"
            );
            let nearest = targets
                .iter()
                .map(|t| (t.point - pair.source.point).norm_squared())
                .fold(f32::INFINITY, f32::min);
            let found = (pair.target.point - pair.source.point).norm_squared();
            // Sums of three squares in another order: equal points may tie, others may not.
            assert!(
                found <= nearest * (1.0 + 4.0 * f32::EPSILON),
                "{found} {nearest}"
            );
        }
    }
}

#[test]
fn pitfall_26_the_tree_equals_brute_force() {
    let mut numbers = Numbers(201);
    let center = Vector3::new(0.02, 0.0, 0.5);
    let sphere = observe_depth(
        depth_image(&camera(), |ray| sphere_depth(&center, 0.12, &ray)),
        &camera(),
    );
    // A fronto-parallel wall: thousands of points with the same coordinate to the bit.
    let wall = observe_depth(depth_image(&camera(), |_| 0.5), &camera());
    for observation in [&sphere, &wall] {
        assert!(observation.n_surfels() > 300);
        for stride in [1, 2, 3, 5] {
            for scale in [0.01, 0.3, 10.0] {
                let source = surfels(&mut numbers, 60, scale);
                let mut pose = numbers.pose(0.1);
                pose.translation.vector.z += 0.5;
                assert_nearest(observation, stride, &source, &pose);
            }
        }
    }
}

#[test]
fn pitfall_26_duplicate_points_do_not_fail() {
    // In a far corner of an image with a focal length of 1e9, the rays of neighboring pixels differ
    // by less than the resolution of f32. All points coincide.
    let camera = PinholeCamera::new(1e9, 1e9, -1e9, 0.0, 64, 48).unwrap();
    let observation = observe_depth(depth_image(&camera, |_| 1.0), &camera);
    let points: Vec<Point3<f32>> = observation.surfels(1).map(|(_, s)| s.point).collect();
    let duplicates = points.iter().filter(|p| p.x == points[0].x).count();
    assert!(
        duplicates > 1000,
        "the fixture must have duplicates: {duplicates}"
    );
    let mut numbers = Numbers(202);
    let source = surfels(&mut numbers, 40, 0.5);
    assert_nearest(
        &observation,
        1,
        &source,
        &Isometry3::translation(1.0, 0.0, 1.0),
    );
}

#[test]
fn pitfall_26_an_empty_index_gives_no_pairs() {
    let mut numbers = Numbers(203);
    let source = surfels(&mut numbers, 20, 0.1);
    let wall = || depth_image(&camera(), |_| 0.5);
    let no_mask = Observation::new(
        wall(),
        Mask::new(64, 48, vec![false; 64 * 48]).unwrap(),
        camera(),
    );
    let no_depth = DepthImage::from_meters(64, 48, vec![0.0; 64 * 48]).unwrap();
    let no_depth = Observation::new(no_depth, Mask::full(64, 48), camera());
    let identity = Isometry3::identity();
    for observation in [no_mask.unwrap(), no_depth.unwrap()] {
        for mut association in nearest_neighbors(Stride::AboutPoints(4000)) {
            assert!(associate(&mut association, &observation, &source, &identity).is_empty());
        }
    }
    // A stride that misses every surfel.
    let mut mask = vec![false; 64 * 48];
    for v in 20..30 {
        for u in 33..43 {
            mask[v * 64 + u] = true;
        }
    }
    let observation = Observation::new(wall(), Mask::new(64, 48, mask).unwrap(), camera()).unwrap();
    for mut sparse in nearest_neighbors(Stride::Pixels(50)) {
        assert!(associate(&mut sparse, &observation, &source, &identity).is_empty());
        assert!(associate(&mut sparse, &observation, &[], &identity).is_empty());
    }
}

#[test]
fn pitfall_26_only_queries_that_are_not_finite_have_no_pair() {
    let mut numbers = Numbers(204);
    let observation = observe_depth(depth_image(&camera(), |_| 0.5), &camera());
    let mut source = surfels(&mut numbers, 10, 0.1);
    for (i, bad) in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY]
        .into_iter()
        .enumerate()
    {
        source[3 * i].point[i] = bad;
    }
    let finite = surfels(&mut numbers, 10, 0.1);
    for mut association in nearest_neighbors(Stride::AboutPoints(4000)) {
        let pairs = associate(
            &mut association,
            &observation,
            &source,
            &Isometry3::identity(),
        );
        let indices: Vec<u32> = pairs.as_slice().iter().map(|p| p.source_index).collect();
        assert_eq!(indices, [1, 2, 4, 5, 7, 8, 9]);
        // At a thousand kilometers there is still a nearest point. If squares overflow, there is
        // none.
        for (distance, expected) in [(1e6, 10), (1e12, 10), (1e25, 0), (1e39, 0), (1e300, 0)] {
            let pose = Isometry3::translation(distance, 0.0, 0.0);
            let pairs = associate(&mut association, &observation, &finite, &pose);
            assert_eq!(pairs.len(), expected, "{distance}");
            assert!(pairs.as_slice().iter().all(|p| p.distance().is_finite()));
        }
    }
}

#[test]
fn about_so_many_points_are_all_points_of_a_cloud() {
    let mut numbers = Numbers(205);
    let target = Cloud::new(surfels(&mut numbers, 20_000, 0.5));
    let source = Cloud::new(surfels(&mut numbers, 50, 0.5));
    let mut renders = RenderCache::new(RayCaster);
    let mut context = Context::new(Problem::new(&source, &target), &mut renders);
    let mut associate = |targets| {
        let mut pairs = Correspondences::new();
        NearestNeighbor::new(targets, SearchIndex::default()).associate(
            &mut context,
            source.surfels(),
            &Isometry3::identity(),
            &mut pairs,
        );
        pairs
    };
    let all = associate(Stride::Pixels(1));
    assert_eq!(associate(Stride::AboutPoints(10)), all);
    assert_ne!(associate(Stride::Pixels(2)), all);
}

#[test]
fn strides_keep_about_the_requested_number_of_points() {
    for n in [0_usize, 1, 10, 999, 1000, 1001, 4000, 40_000, 300_000] {
        for wanted in [0_usize, 1, 100, 1000, 4000] {
            let stride = f64::from(Stride::AboutPoints(wanted).pixels(n));
            let left = n as f64 / (stride * stride);
            let wanted = wanted.max(1) as f64;
            assert!(left <= 2.0 * wanted, "{n} {wanted}");
            assert!(stride == 1.0 || left >= 0.5 * wanted, "{n} {wanted}");
        }
    }
    assert_eq!(
        (Stride::Pixels(0).pixels(9), Stride::Pixels(7).pixels(9)),
        (1, 7)
    );
    // The default uses every surfel of a small image and a part of a large one.
    assert_eq!(NearestNeighbor::default().targets.pixels(4000), 1);
    assert_eq!(NearestNeighbor::default().targets.pixels(16_000), 2);
}

#[test]
fn strides_of_one_observation_do_not_share_a_tree() {
    let mut numbers = Numbers(205);
    let observation = observe_depth(depth_image(&camera(), |_| 0.5), &camera());
    let source = surfels(&mut numbers, 50, 0.2);
    for stride in [4, 1, 4, 2, 1] {
        assert_nearest(
            &observation,
            stride,
            &source,
            &Isometry3::translation(0.0, 0.0, 0.4),
        );
    }
}

#[test]
fn an_association_that_is_used_again_gives_the_pairs_of_a_new_one() {
    let mut numbers = Numbers(31);
    let images = [0.5, 0.501].map(|z| observe_depth(depth_image(&camera(), |_| z), &camera()));
    let source = surfels(&mut numbers, 50, 0.2);
    for mut used in nearest_neighbors(Stride::Pixels(2)) {
        for step in 0..40 {
            let image = &images[step / 4 % 2];
            let pose = Isometry3::translation(1e-4 * step as f64, 0.0, 0.4);
            let mut new = NearestNeighbor::new(used.targets, used.index);
            let pairs = [&mut used, &mut new].map(|a| associate(a, image, &source, &pose));
            assert_eq!(pairs[0].as_slice(), pairs[1].as_slice(), "{step}");
        }
    }
}

#[test]
fn a_point_search_equals_brute_force_and_skips_what_is_not_finite() {
    let mut numbers = Numbers(17);
    let mut points: Vec<_> = surfels(&mut numbers, 300, 1.0)
        .iter()
        .map(|s| s.point)
        .collect();
    for place in [0, 7, 299] {
        points[place].y = f32::NAN;
    }
    let search = PointSearch::new(points.iter().copied());
    let mut found = Vec::new();
    for query in surfels(&mut numbers, 50, 1.5).iter().map(|s| s.point) {
        let distance = |i: u32| (points[i as usize] - query).norm_squared();
        let mut order: Vec<u32> = (0..300).filter(|i| distance(*i).is_finite()).collect();
        order.sort_by(|a, b| distance(*a).total_cmp(&distance(*b)));
        search.nearest_n(&query, 5, &mut found);
        let elements: Vec<u32> = found.iter().map(|nearest| nearest.element).collect();
        assert_eq!(elements, order[..5]);
        assert_eq!(search.nearest(&query), Some(found[0]));
        assert!((found[4].distance_squared - distance(order[4])).abs() < 1e-6);
    }
    let nowhere = points[0];
    assert_eq!(search.nearest(&nowhere), None);
    assert_eq!(PointSearch::new([]).nearest(&points[1]), None);
}

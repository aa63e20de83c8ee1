//! Tests of associations against brute force.

// References are written like the definitions. Their cost does not matter, since tests are small.

use crate::common::{Scene, ball_scene, blind_scene, bumpy_ball, scene_of, squared};
use crate::support::Numbers;
use hicp_association::{
    AllSamples, ClosestPointOnMesh, Contour, DataAssociation, KNearest, Length, NearestNeighbor,
    NormalCompatible, NormalShooting, ObservationToModel, Projective, ProjectiveInterpolated,
    ProjectiveSearch, Reciprocal, RenderedSurface, SearchIndex, Stride,
};
use hicp_core::{
    DepthImage, Isometry3, Mask, Model, Observation, Pair, PinholeCamera, Point3, RigidTransform,
    Surfel, TriMesh, UnitVector3, Vector3, sample_surface,
};
use proptest::prelude::*;

const ALL: Stride = Stride::Pixels(1);

fn all_associations() -> Vec<Box<dyn DataAssociation>> {
    vec![
        Box::new(NearestNeighbor::default()),
        #[cfg(feature = "kiddo")]
        Box::new(NearestNeighbor::new(
            Stride::AboutPoints(4000),
            SearchIndex::KdTree,
        )),
        Box::new(KNearest::default()),
        Box::new(NormalCompatible::default()),
        Box::new(NormalShooting::default()),
        Box::new(Reciprocal::<KNearest>::default()),
        Box::new(Reciprocal::new(Projective)),
        Box::new(Projective),
        Box::new(ProjectiveSearch::default()),
        Box::new(ProjectiveInterpolated::default()),
        Box::new(ObservationToModel::default()),
        Box::new(ClosestPointOnMesh::default()),
        Box::new(RenderedSurface::default()),
        Box::new(Contour::default()),
        Box::new((Projective, KNearest::default())),
    ]
}

fn moved(source: &[Surfel], pose: &Isometry3<f64>) -> Vec<Surfel> {
    let mover = RigidTransform::new(pose);
    source.iter().map(|s| mover.surfel(s)).collect()
}

/// Returns the observed surfels by distance from a point. Of equally near ones, the first precedes.
fn by_distance(targets: &[(u32, Surfel)], point: &Point3<f32>) -> Vec<(u32, Surfel)> {
    let mut sorted = targets.to_vec();
    sorted.sort_by(|a, b| squared(&a.1.point, point).total_cmp(&squared(&b.1.point, point)));
    sorted
}

/// Checks that sources and targets are those of the indices, and that all numbers are finite.
fn assert_well_formed(scene: &Scene, source: &[Surfel], pose: &Isometry3<f64>, pairs: &[Pair]) {
    let source = moved(source, pose);
    for pair in pairs {
        assert_eq!(pair.source, source[pair.source_index as usize]);
        let target = scene.observation.surfel(pair.target_index);
        assert_eq!(Some(&pair.target), target);
        assert!(pair.weight.is_finite() && pair.weight >= 0.0);
        assert!(pair.distance().is_finite());
    }
}

#[test]
fn without_observed_points_there_are_no_pairs() {
    let blind = blind_scene();
    let source = Numbers(3).surfels(20, 0.1);
    for mut association in all_associations() {
        let pairs = blind.associate(&mut association, &source, &blind.truth);
        assert!(pairs.is_empty(), "{}", association.name());
    }
}

#[cfg(feature = "kiddo")]
#[test]
fn all_indexes_give_equal_pairs() {
    let scene = ball_scene();
    let source = scene.select(&mut AllSamples, &scene.truth);
    let targets = Stride::Pixels(2);
    let mut ours = KNearest::new(1, targets);
    let mut theirs = NearestNeighbor::new(targets, SearchIndex::KdTree);
    // At each pose, the search starts from the pairs of the last one.
    let mut warm = NearestNeighbor::new(targets, SearchIndex::BoxTree);
    for seed in 0..5 {
        let pose = scene.nearby(seed);
        let expected = scene.associate(&mut theirs, &source, &pose);
        assert_eq!(scene.associate(&mut ours, &source, &pose), expected);
        assert_eq!(scene.associate(&mut warm, &source, &pose), expected);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Points near and far, at and behind the camera, next to the image, and from the pairs of
    /// another pose.
    #[test]
    fn a_search_from_the_last_pairs_equals_a_new_search(seed: u64, stride in 1_u32..6, spread in 0.0_f64..1.5) {
        let scene = scene_of(bumpy_ball(0.08), 0.001, seed);
        let mut source = Numbers(seed).surfels(40, 0.1);
        source.extend(scene.select(&mut AllSamples, &scene.truth).iter().take(40));
        let targets = Stride::Pixels(stride);
        let mut warm = NearestNeighbor::new(targets, SearchIndex::BoxTree);
        for (turn, toward) in [(0, 0.0), (1, spread), (2, -2.0 * spread), (3, 0.0)] {
            let mut pose = scene.nearby(seed.wrapping_add(turn));
            pose.translation.vector += Vector3::new(0.3, -0.2, 1.0) * toward;
            let expected = scene.associate(&mut KNearest::new(1, targets), &source, &pose);
            prop_assert_eq!(scene.associate(&mut warm, &source, &pose), expected);
        }
    }

    #[test]
    fn the_k_nearest_are_found(seed: u64, k in 0_usize..12, stride in 1_u32..4) {
        let scene = scene_of(bumpy_ball(0.08), 0.001, seed);
        let source = Numbers(seed).surfels(25, 0.1);
        let pose = scene.nearby(seed);
        let mut association = KNearest::new(k, Stride::Pixels(stride));
        let pairs = scene.associate(&mut association, &source, &pose);
        assert_well_formed(&scene, &source, &pose, pairs.as_slice());
        let targets = scene.targets(stride);
        let mut expected = Vec::new();
        for (i, source) in (0..).zip(moved(&source, &pose)) {
            for (index, target) in by_distance(&targets, &source.point).into_iter().take(k.max(1)) {
                let weight = 1.0 / k.max(1) as f32;
                expected.push(Pair { weight, ..Pair::new(i, source, index, target) });
            }
        }
        prop_assert_eq!(pairs.as_slice(), &expected[..]);
        prop_assert_eq!(pairs.n_candidates(), 25);
    }

    #[test]
    fn normal_compatible_selects_the_nearest_compatible_point(seed: u64, angle in 5.0_f32..120.0) {
        let scene = scene_of(bumpy_ball(0.08), 0.001, seed);
        let source = Numbers(seed).surfels(40, 0.08);
        let pose = scene.nearby(seed);
        let pairs = scene.associate(&mut NormalCompatible::new(f64::from(angle), 8, ALL), &source, &pose);
        assert_well_formed(&scene, &source, &pose, pairs.as_slice());
        let targets = scene.targets(1);
        let expected: Vec<Pair> = (0..).zip(moved(&source, &pose)).filter_map(|(i, source)| {
            by_distance(&targets, &source.point).into_iter().take(8).find(|(_, target)| {
                let cosine = source.normal.dot(&target.normal);
                cosine >= angle.to_radians().cos() - 1e-6
            }).map(|(index, target)| Pair::new(i, source, index, target))
        }).collect();
        prop_assert_eq!(pairs.as_slice(), &expected[..]);
    }

    #[test]
    fn normal_shooting_selects_the_point_closest_to_the_line(seed: u64, offset in 0.0005_f32..0.02) {
        let scene = scene_of(bumpy_ball(0.08), 0.001, seed);
        let source = Numbers(seed).surfels(40, 0.08);
        let pose = scene.nearby(seed);
        let limit = Some(Length::Meters(f64::from(offset)));
        let pairs = scene.associate(&mut NormalShooting::new(9, limit, ALL), &source, &pose);
        assert_well_formed(&scene, &source, &pose, pairs.as_slice());
        let free = scene.associate(&mut NormalShooting::new(9, None, ALL), &source, &pose);
        prop_assert_eq!(free.len(), 40);
        let targets = scene.targets(1);
        for pair in free.as_slice() {
            // |d × n| is the distance to the line.
            let off = |t: &Surfel| (t.point - pair.source.point).cross(&pair.source.normal).norm();
            let nine = by_distance(&targets, &pair.source.point);
            let least = nine.iter().take(9).map(|(_, t)| off(t)).fold(f32::INFINITY, f32::min);
            prop_assert!(off(&pair.target) <= least + 1e-6);
            let within = off(&pair.target);
            if (within - offset).abs() > 1e-6 {
                let kept = pairs.as_slice().iter().any(|p| p.source_index == pair.source_index);
                prop_assert_eq!(kept, within <= offset);
            }
        }
    }

    #[test]
    fn reciprocal_keeps_the_mutual_nearest(seed: u64) {
        let scene = scene_of(bumpy_ball(0.08), 0.001, seed);
        let mut source = Numbers(seed).surfels(60, 0.08);
        // Two points at the same place have the same claim.
        source[7] = source[31];
        let pose = scene.nearby(seed);
        let mut forward = KNearest::new(3, ALL);
        let mut mutual = Reciprocal::new(forward.clone());
        let pairs = scene.associate(&mut mutual, &source, &pose);
        let points = moved(&source, &pose);
        let expected: Vec<Pair> = scene.associate(&mut forward, &source, &pose).as_slice().iter()
            .filter(|pair| points.iter().all(|other| {
                squared(&other.point, &pair.target.point) >= squared(&pair.source.point, &pair.target.point)
            }))
            .copied().collect();
        prop_assert!(!expected.is_empty() && expected.len() < 180);
        prop_assert_eq!(pairs.as_slice(), &expected[..]);
    }

    #[test]
    fn the_window_is_searched_in_three_dimensions(seed: u64, radius in 0_u32..5) {
        let scene = scene_of(bumpy_ball(0.08), 0.001, seed);
        let source = Numbers(seed).surfels(60, 0.1);
        let pose = scene.nearby(seed);
        let pairs = scene.associate(&mut ProjectiveSearch { radius }, &source, &pose);
        assert_well_formed(&scene, &source, &pose, pairs.as_slice());
        let camera = scene.observation.camera();
        let region = scene.observation.region();
        let expected: Vec<Pair> = (0..).zip(moved(&source, &pose)).filter_map(|(i, source)| {
            let pixel = camera.project(&source.point.cast())?;
            let (u, v) = ((pixel.x + 0.5).floor() as i64, (pixel.y + 0.5).floor() as i64);
            if !(0..64).contains(&u) || !(0..48).contains(&v) {
                return None;
            }
            scene.targets(1).into_iter().filter(|(index, _)| {
                let x = i64::from(region.u_min) + i64::from(*index) % region.width() as i64;
                let y = i64::from(region.v_min) + i64::from(*index) / region.width() as i64;
                (x - u).abs().max((y - v).abs()) <= i64::from(radius)
            }).min_by(|a, b| {
                squared(&a.1.point, &source.point).total_cmp(&squared(&b.1.point, &source.point))
            }).map(|(index, target)| Pair::new(i, source, index, target))
        }).collect();
        prop_assert_eq!(pairs.as_slice(), &expected[..]);
        if radius == 0 {
            let plain = scene.associate(&mut Projective, &source, &pose);
            prop_assert_eq!(pairs, plain);
        }
    }

    #[test]
    fn observed_points_pair_with_the_nearest_sample(seed: u64, visible_only: bool, samples in 0_usize..800) {
        let scene = scene_of(bumpy_ball(0.08), 0.001, seed);
        let pose = scene.nearby(seed);
        let stride = Stride::Pixels(2);
        let mut association = ObservationToModel { stride, samples, visible_only };
        let pairs = scene.associate(&mut association, &[], &pose);
        let targets = scene.targets(2);
        prop_assert_eq!(pairs.n_candidates(), targets.len());
        let object_from_camera = RigidTransform::new(&pose.inverse());
        let eye: Point3<f32> = Point3::from(pose.inverse().translation.vector).cast();
        let model = sample_surface(scene.model.mesh(), samples);
        let expected: Vec<Pair> = targets.iter().filter_map(|(index, target)| {
            let query = object_from_camera.point(&target.point);
            let best = (0..model.len())
                .filter(|i| !visible_only || model[*i].normal.dot(&(eye - model[*i].point)) > 0.0)
                .min_by(|a, b| squared(&model[*a].point, &query).total_cmp(&squared(&model[*b].point, &query)))?;
            let source = RigidTransform::new(&pose).surfel(&model[best]);
            Some(Pair::new(best as u32, source, *index, *target))
        }).collect();
        prop_assert_eq!(pairs.as_slice(), &expected[..]);
    }

    #[test]
    fn observed_points_pair_with_the_closest_point_of_the_mesh(seed: u64, visible_only: bool) {
        let mut random = Numbers(seed);
        // A closed mesh, a closed one wound inward, and a soup of triangles with slivers and a
        // degenerate one.
        let closed = bumpy_ball(0.08);
        let inward = TriMesh::new(closed.vertices().to_vec(),
            closed.triangles().iter().map(|[a, b, c]| [*a, *c, *b]).collect()).unwrap();
        let mut vertices: Vec<Point3<f32>> = (0..60).map(|_| random.point(0.08)).collect();
        vertices[2] = vertices[1];
        vertices[5] = vertices[3] + (vertices[4] - vertices[3]) * 0.5 + random.point(1e-5).coords;
        let soup = TriMesh::new(vertices, (0..20).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect()).unwrap();
        for (mesh, sign, oriented) in [(closed, 1.0, true), (inward, -1.0, true), (soup, 1.0, false)] {
            let scene = Scene { model: Model::new(mesh), ..ball_scene() };
            let pose = scene.nearby(seed);
            let mut association = ClosestPointOnMesh { stride: Stride::Pixels(3), visible_only };
            let pairs = scene.associate(&mut association, &[], &pose);
            prop_assert_eq!(pairs.len(), scene.targets(3).len());
            prop_assert_eq!(pairs.n_candidates(), pairs.len());
            let eye = pose.inverse() * Point3::origin();
            let mesh = scene.model.mesh();
            for pair in pairs.as_slice() {
                let query = pose.inverse() * pair.target.point.cast::<f64>();
                let best = (0..mesh.triangles().len()).filter(|t| {
                    mesh.normal(*t).is_some_and(|normal| {
                        let toward = (eye - mesh.corners(*t)[0].cast::<f64>()).dot(&normal.cast::<f64>()) * sign;
                        !(visible_only && oriented) || toward > 0.0
                    })
                }).map(|t| distance_to_triangle(&query, &mesh.corners(t).map(|p| p.cast::<f64>())))
                    .fold(f64::INFINITY, f64::min);
                prop_assert!((f64::from(pair.distance()) - best).abs() < 1e-6, "{} {best}", pair.distance());
                // The point of the pair is on the triangle of its index.
                let on = pose.inverse() * pair.source.point.cast::<f64>();
                let triangle = pair.source_index as usize;
                let corners = mesh.corners(triangle).map(|p| p.cast::<f64>());
                prop_assert!(distance_to_triangle(&on, &corners) < 1e-6);
                let normal = pose.rotation * mesh.normal(triangle).unwrap().cast::<f64>().into_inner();
                let along = normal.dot(&pair.source.normal.cast::<f64>());
                prop_assert!((along.abs() - 1.0).abs() < 1e-5);
                if oriented {
                    prop_assert!(along * sign > 0.0);
                } else {
                    prop_assert!(pair.source.normal.dot(&pair.source.point.coords) < 1e-6);
                }
            }
        }
    }
}

/// Returns the distance by definition: to the foot on the plane if it is inside, else to an edge.
fn distance_to_triangle(point: &Point3<f64>, [a, b, c]: &[Point3<f64>; 3]) -> f64 {
    let to_edge = |p: &Point3<f64>, q: &Point3<f64>| {
        let along = q - p;
        let t = (point - p).dot(&along) / along.norm_squared();
        (p + along * t.clamp(0.0, 1.0) - point).norm()
    };
    let edges = to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a));
    let normal = (b - a).cross(&(c - a));
    let inside = [(a, b), (b, c), (c, a)]
        .iter()
        .all(|(p, q)| normal.dot(&(*q - *p).cross(&(point - *p))) >= 0.0);
    if inside {
        (normal.dot(&(point - a)) / normal.norm()).abs()
    } else {
        edges
    }
}

/// Observes all pixels of an image.
fn observe(depth: Vec<f32>, camera: PinholeCamera) -> Observation {
    let (width, height) = (camera.width(), camera.height());
    let depth = DepthImage::from_meters(width, height, depth).unwrap();
    Observation::new(depth, Mask::full(width, height), camera).unwrap()
}

/// The depth of a plane n·X = d in the test camera.
fn plane_depth(normal: &UnitVector3<f64>, offset: f64, camera: &PinholeCamera) -> Vec<f32> {
    let depth = camera.region().pixels().map(|(u, v)| {
        let ray = camera.unproject(f64::from(u), f64::from(v), 1.0);
        (offset / normal.dot(&ray.coords)) as f32
    });
    depth.collect()
}

fn scene_with(observation: Observation) -> Scene {
    Scene {
        observation,
        ..ball_scene()
    }
}

#[test]
fn interpolation_is_exact_on_a_plane() {
    let camera = crate::common::camera();
    let normal = UnitVector3::new_normalize(Vector3::new(0.5, -0.3, -1.0));
    let observation = observe(plane_depth(&normal, -0.5, &camera), camera);
    let scene = scene_with(observation);
    let mut random = Numbers(9);
    let source: Vec<Surfel> = (0..300)
        .map(|_| {
            let (u, v) = (2.0 + 58.0 * random.unit(), 2.0 + 43.0 * random.unit());
            Surfel {
                point: camera.unproject(u, v, 0.4).cast(),
                ..random.surfel(0.0)
            }
        })
        .collect();
    let identity = Isometry3::identity();
    let pairs = scene.associate(&mut ProjectiveInterpolated::default(), &source, &identity);
    let plain = scene.associate(&mut Projective, &source, &identity);
    assert_eq!(pairs.len(), 300);
    for (pair, plain) in pairs.as_slice().iter().zip(plain.as_slice()) {
        assert_eq!(pair.target_index, plain.target_index);
        assert_eq!(pair.source, plain.source);
        let point = pair.target.point.cast::<f64>();
        assert!(
            (normal.dot(&point.coords) + 0.5).abs() < 2e-6,
            "on the plane"
        );
        // The point lies on the ray of the source.
        let ray = pair.source.point.cast::<f64>().coords;
        assert!(ray.cross(&point.coords).norm() < 1e-6);
        assert!(pair.target.normal.dot(&normal.cast()) > 1.0 - 1e-5);
    }
}

#[test]
fn nothing_is_interpolated_across_an_edge() {
    let camera = crate::common::camera();
    // A step between columns 31 and 32, and a hole.
    let mut depth: Vec<f32> = (0..64 * 48)
        .map(|i| if i % 64 < 32 { 0.5 } else { 0.6 })
        .collect();
    depth[20 * 64 + 10] = 0.0;
    let scene = scene_with(observe(depth, camera));
    let identity = Isometry3::identity();
    let at = |u: f64, v: f64| Surfel {
        point: camera.unproject(u, v, 0.55).cast(),
        normal: -Vector3::z_axis(),
    };
    let source = [
        at(31.3, 30.2),
        at(31.7, 30.2),
        at(10.8, 20.4),
        at(10.2, 20.4),
        at(63.2, 3.0),
    ];
    let mut association = ProjectiveInterpolated::default();
    let pairs = scene.associate(&mut association, &source, &identity);
    let plain = scene.associate(&mut Projective, &source, &identity);
    assert_eq!(pairs, plain);
    let depths: Vec<f32> = pairs.as_slice().iter().map(|p| p.target.point.z).collect();
    // The fourth point falls into the hole and has no pair.
    assert_eq!(depths, [0.5, 0.6, 0.5, 0.6]);
    association.max_step = 1.0;
    let pairs = scene.associate(&mut association, &source[..1], &identity);
    let z = pairs.as_slice()[0].target.point.z;
    assert!(z > 0.5 && z < 0.6, "{z}");
    association.max_step = f64::NAN;
    let pairs = scene.associate(&mut association, &[at(20.4, 20.4)], &identity);
    assert_eq!(
        pairs.as_slice()[0].target.point,
        Point3::from(camera.unproject(20.0, 20.0, 0.5).coords.cast())
    );
}

#[test]
fn the_order_of_the_points_does_not_change_the_pairs() {
    let scene = ball_scene();
    let pose = scene.nearby(4);
    let source = Numbers(4).surfels(50, 0.08);
    let mut order: Vec<usize> = (0..50).collect();
    Numbers(5).shuffle(&mut order);
    let shuffled: Vec<Surfel> = order.iter().map(|i| source[*i]).collect();
    for mut association in all_associations() {
        let pairs = scene.associate(&mut association, &source, &pose);
        let name = association.name();
        assert!(pairs.len() > 5, "{name} {}", pairs.len());
        assert!(pairs.len() <= pairs.n_candidates() * 3, "{name}");
        let mut plain = pairs.as_slice().to_vec();
        let mut other = scene
            .associate(&mut association, &shuffled, &pose)
            .as_slice()
            .to_vec();
        let without_selection = [
            "observation-to-model",
            "closest-point-on-mesh",
            "rendered-surface",
            "contour",
        ];
        if !without_selection.contains(&association.name()) {
            for pair in &mut other {
                pair.source_index = order[pair.source_index as usize] as u32;
            }
        }
        for pairs in [&mut plain, &mut other] {
            pairs.sort_by_key(|p| (p.source_index, p.target_index));
        }
        assert_eq!(plain, other, "{}", association.name());
    }
}

#[test]
fn many_equal_coordinates_are_searched() {
    // A fronto-parallel wall: hundreds of targets share a coordinate, and queries between them tie.
    let scene = scene_with(observe(vec![0.5; 64 * 48], crate::common::camera()));
    let source: Vec<Surfel> = (0..200)
        .map(|i| Surfel {
            point: Point3::new(0.0, 0.0, 0.4 + 0.001 * i as f32),
            normal: Vector3::z_axis(),
        })
        .collect();
    let pairs = scene.associate(&mut KNearest::new(4, ALL), &source, &Isometry3::identity());
    let targets = scene.targets(1);
    for (pair, surfel) in pairs.as_slice().chunks(4).zip(&source) {
        let expected = by_distance(&targets, &surfel.point);
        let found: Vec<u32> = pair.iter().map(|p| p.target_index).collect();
        assert_eq!(
            found,
            expected[..4].iter().map(|(i, _)| *i).collect::<Vec<_>>()
        );
    }
}

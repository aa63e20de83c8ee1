//! Tests of the sides of a model.

use std::f32::consts::{PI, TAU};

use crate::support::cuboid;
use hicp_core::{Isometry3, Model, Point3, Sides, TriMesh, Vector3};

/// Returns a closed sphere of radius 0.1.
fn sphere() -> TriMesh {
    let (rings, sectors) = (24_u32, 48_u32);
    let mut vertices = vec![Point3::new(0.0, 0.0, 0.1), Point3::new(0.0, 0.0, -0.1)];
    for (ring, sector) in (1..rings).flat_map(|r| (0..sectors).map(move |s| (r, s))) {
        let (polar, around) = (
            PI * ring as f32 / rings as f32,
            TAU * sector as f32 / sectors as f32,
        );
        let [x, y] = [around.cos(), around.sin()].map(|c| 0.1 * polar.sin() * c);
        vertices.push(Point3::new(x, y, 0.1 * polar.cos()));
    }
    let at = |ring: u32, sector: u32| 2 + (ring - 1) * sectors + sector % sectors;
    let mut triangles = Vec::new();
    for sector in 0..sectors {
        triangles.push([0, at(1, sector), at(1, sector + 1)]);
        triangles.push([1, at(rings - 1, sector + 1), at(rings - 1, sector)]);
        for ring in 1..rings - 1 {
            let [a, b] = [at(ring, sector), at(ring, sector + 1)];
            let [c, d] = [at(ring + 1, sector), at(ring + 1, sector + 1)];
            triangles.extend([[a, c, d], [a, d, b]]);
        }
    }
    TriMesh::new(vertices, triangles).unwrap()
}

/// Surfels that are spread over a surface have half of their number at more than 0.87 of a
/// sphere's radius from the line of sight. In the image, a quarter of the area is there.
#[test]
fn surfels_are_spread_over_the_image() {
    let model = Model::new(sphere());
    let sides = Sides::of(&model, 600);
    let direction = Vector3::new(1.0, 2.0, -0.5);
    let side = sides.toward(&direction);
    let count = side.surfels.len();
    assert!((550..650).contains(&count), "{count}");
    let radius = 0.5 * model.diameter();
    let line = side.centroid - model.center();
    assert!(line.angle(&direction).to_degrees() < 20.0);
    let outside = |limit: f64| {
        let off = |p: Vector3<f64>| (p - line * (p.dot(&line) / line.norm_squared())).norm();
        let points = side.surfels.iter();
        let points = points.map(|s| s.point.cast::<f64>() - model.center());
        points.filter(|p| off(*p) > limit * radius).count()
    };
    let share = outside(0.87) as f64 / count as f64;
    assert!((0.15..0.35).contains(&share), "{share}");
}

#[test]
fn hidden_and_averted_surfaces_are_not_seen() {
    // A small box behind a large one, along z. The side toward the camera is up to 20° away.
    let (near, far) = (cuboid(0.1, 0.1, 0.1), cuboid(0.06, 0.06, 0.05));
    let n = u32::try_from(near.vertices().len()).unwrap();
    let moved = far
        .vertices()
        .iter()
        .map(|p| p + Vector3::new(0.0, 0.0, 0.09));
    let vertices = near.vertices().iter().copied().chain(moved).collect();
    let moved = far.triangles().iter().map(|t| t.map(|v| v + n));
    let triangles = near.triangles().iter().copied().chain(moved).collect();
    let model = Model::new(TriMesh::new(vertices, triangles).unwrap());
    let sides = Sides::of(&model, 400);
    let seen = |z: f64| {
        let side = sides.toward(&Vector3::new(0.0, 0.0, z));
        let far = side.surfels.iter().filter(|s| s.point.z > 0.06).count();
        far as f64 / side.surfels.len() as f64
    };
    assert!(seen(1.0) > 0.3, "{}", seen(1.0));
    assert!(seen(-1.0) < 0.08, "{}", seen(-1.0));
}

#[test]
fn the_side_at_a_pose_is_the_one_toward_the_camera() {
    let model = Model::new(cuboid(0.1, 0.2, 0.3));
    let sides = Sides::of(&model, 100);
    let pose = Isometry3::new(Vector3::new(0.02, -0.01, 0.7), Vector3::new(0.4, 1.3, -0.7));
    let eye = pose.inverse().translation.vector - model.center().coords;
    assert_eq!(sides.facing(&pose), sides.toward(&eye));
    // A pose that is not finite has a side, too.
    let lost = Isometry3::translation(f64::NAN, 0.0, 0.0);
    assert_eq!(sides.facing(&lost).index, 0);
    assert!(Sides::of(&model, 0).facing(&pose).surfels.is_empty());
}

/// Neither tiny objects nor specks that are far apart need much memory, or panic.
#[test]
fn extreme_models_have_sides() {
    let triangle = |at: f32, size: f32| {
        [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|[x, y]| Point3::new(at + size * x, size * y, 0.0))
    };
    let toward = Vector3::z();
    let tiny = TriMesh::new(triangle(0.0, 1e-12).to_vec(), vec![[0, 1, 2]]).unwrap();
    let sides = Sides::of(&Model::new(tiny), 100);
    assert_eq!(sides.toward(&toward).surfels.len(), 1);
    let specks = [triangle(0.0, 1e-4), triangle(10.0, 1e-4)].concat();
    let specks = Model::new(TriMesh::new(specks, vec![[0, 1, 2], [3, 4, 5]]).unwrap());
    let count = Sides::of(&specks, usize::MAX).toward(&toward).surfels.len();
    assert!((2..100_000).contains(&count), "{count}");
}

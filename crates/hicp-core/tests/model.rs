//! Models: size and samples.

#![allow(clippy::unwrap_used, clippy::panic, clippy::cast_precision_loss)]

mod support;

use hicp_core::{Facing, Model, ModelConfig, Point3, TriMesh, diameter, sample_surface};
use proptest::prelude::*;
use support::{Numbers, cuboid, wedge};

fn brute_force(points: &[Point3<f32>]) -> f64 {
    let mut best = 0.0_f64;
    for a in points {
        for b in points {
            best = best.max((a.cast::<f64>() - b.cast::<f64>()).norm());
        }
    }
    best
}

fn cloud() -> impl Strategy<Value = Vec<Point3<f32>>> {
    // Balls, boxes stretched a thousandfold, planes, lines and heaps of duplicates: coordinates on a coarse grid.
    (
        0_usize..400,
        1_i32..60,
        [0.0_f32..10.0, 0.0..10.0, 0.0..10.0],
        0_u64..u64::MAX,
    )
        .prop_map(|(count, grid, scales, seed)| {
            let mut numbers = Numbers(seed);
            let scale = scales.map(|s| if s < 2.0 { 0.0 } else { 0.001 * s * s * s });
            (0..count)
                .map(|_| {
                    #[allow(clippy::cast_possible_truncation)]
                    Point3::from(
                        scale.map(|s| s * (numbers.normal() * f64::from(grid)).round() as f32),
                    )
                })
                .collect()
        })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(96) })]

    #[test]
    fn diameter_is_the_brute_force_one(points in cloud()) {
        let (found, expected) = (diameter(&points), brute_force(&points));
        // The promise: a relative 1e-9, and never more than there is.
        prop_assert!(found <= expected * (1.0 + 4.0 * f64::EPSILON));
        prop_assert!(found >= expected * (1.0 - 1.1e-9), "{} of {}", found, expected);
    }

    #[test]
    fn samples_are_spread_by_area_to_within_one(seed in 0_u64..u64::MAX, count in 1_usize..500) {
        let mut numbers = Numbers(seed);
        #[allow(clippy::cast_possible_truncation)]
        let vertices: Vec<Point3<f32>> = (0..12)
            .map(|_| Point3::from(numbers.vector().map(|x| (0.1 * x) as f32)))
            .collect();
        let triangles: Vec<[u32; 3]> = (0..15)
            .map(|_| [0, 1, 2].map(|_| u32::try_from(numbers.below(12)).unwrap()))
            .collect();
        let Ok(mesh) = TriMesh::new(vertices, triangles) else { return Ok(()) };
        let samples = sample_surface(&mesh, count);
        prop_assert_eq!(samples.len(), count);
        // Samples come in the order of the triangles, so the shares of every prefix of the mesh are known.
        let share = |t: usize| mesh.triangle_area(t) / mesh.area() * count as f64;
        let mut before = 0.0_f64;
        let mut next = 0;
        for t in 0..mesh.triangles().len() {
            let until = before + share(t);
            // The i-th sample, at i + ½, belongs here when it lies between; rounding of the sums decides ties.
            let mut here = 0.0;
            while next < count && (next as f64 + 0.5) < until - 1e-9 {
                on_triangle(&mesh, t, &samples[next])?;
                (next, here) = (next + 1, here + 1.0);
            }
            prop_assert!((here - share(t)).abs() <= 1.0 + 1e-6, "{} instead of {}", here, share(t));
            before = until;
        }
        prop_assert_eq!(next, count);
    }
}

/// The point is a convex combination of the corners, and the normal that of the winding.
fn on_triangle(mesh: &TriMesh, t: usize, sample: &hicp_core::Surfel) -> Result<(), TestCaseError> {
    let [a, b, c] = mesh.corners(t).map(|p| p.cast::<f64>());
    let p = sample.point.cast::<f64>();
    let whole = (b - a).cross(&(c - a)).norm();
    let parts = (b - p).cross(&(c - p)).norm()
        + (c - p).cross(&(a - p)).norm()
        + (a - p).cross(&(b - p)).norm();
    // Off the triangle by a rounding of f32 (coordinates below 1 m: 6e-8 m), the parts exceed the whole by that times the perimeter.
    let perimeter = (b - a).norm() + (c - b).norm() + (a - c).norm();
    prop_assert!(
        parts - whole <= 2e-7 * perimeter,
        "{} over {}",
        parts - whole,
        whole
    );
    prop_assert_eq!(sample.normal, mesh.normal(t).unwrap());
    Ok(())
}

#[test]
fn no_points_and_one_point_have_no_diameter() {
    assert_eq!(diameter(&[]), 0.0);
    assert_eq!(diameter(&[Point3::new(1.0, 2.0, 3.0)]), 0.0);
    assert_eq!(diameter(&[Point3::new(1.0, 2.0, 3.0); 100]), 0.0);
}

#[test]
fn samples_of_a_closed_mesh_point_outward_however_it_is_wound() {
    let outward = wedge();
    let triangles = outward
        .triangles()
        .iter()
        .map(|[a, b, c]| [*a, *c, *b])
        .collect();
    let inward = TriMesh::new(outward.vertices().to_vec(), triangles).unwrap();
    assert_eq!(inward.facing(), Facing::Inward);
    for mesh in [outward, inward] {
        let samples = sample_surface(&mesh, 300);
        assert_eq!(samples.len(), 300);
        for sample in samples {
            // The wedge is convex and holds the origin.
            assert!(sample.normal.dot(&sample.point.coords) > 0.0);
        }
    }
}

#[test]
fn samples_cover_a_triangle_evenly() {
    let corners = vec![
        Point3::origin(),
        Point3::new(1.0, 0.0, 0.0),
        Point3::new(0.0, 1.0, 0.0),
    ];
    let mesh = TriMesh::new(corners, vec![[0, 1, 2]]).unwrap();
    let n = 4000;
    let samples = sample_surface(&mesh, n);
    // Each of 16 congruent parts (a 4 × 4 grid of the triangle) gets its sixteenth: 250, to a tenth.
    let mut counts = [0; 16];
    for s in &samples {
        let (x, y) = (4.0 * s.point.x, 4.0 * s.point.y);
        // Points on the longest side (the first sample is its middle) belong to the last part of their row.
        let row = y.floor();
        let column = x.floor().min(3.0 - row);
        let upper = usize::from(row + column < 3.0 && x.fract() + y.fract() > 1.0);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let index = (row * (8.0 - row)) as usize + 2 * column as usize + upper;
        counts[index] += 1;
    }
    assert!(counts.iter().all(|c| (225..=275).contains(c)), "{counts:?}");
    assert!(sample_surface(&mesh, 0).is_empty());
}

#[test]
fn a_model_knows_its_size() {
    let mut vertices = cuboid(0.03, 0.04, 0.12).vertices().to_vec();
    // A vertex that no triangle uses counts for nothing.
    vertices.push(Point3::new(5.0, 5.0, 5.0));
    let vertices = vertices
        .iter()
        .map(|p| Point3::new(p.x + 1.0, p.y, p.z))
        .collect();
    let mesh = TriMesh::new(vertices, support::cuboid_triangles()).unwrap();
    let model = Model::new(mesh.clone());
    // f32 near 1 m: 6e-8 m.
    assert!((model.diameter() - 0.13).abs() < 2e-7);
    assert!((model.radius() - 0.065).abs() < 2e-7);
    assert!((model.center() - Point3::new(1.0, 0.0, 0.0)).norm() < 2e-7);
    assert_eq!(model.samples().len(), 1000);

    let with = |diameter| {
        let config = ModelConfig {
            samples: 7,
            diameter,
            ..ModelConfig::default()
        };
        Model::with_config(mesh.clone(), config)
    };
    assert_eq!(with(Some(0.25)).diameter(), 0.25);
    assert_eq!(with(Some(0.25)).samples().len(), 7);
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(with(Some(bad)).diameter(), model.diameter());
    }
    assert_ne!(model.id(), with(None).id());
    assert_eq!(model.id(), model.clone().id());
}

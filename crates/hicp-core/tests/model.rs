//! Models: size, samples, symmetries, and what is derived from them once.

#![allow(clippy::unwrap_used, clippy::panic, clippy::cast_precision_loss)]

mod support;

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Barrier};

use hicp_core::{
    CONTINUOUS_STEPS, Derived, Facing, Isometry3, Model, ModelConfig, Point3, Symmetries,
    SymmetryAxis, SymmetryError, TriMesh, UnitQuaternion, UnitVector3, Vector3, diameter,
    sample_surface,
};
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

#[test]
fn symmetries_expand_as_in_bop() {
    let axis = SymmetryAxis::new(Vector3::new(0.0, 0.0, 3.0), Point3::new(0.1, 0.2, 0.0)).unwrap();
    let flip = Isometry3::rotation(Vector3::x() * std::f64::consts::PI);
    let symmetries = |discrete: usize, continuous: usize| Symmetries {
        discrete: vec![flip; discrete],
        continuous: vec![axis; continuous],
    };
    assert_eq!(CONTINUOUS_STEPS, 315);
    for (d, c, expected) in [
        (0, 0, 1),
        (1, 0, 2),
        (3, 0, 4),
        (0, 1, 315),
        (1, 1, 630),
        (1, 2, 1260),
    ] {
        let symmetries = symmetries(d, c);
        let motions = symmetries.motions();
        assert_eq!(motions.len(), expected);
        assert_eq!(motions[0], Isometry3::identity());
        assert_eq!(symmetries.is_empty(), expected == 1);
    }
    // continuous ∘ discrete: first flipped, then turned. The steps are 2πi/315.
    let motions = symmetries(1, 1).motions();
    for step in [1, 100, 314] {
        let turn = axis.rotation(std::f64::consts::TAU * step as f64 / 315.0);
        assert_eq!(motions[2 * step], turn);
        assert_eq!(motions[2 * step + 1], turn * flip);
    }
}

#[test]
fn the_motions_of_a_cylinder_leave_it_where_it_is() {
    let mut numbers = Numbers(61);
    for _ in 0..10 {
        let (offset, direction) = (Point3::from(numbers.vector()), numbers.direction());
        let axis = SymmetryAxis::new(direction * numbers.between(1e-3, 1e3), offset).unwrap();
        assert!((axis.direction().norm() - 1.0).abs() < 1e-15);
        // A half turn about a line that crosses the axis at right angles swaps the ends.
        let across = UnitVector3::new_normalize(direction.cross(&numbers.direction()));
        let half_turn = UnitQuaternion::from_axis_angle(&across, std::f64::consts::PI);
        let swap = Isometry3::from_parts(
            (offset.coords - half_turn * offset.coords).into(),
            half_turn,
        );
        let symmetries = Symmetries {
            discrete: vec![swap],
            continuous: vec![axis],
        };
        let point = Point3::from(numbers.vector());
        let shape = |p: Point3<f64>| {
            let along = (p - offset).dot(&direction);
            ((p - offset - direction * along).norm(), along.abs())
        };
        let (radius, height) = shape(point);
        for motion in symmetries.motions() {
            let (r, h) = shape(motion * point);
            assert!((r - radius).abs() < 1e-13 && (h - height).abs() < 1e-13);
        }
    }
}

#[test]
fn an_axis_has_a_direction() {
    let (x, origin) = (Vector3::x(), Point3::origin());
    for bad in [
        Vector3::zeros(),
        x * f64::NAN,
        x * f64::INFINITY,
        Vector3::new(1.0, f64::NAN, 0.0),
    ] {
        assert!(matches!(
            SymmetryAxis::new(bad, origin),
            Err(SymmetryError::Axis { .. })
        ));
    }
    for bad in [f64::NAN, f64::INFINITY] {
        let offset = Point3::new(0.0, bad, 0.0);
        assert!(matches!(
            SymmetryAxis::new(x, offset),
            Err(SymmetryError::Offset { .. })
        ));
    }
    // Whatever its length.
    for length in [1e-300, 1e-12, 1.0, 1e200, f64::MAX] {
        let axis = SymmetryAxis::new(x * length, origin).unwrap();
        assert_eq!(axis.direction().into_inner(), x, "{length}");
    }
}

#[test]
fn a_derived_value_is_built_once_by_however_many_threads() {
    let derived = Derived::default();
    let (built, barrier) = (AtomicUsize::new(0), Barrier::new(8));
    let values: Vec<Arc<usize>> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..8)
            .map(|_| {
                scope.spawn(|| {
                    barrier.wait();
                    derived.get_or_build(7, || {
                        std::thread::sleep(std::time::Duration::from_millis(20));
                        built.fetch_add(1, Ordering::SeqCst)
                    })
                })
            })
            .collect();
        threads.into_iter().map(|t| t.join().unwrap()).collect()
    });
    assert_eq!(built.load(Ordering::SeqCst), 1);
    assert!(
        values
            .iter()
            .all(|v| Arc::ptr_eq(v, &values[0]) && **v == 0)
    );
}

#[test]
fn derived_values_are_told_apart_by_type_and_key() {
    let derived = Derived::default();
    assert_eq!(*derived.get_or_build(1, || 10_u32), 10);
    assert_eq!(*derived.get_or_build(2, || 20_u32), 20);
    assert_eq!(*derived.get_or_build(1, || 30_u64), 30);
    assert_eq!(*derived.get_or_build(1, || 99_u32), 10);
    assert_eq!(*derived.get_or_build(1, || 99_u64), 30);
    // A clone starts afresh.
    assert_eq!(*derived.clone().get_or_build(1, || 40_u32), 40);
}

//! Tests of models: size and samples.

use crate::support::{Numbers, cuboid, wedge};
use hicp_core::{
    Facing, Isometry3, MAX_SAMPLES, Model, ModelConfig, Point3, Symmetries, SymmetryAxis, TriMesh,
    Vector3, sample_surface,
};
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(96) })]

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
        // Samples are in the order of the triangles, so the share of every prefix of the mesh is
        // known.
        let share = |t: usize| mesh.triangle_area(t) / mesh.area() * count as f64;
        let mut before = 0.0_f64;
        let mut next = 0;
        for t in 0..mesh.triangles().len() {
            let until = before + share(t);
            // The i-th sample, at i + ½, belongs to this triangle if it lies between. Rounding of
            // the sums decides ties.
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

/// Checks that the point is a convex combination of the corners, and that the normal is that of the
/// winding.
fn on_triangle(mesh: &TriMesh, t: usize, sample: &hicp_core::Surfel) -> Result<(), TestCaseError> {
    let [a, b, c] = mesh.corners(t).map(|p| p.cast::<f64>());
    let p = sample.point.cast::<f64>();
    let whole = (b - a).cross(&(c - a)).norm();
    let parts = (b - p).cross(&(c - p)).norm()
        + (c - p).cross(&(a - p)).norm()
        + (a - p).cross(&(b - p)).norm();
    // A point off the triangle by the rounding of f32 (6e-8 m below 1 m) makes the sum of the parts
    // exceed the whole by that times the perimeter.
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
fn sample_normals_of_a_closed_mesh_point_outward_for_either_winding() {
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
            // The wedge is convex and contains the origin.
            assert!(sample.normal.dot(&sample.point.coords) > 0.0);
        }
    }
}

#[test]
fn the_number_of_samples_is_limited() {
    let corners = vec![
        Point3::origin(),
        Point3::new(1.0, 0.0, 0.0),
        Point3::new(0.0, 1.0, 0.0),
    ];
    let mesh = TriMesh::new(corners, vec![[0, 1, 2]]).unwrap();
    assert_eq!(sample_surface(&mesh, usize::MAX).len(), MAX_SAMPLES);
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
    // Each of 16 congruent parts (a 4 × 4 grid of the triangle) receives a sixteenth, 250, within a
    // tenth.
    let mut counts = [0; 16];
    for s in &samples {
        let (x, y) = (4.0 * s.point.x, 4.0 * s.point.y);
        // Points on the longest side, such as the first sample in its middle, belong to the last
        // part of their row.
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
fn samples_follow_robertss_sequence_and_border_samples_belong_to_the_later_triangle() {
    // The plastic number, g³ = g + 1: the iteration has a slope of a third there.
    let g = (0..60).fold(1.3_f64, |g, _| (g + 1.0).cbrt());
    let corner = |x: f32, y: f32| Point3::new(x, y, 0.0);
    let square = vec![
        corner(0.0, 0.0),
        corner(1.0, 0.0),
        corner(1.0, 1.0),
        corner(0.0, 1.0),
    ];
    let mesh = TriMesh::new(square.clone(), vec![[0, 1, 3]]).unwrap();
    for (i, sample) in sample_surface(&mesh, 500).iter().enumerate() {
        let place = [g.recip(), g.powi(-2)].map(|step| (0.5 + i as f64 * step).fract());
        let [s, t] = match place {
            [s, t] if s + t > 1.0 => [1.0 - s, 1.0 - t],
            inside => inside,
        };
        // Rounded to f32 below 1; the error of the reference's steps, 1e-16, accumulates 500 times.
        let expected = Point3::new(s, t, 0.0);
        assert!((sample.point.cast::<f64>() - expected).norm() < 1e-7, "{i}");
    }
    // The two halves meet at half of the area. The first point, (½, ½), is the middle of the
    // opposite edge.
    for triangles in [vec![[0, 1, 2], [0, 2, 3]], vec![[0, 2, 3], [0, 1, 2]]] {
        let [_, b, c] = triangles[1].map(|i: u32| square[i as usize]);
        let mesh = TriMesh::new(square.clone(), triangles).unwrap();
        assert_eq!(sample_surface(&mesh, 1)[0].point, nalgebra::center(&b, &c));
    }
}

#[test]
fn a_model_reports_its_size() {
    let mut vertices = cuboid(0.03, 0.04, 0.12).vertices().to_vec();
    // A vertex that no triangle uses does not count.
    vertices.push(Point3::new(5.0, 5.0, 5.0));
    let vertices = vertices
        .iter()
        .map(|p| Point3::new(p.x + 1.0, p.y, p.z))
        .collect();
    let mesh = TriMesh::new(vertices, crate::support::cuboid_triangles()).unwrap();
    let model = Model::new(mesh.clone());
    // The resolution of f32 near 1 m is 6e-8 m.
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
fn a_model_keeps_its_symmetries() {
    assert!(Model::new(wedge()).symmetries().is_empty());
    let symmetries = Symmetries {
        discrete: vec![Isometry3::rotation(Vector3::y() * std::f64::consts::PI)],
        continuous: vec![SymmetryAxis::new(Vector3::z(), Point3::origin()).unwrap()],
    };
    let config = ModelConfig {
        symmetries: symmetries.clone(),
        ..ModelConfig::default()
    };
    let model = Model::with_config(wedge(), config);
    assert_eq!(*model.symmetries(), symmetries);
}

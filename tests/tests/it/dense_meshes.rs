//! Dense meshes, of which a simplified one is rendered.

use std::collections::HashMap;

use hicp_sim::Household;
use hybrid_icp::core::{
    ColorImage, DepthImage, Isometry3, Mask, Model, ModelConfig, Observation, PinholeCamera,
    Point3, Problem, RenderedView, Renderer, SurfaceColor, TriMesh, UnitQuaternion, Vector3,
};
use hybrid_icp::raster::Rasterizer;

/// Returns a mesh with each triangle cut into four, until it has many.
fn subdivided(mesh: &TriMesh) -> TriMesh {
    let mut mesh = mesh.clone();
    while mesh.triangles().len() < 50_000 {
        let mut vertices = mesh.vertices().to_vec();
        let mut middles = HashMap::new();
        let mut triangles = Vec::new();
        for &[a, b, c] in mesh.triangles() {
            let [x, y, z] = [(a, b), (b, c), (c, a)].map(|(i, j)| {
                *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    let [p, q] = [i, j].map(|corner| vertices[corner as usize].coords);
                    vertices.push(Point3::from((p + q) / 2.0));
                    vertices.len() as u32 - 1
                })
            });
            triangles.extend([[a, x, z], [x, b, y], [z, y, c], [x, y, z]]);
        }
        mesh = TriMesh::new(vertices, triangles).unwrap();
    }
    mesh
}

/// Returns a mesh whose triangles share no vertices, as STL files have them.
fn soup(mesh: &TriMesh) -> TriMesh {
    let corners = (0..mesh.triangles().len()).flat_map(|triangle| mesh.corners(triangle));
    let triangles = (0..mesh.triangles().len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
    TriMesh::new(corners.collect(), triangles.collect()).unwrap()
}

/// Renders two meshes and returns the differences of depth, ascending, and the number of pixels
/// that only one of them covers.
fn differences([a, b]: [&TriMesh; 2], center: Point3<f64>, meters: f64) -> (Vec<f64>, usize) {
    let camera = PinholeCamera::new(500.0, 500.0, 159.5, 119.5, 320, 240).unwrap();
    let mut rasterizer = Rasterizer::default();
    let (mut differences, mut one) = (Vec::new(), 0);
    for step in 0..3 {
        let turn = UnitQuaternion::new(Vector3::new(0.7, 1.9, 0.4) * f64::from(step));
        let to_camera = Vector3::new(0.0, 0.0, meters) - turn * center.coords;
        let pose = Isometry3::from_parts(to_camera.into(), turn);
        let [a, b] = [a, b].map(|mesh| {
            let mut view = RenderedView::default();
            rasterizer.render(mesh, &camera, &pose, &camera.region(), &mut view);
            view
        });
        for (u, v) in camera.region().pixels() {
            match [&a, &b].map(|view| f64::from(view.depth_at(u, v))) {
                [a, b] if a > 0.0 && b > 0.0 => differences.push((a - b).abs()),
                [a, b] => one += usize::from(a + b > 0.0),
            }
        }
    }
    differences.sort_by(f64::total_cmp);
    (differences, one)
}

#[test]
fn a_render_of_the_simplified_mesh_hardly_differs() {
    for (index, object) in Household::ALL.into_iter().enumerate() {
        let mesh = subdivided(object.model().unwrap().mesh());
        let mesh = if index % 2 == 0 { soup(&mesh) } else { mesh };
        let model = Model::new(mesh.clone());
        let drawn = model.drawn();
        let triangles = drawn.triangles().len();
        assert!(
            (5_000..20_000).contains(&triangles),
            "{object:?}: {triangles}"
        );
        assert_eq!(drawn.facing(), mesh.facing());
        let diameter = model.diameter();
        let (differences, one) = differences([&mesh, drawn], model.center(), 3.0 * diameter);
        let quantile = |percent| differences[differences.len() * percent / 100] / diameter;
        let [median, most] = [50, 95].map(quantile);
        assert!(median < 2e-4 && most < 1e-3, "{object:?}: {median} {most}");
        assert!(one < differences.len() / 100, "{object:?}: {one}");
    }
}

#[test]
fn a_mesh_is_rendered_as_it_is_if_it_is_small_or_should_be_or_colors_are_compared() {
    let small = Household::Mug.model().unwrap();
    assert!(std::ptr::eq(small.drawn(), small.mesh()));
    let dense = subdivided(small.mesh());
    let gray = SurfaceColor::Vertices(vec![[90; 3]; dense.vertices().len()]);
    let colored = Model::new(dense.clone().with_color(gray).unwrap());
    assert!(!std::ptr::eq(colored.drawn(), colored.mesh()));
    let depth = DepthImage::from_meters(4, 4, vec![1.0; 16]).unwrap();
    let camera = PinholeCamera::new(4.0, 4.0, 1.5, 1.5, 4, 4).unwrap();
    let observation = Observation::new(depth.clone(), Mask::measured(&depth), camera).unwrap();
    let image = ColorImage::new(4, 4, vec![[90; 3]; 16]).unwrap();
    let with_color = observation.clone().with_color(image).unwrap();
    for (observation, compared) in [(&observation, false), (&with_color, true)] {
        let drawn = Problem::new(&colored, observation).drawn().unwrap();
        assert_eq!(std::ptr::eq(drawn, colored.mesh()), compared);
    }
    let config = ModelConfig {
        simplify_above: usize::MAX,
        ..ModelConfig::default()
    };
    let exact = Model::with_config(dense, config);
    assert!(std::ptr::eq(exact.drawn(), exact.mesh()));
}

#[test]
fn noise_without_a_surface_is_not_simplified() {
    // No two vertices are in one cell, so nothing would go.
    let vertices = (0..90_000_u32).map(|i| {
        let hashed = |k: u32| (i.wrapping_mul(k) >> 8) as f32 / (1 << 24) as f32;
        Point3::new(
            hashed(2_654_435_761),
            hashed(2_246_822_519),
            hashed(3_266_489_917),
        )
    });
    let triangles = (0..30_000).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
    let model = Model::new(TriMesh::new(vertices.collect(), triangles.collect()).unwrap());
    assert!(std::ptr::eq(model.drawn(), model.mesh()));
}

//! Tests of changes that must not change the result, to the bit.

use crate::common::*;
use hicp_core::{Facing, Isometry3, PixelRegion, Point2, Point3, RenderedView, Renderer, TriMesh};
use hicp_raster::Culling;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{Config, TestRunner};

fn any_mesh() -> impl Strategy<Value = TriMesh> {
    prop_oneof![soup(), closed_mesh()]
}

fn region() -> impl Strategy<Value = PixelRegion> {
    let camera = camera();
    let (w, h) = (camera.width() + 10, camera.height() + 10);
    (0..w, 0..w, 0..h, 0..h).prop_map(|(a, b, c, d)| PixelRegion {
        u_min: a.min(b),
        u_max: a.max(b),
        v_min: c.min(d),
        v_max: c.max(d),
    })
}

/// Returns the part of a region that a mesh can cover, by the definition of the rasterizer.
fn projected_region(mesh: &TriMesh, pose: &Isometry3<f64>, region: &PixelRegion) -> PixelRegion {
    let points = mesh.vertices().iter().map(|p| pose * p.cast::<f64>());
    let (beyond, near): (Vec<Point3<f64>>, Vec<_>) = points.partition(|p| p.z >= 0.01);
    if !beyond.is_empty() && !near.is_empty() && !region.is_empty() {
        return *region;
    }
    let pixels = beyond.iter().map(|p| camera().project(p).unwrap());
    let both = pixels.map(|pixel| [pixel; 2]);
    let both = both.reduce(|[low, high], [pixel, _]| [low.inf(&pixel), high.sup(&pixel)]);
    // An edge may shift by rounding.
    let [low, high] = both.unwrap_or([Point2::origin(), Point2::new(-1.0, -1.0)]);
    let [low, high] = [
        low.map(|x| (x - 1e-5).ceil()),
        high.map(|x| (x + 1e-5).floor() + 1.0),
    ];
    let covered = PixelRegion {
        u_min: low.x as u32,
        u_max: high.x as u32,
        v_min: low.y as u32,
        v_max: high.y as u32,
    };
    let covered = covered.intersection(region);
    if covered.is_empty() {
        PixelRegion::default()
    } else {
        covered
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn the_order_of_triangles_does_not_matter(
        (mesh, order) in any_mesh().prop_flat_map(|mesh| {
            let order: Vec<usize> = (0..mesh.triangles().len()).collect();
            (Just(mesh), Just(order).prop_shuffle())
        }),
        pose in pose(-0.1..0.8),
    ) {
        let camera = camera();
        let triangles = order.iter().map(|&t| mesh.triangles()[t]).collect();
        let shuffled = TriMesh::new(mesh.vertices().to_vec(), triangles).unwrap();
        let first = render(Culling::Auto, &mesh, &camera, &pose);
        let second = render(Culling::Auto, &shuffled, &camera, &pose);
        prop_assert_eq!(depth_bits(&first, &camera), depth_bits(&second, &camera));
    }

    #[test]
    fn the_requested_region_does_not_matter(mesh in any_mesh(), pose in pose(-0.1..0.8), region in region()) {
        let camera = camera();
        let full = render(Culling::Auto, &mesh, &camera, &pose);
        let part = render_region(&mut rasterizer(Culling::Auto), &mesh, &camera, &pose, &region);
        let inside = part.region();
        prop_assert!(inside.is_empty() || inside.intersection(&region) == inside);
        for (u, v) in pixels(&camera) {
            if region.contains(u, v) {
                prop_assert_eq!(part.depth_at(u, v).to_bits(), full.depth_at(u, v).to_bits());
                let id = |view: &RenderedView| view.region().index(u, v).map(|i| view.triangles()[i]);
                prop_assert!(part.depth_at(u, v) == 0.0 || id(&part) == id(&full));
            } else {
                prop_assert!(!inside.contains(u, v));
            }
        }
    }

    #[test]
    fn earlier_renders_do_not_matter(
        meshes in [any_mesh(), any_mesh()],
        poses in [pose(-0.1..0.8), pose(-0.1..0.8)],
    ) {
        let camera = camera();
        let fresh = render(Culling::Auto, &meshes[1], &camera, &poses[1]);
        let (mut used, mut view) = (rasterizer(Culling::Auto), RenderedView::default());
        used.render(&meshes[0], &camera, &poses[0], &camera.region(), &mut view);
        used.render(&meshes[1], &camera, &poses[1], &camera.region(), &mut view);
        prop_assert_eq!(view, fresh);
    }

    #[test]
    fn the_winding_of_a_closed_mesh_does_not_matter(mesh in closed_mesh(), pose in pose(-0.1..0.8)) {
        let camera = camera();
        let inward = flipped(&mesh);
        prop_assert_eq!(mesh.facing(), Facing::Outward);
        prop_assert_eq!(inward.facing(), Facing::Inward);
        let outward = render(Culling::Auto, &mesh, &camera, &pose);
        let inward = render(Culling::Auto, &inward, &camera, &pose);
        // Corners are processed in another order, so the last bit may differ.
        for (&a, &b) in outward.depth().iter().zip(inward.depth()) {
            prop_assert!((a - b).abs() <= 3e-7 * a, "{} {}", a, b);
        }
        prop_assert_eq!(outward.region(), inward.region());
    }

    #[test]
    fn the_view_covers_the_projected_region(mesh in any_mesh(), pose in pose(-0.3..0.8), region in region()) {
        let camera = camera();
        let view = render_region(&mut rasterizer(Culling::Auto), &mesh, &camera, &pose, &region);
        let expected = projected_region(&mesh, &pose, &region.intersection(&camera.region()));
        prop_assert_eq!(view.region(), expected);
    }
}

/// Culling removes only hidden triangles.
///
/// The seed is fixed. At a pixel center within 2⁻²⁰ pixel of a silhouette, which occurs in one of a
/// hundred thousand images, the two may differ by the distance between front and back.
#[test]
fn culling_a_closed_mesh_does_not_matter() {
    let mut runner = TestRunner::new_with_rng(
        Config::default(),
        proptest::test_runner::TestRng::deterministic_rng(
            proptest::test_runner::RngAlgorithm::ChaCha,
        ),
    );
    let camera = camera();
    let mut covered = 0;
    for _ in 0..400 {
        let mesh = closed_mesh().new_tree(&mut runner).unwrap().current();
        let pose = pose(0.05..0.8).new_tree(&mut runner).unwrap().current();
        let all = render(Culling::Never, &mesh, &camera, &pose);
        let culled = render(Culling::Auto, &mesh, &camera, &pose);
        assert_eq!(
            depth_bits(&all, &camera),
            depth_bits(&culled, &camera),
            "{pose}"
        );
        covered += all.depth().iter().filter(|z| **z > 0.0).count();
    }
    assert!(covered > 50_000);
}

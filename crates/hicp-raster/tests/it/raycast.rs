//! Tests of the rasterizer against an independent ray caster.

use crate::common::*;
use hicp_core::{Isometry3, PinholeCamera, PixelCenters, Point3, TriMesh};
use hicp_raster::Culling;
use proptest::prelude::*;

/// Checks the rendering of a mesh.
fn check(mesh: &TriMesh, pose: &Isometry3<f64>) {
    let camera = camera();
    let view = render(Culling::Auto, mesh, &camera, pose);
    assert_agrees(&view, mesh, &camera, pose, 1e-4);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_soup_in_front_of_the_camera(mesh in soup(), pose in pose(0.4..1.5)) {
        check(&mesh, &pose);
    }

    #[test]
    fn a_soup_around_the_camera(mesh in soup(), pose in pose(-0.2..0.3)) {
        check(&mesh, &pose);
    }

    #[test]
    fn a_closed_mesh_in_front_of_the_camera(mesh in closed_mesh(), pose in pose(0.25..1.5)) {
        check(&mesh, &pose);
    }

    #[test]
    fn a_closed_mesh_around_the_camera(mesh in closed_mesh(), pose in pose(-0.1..0.15)) {
        check(&mesh, &pose);
    }

    /// Away from surfaces that are nearly edge-on, depth is accurate to its `f32`.
    #[test]
    fn depth_of_a_facing_surface_is_accurate_to_the_last_bits(pose in pose(0.3..2.0)) {
        let (mesh, camera) = (icosphere(1), camera());
        let view = render(Culling::Auto, &mesh, &camera, &pose);
        for (u, v) in pixels(&camera) {
            let depth = view.depth_at(u, v);
            let surfel = view.surfel_at(u, v, &mesh, &camera, &pose);
            let Some(surfel) = surfel else { continue };
            let cosine = -surfel.normal.dot(&surfel.point.coords.normalize());
            if cosine > 0.1 && !near_an_edge(&mesh, &camera, &pose, u, v, 1.0 / 64.0) {
                let cast = cast(&mesh, &camera, &pose, u, v).unwrap();
                prop_assert!((f64::from(depth) - cast).abs() <= 1.2e-7 * cast, "{} {}", depth, cast);
            }
        }
    }

    /// The ray must meet the reported triangle at the reported depth.
    #[test]
    fn the_reported_triangle_is_the_visible_one(mesh in soup(), pose in pose(0.2..1.0)) {
        let camera = camera();
        let view = render(Culling::Auto, &mesh, &camera, &pose);
        for (u, v) in pixels(&camera) {
            let depth = view.depth_at(u, v);
            if depth == 0.0 || near_an_edge(&mesh, &camera, &pose, u, v, 1.0 / 64.0) {
                continue;
            }
            let index = view.region().index(u, v).unwrap();
            let alone = mesh.corners(view.triangles()[index] as usize);
            let alone = TriMesh::new(alone.to_vec(), vec![[0, 1, 2]]).unwrap();
            let cast = cast(&alone, &camera, &pose, u, v).unwrap();
            prop_assert!((f64::from(depth) - cast).abs() <= 1e-4 * cast);
        }
    }
}

#[test]
fn the_compared_images_show_surface() {
    let (mesh, camera) = (icosphere(2), camera());
    let pose = Isometry3::translation(0.0, -0.1, 0.4);
    let view = render(Culling::Auto, &mesh, &camera, &pose);
    assert!(assert_agrees(&view, &mesh, &camera, &pose, 1e-6) > 300);
}

#[test]
fn pixel_centers_at_halves_shift_by_half_a_pixel() {
    let halves = PixelCenters::AtHalves;
    let camera = PinholeCamera::with_pixel_centers(halves, 40.0, 40.0, 16.0, 16.0, 32, 32).unwrap();
    // A slanted plane z = 1 + x/2 + y/4, large enough to fill the image.
    let corner = |x: f32, y: f32| Point3::new(x, y, 1.0 + x / 2.0 + y / 4.0);
    let mesh = TriMesh::new(
        vec![corner(-1.2, -1.2), corner(4.0, -1.2), corner(-1.2, 4.0)],
        vec![[0, 1, 2]],
    )
    .unwrap();
    let view = render(Culling::Auto, &mesh, &camera, &Isometry3::identity());
    for (u, v) in pixels(&camera) {
        // By the calibration's own convention, the center of pixel u is at u + ½.
        let x = (f64::from(u) + 0.5 - 16.0) / 40.0;
        let y = (f64::from(v) + 0.5 - 16.0) / 40.0;
        let depth = 1.0 / (1.0 - x / 2.0 - y / 4.0);
        assert!(
            (f64::from(view.depth_at(u, v)) - depth).abs() < 1e-6 * depth,
            "({u}, {v})"
        );
    }
}

//! Tests of scenes that are hard to render.

use crate::common::*;
use hicp_core::{
    Isometry3, MAX_FOCAL_LENGTH, NO_TRIANGLE, PinholeCamera, PixelRegion, Point3, RenderedView,
    Renderer, TriMesh,
};
use hicp_raster::{Culling, RasterConfig, Rasterizer, render_depth_image};

fn square(half: f32) -> TriMesh {
    TriMesh::new(
        vec![
            Point3::new(-half, -half, 0.0),
            Point3::new(half, -half, 0.0),
            Point3::new(half, half, 0.0),
            Point3::new(-half, half, 0.0),
        ],
        vec![[0, 1, 2], [0, 2, 3]],
    )
    .unwrap()
}

fn at(x: f64, y: f64, z: f64) -> Isometry3<f64> {
    Isometry3::translation(x, y, z)
}

/// Renders over a view with previous content.
fn render_over(
    config: RasterConfig,
    mesh: &TriMesh,
    pose: &Isometry3<f64>,
    region: &PixelRegion,
) -> RenderedView {
    let mut view = RenderedView::default();
    let mut rasterizer = Rasterizer::new(config);
    rasterizer.render(
        &square(1.0),
        &camera(),
        &at(0.0, 0.0, 0.5),
        &camera().region(),
        &mut view,
    );
    assert!(!view.region().is_empty());
    rasterizer.render(mesh, &camera(), pose, region, &mut view);
    view
}

#[test]
fn invisible_scenes_give_an_empty_view() {
    let config = RasterConfig::default();
    let image = camera().region();
    let aside = PixelRegion {
        u_min: 0,
        v_min: 0,
        u_max: 3,
        v_max: 3,
    };
    let nothing = PixelRegion {
        u_min: 9,
        v_min: 9,
        u_max: 9,
        v_max: 12,
    };
    let outside = PixelRegion {
        u_min: 100,
        v_min: 100,
        u_max: 120,
        v_max: 120,
    };
    let cases = [
        ("behind", at(0.0, 0.0, -1.0), image),
        ("before the near plane", at(0.0, 0.0, 0.0099), image),
        ("next to it", at(5.0, 0.0, 1.0), image),
        ("far next to it", at(1.0e6, 0.0, 1.0), image),
        ("not in the region", at(0.1, 0.0, 1.0), aside),
        ("no region", at(0.0, 0.0, 1.0), nothing),
        ("region out of the image", at(0.0, 0.0, 1.0), outside),
        ("nowhere", at(f64::NAN, 0.0, 1.0), image),
        ("at infinity", at(0.0, 0.0, f64::INFINITY), image),
        ("beyond numbers", at(0.0, 0.0, 1.0e300), image),
    ];
    for (what, pose, region) in cases {
        let view = render_over(config, &square(0.05), &pose, &region);
        assert_eq!(view.region(), PixelRegion::default(), "{what}");
        assert!(
            view.depth().is_empty() && view.triangles().is_empty(),
            "{what}"
        );
    }
}

#[test]
fn a_surface_larger_than_the_view_fills_it() {
    let view = render_over(
        RasterConfig::default(),
        &square(3.0),
        &at(0.0, 0.0, 1.0),
        &camera().region(),
    );
    assert_eq!(view.region(), camera().region());
    assert!(view.depth().iter().all(|z| *z == 1.0));
    assert!(view.triangles().iter().all(|t| *t < 2));
}

#[test]
fn pixels_have_a_triangle_exactly_if_they_have_depth() {
    let mesh = torus(12, 7);
    for z in [0.0, 0.05, 0.4] {
        let view = render(Culling::Auto, &mesh, &camera(), &at(0.0, 0.0, z));
        for (&depth, &triangle) in view.depth().iter().zip(view.triangles()) {
            assert!(depth.is_finite() && depth >= 0.0);
            assert_eq!(depth == 0.0, triangle == NO_TRIANGLE);
            assert!(depth == 0.0 || (triangle as usize) < mesh.triangles().len());
        }
        let shown = view.depth().iter().filter(|z| **z > 0.0).count();
        assert_eq!(view.n_rendered(), shown);
    }
}

#[test]
fn the_near_plane_clips_at_its_distance() {
    // A floor half a meter below the camera, from behind it to 10 m.
    let camera = PinholeCamera::new(50.0, 50.0, 32.0, 0.0, 65, 200).unwrap();
    let mesh = TriMesh::new(
        vec![
            Point3::new(-20.0, 0.5, -5.0),
            Point3::new(20.0, 0.5, -5.0),
            Point3::new(0.0, 0.5, 60.0),
        ],
        vec![[0, 1, 2]],
    )
    .unwrap();
    for near in [0.01, 0.15, 0.3, 1.1] {
        for culling in [Culling::Auto, Culling::Never] {
            let mut rasterizer = Rasterizer::new(RasterConfig {
                near_meters: near,
                culling,
            });
            let view = render_region(
                &mut rasterizer,
                &mesh,
                &camera,
                &Isometry3::identity(),
                &camera.region(),
            );
            for v in 1..200 {
                let depth = 0.5 * 50.0 / f64::from(v);
                let rendered = f64::from(view.depth_at(32, v));
                if depth > near * (1.0 + 1e-6) && depth < 50.0 {
                    assert!(
                        (rendered - depth).abs() < 1e-6 * depth,
                        "near {near}, row {v}: {rendered}"
                    );
                } else if depth < near * (1.0 - 1e-6) {
                    assert_eq!(rendered, 0.0, "near {near}, row {v}");
                }
            }
        }
    }
}

#[test]
fn a_closed_mesh_around_the_camera_shows_its_inside() {
    let (mesh, camera) = (icosphere(2), camera());
    let inside = render(Culling::Auto, &mesh, &camera, &Isometry3::identity());
    assert_eq!(inside.region(), camera.region());
    assert!(inside.depth().iter().all(|z| *z > 0.05));
    // Only its back faces are visible.
    let culled = render(Culling::BackFaces, &mesh, &camera, &Isometry3::identity());
    assert!(culled.depth().iter().all(|z| *z == 0.0));
}

#[test]
fn back_faces_follow_their_winding() {
    let camera = camera();
    let pose = at(0.0, -0.1, 0.4);
    let outward = icosphere(1);
    let auto = render(Culling::Auto, &outward, &camera, &pose);
    assert_eq!(render(Culling::BackFaces, &outward, &camera, &pose), auto);
    // With inverted winding, the far side is drawn.
    let inside_out = render(Culling::BackFaces, &flipped(&outward), &camera, &pose);
    assert!(inside_out.depth_at(21, 19) > auto.depth_at(21, 19) + 0.1);
    // An open mesh is drawn from both sides, unless the configuration says otherwise.
    let (seen, turned) = (flipped(&square(0.1)), square(0.1));
    let count = |mesh: &TriMesh, culling| {
        let view = render(culling, mesh, &camera, &pose);
        view.depth().iter().filter(|z| **z > 0.0).count()
    };
    assert!(count(&seen, Culling::Auto) > 100);
    assert_eq!(count(&seen, Culling::Auto), count(&turned, Culling::Auto));
    assert_eq!(
        count(&seen, Culling::BackFaces),
        count(&seen, Culling::Auto)
    );
    assert_eq!(count(&turned, Culling::BackFaces), 0);
}

#[test]
fn degenerate_triangles_are_skipped() {
    let camera = camera();
    let square = square(0.2);
    let mut vertices = square.vertices().to_vec();
    // A point, a line on pixel centers, and a repeated corner, all nearer than the square.
    vertices.extend([
        Point3::new(0.0, 0.0, -0.1),
        Point3::new(0.1, 0.0, -0.1),
        Point3::new(-0.1, 0.0, -0.1),
    ]);
    let mut triangles = vec![[4, 4, 4], [5, 4, 6], [4, 5, 4]];
    triangles.extend(square.triangles());
    let with = TriMesh::new(vertices, triangles).unwrap();
    let pose = at((22.0 - 21.3) / 52.0, (30.0 - 30.8) / 47.5, 1.0);
    let with = render(Culling::Auto, &with, &camera, &pose);
    let without = render(Culling::Auto, &square, &camera, &pose);
    assert_eq!(depth_bits(&with, &camera), depth_bits(&without, &camera));
    let shown: Vec<_> = with
        .triangles()
        .iter()
        .filter(|t| **t != NO_TRIANGLE)
        .collect();
    assert!(!shown.is_empty() && shown.iter().all(|t| **t >= 3));
}

#[test]
fn a_surface_seen_edge_on_stays_in_its_depth_range() {
    // A wall along the optical axis from 0.8 m to 1.2 m, less than a sub-pixel next to a column of
    // pixel centers. Rounding gives it a width and a pixel, where its plane is at infinity.
    let camera = PinholeCamera::new(50.0, 50.0, 20.0, 20.0, 41, 41).unwrap();
    let wall = TriMesh::new(
        vec![
            Point3::new(0.0, -0.2, -0.2),
            Point3::new(0.0, 0.2, -0.2),
            Point3::new(0.0, 0.2, 0.2),
            Point3::new(0.0, -0.2, 0.2),
        ],
        vec![[0, 1, 2], [0, 2, 3]],
    )
    .unwrap();
    let mut drawn = 0;
    for step in -200..=200 {
        let pose = at(f64::from(step) * 1e-10, 0.0, 1.0);
        let view = render(Culling::Auto, &wall, &camera, &pose);
        for &z in view.depth().iter().filter(|z| **z != 0.0) {
            assert!((0.799_999..1.200_001).contains(&z), "{z}");
            drawn += 1;
        }
    }
    assert!(drawn > 100);
}

#[test]
fn a_mesh_a_thousand_kilometers_away_is_rendered() {
    let camera = PinholeCamera::new(1.0e6, 1.0e6, 20.0, 20.0, 41, 41).unwrap();
    let view = render(Culling::Auto, &square(10.0), &camera, &at(0.0, 0.0, 1.0e6));
    // 20 m at 1 m per pixel.
    assert_eq!(view.depth().iter().filter(|z| **z > 0.0).count(), 400);
    assert!(view.depth().iter().all(|z| *z == 0.0 || *z == 1.0e6));
}

#[test]
fn huge_triangles_are_clipped_and_agree_with_rays() {
    let camera = camera();
    let mesh = square(9.0e5);
    let tilted = Isometry3::rotation(hicp_core::Vector3::new(0.3, 0.2, 0.1));
    // In front of the camera, and through its plane.
    for pose in [at(0.0, 0.0, 1.5) * tilted, at(0.0, 0.0, 0.02) * tilted] {
        let view = render(Culling::Auto, &mesh, &camera, &pose);
        assert_eq!(
            assert_agrees(&view, &mesh, &camera, &pose, 1e-6),
            camera.region().area()
        );
    }
    // Beyond the guard band without reaching the near plane.
    let wide = TriMesh::new(
        vec![
            Point3::new(-1.0e4, -1.0e4, 1.0),
            Point3::new(1.0e4, -1.0e4, 2.0),
            Point3::new(0.0, 2.0e4, 1.5),
        ],
        vec![[0, 1, 2]],
    )
    .unwrap();
    let pose = Isometry3::identity();
    let view = render(Culling::Auto, &wide, &camera, &pose);
    assert_eq!(
        assert_agrees(&view, &wide, &camera, &pose, 1e-6),
        camera.region().area()
    );
}

#[test]
fn an_image_of_one_pixel() {
    let camera = PinholeCamera::new(1.0, 1.0, 0.0, 0.0, 1, 1).unwrap();
    let view = render(Culling::Auto, &square(0.5), &camera, &at(0.0, 0.0, 2.0));
    assert_eq!((view.depth(), view.region()), (&[2.0][..], camera.region()));
    let beside = render(Culling::Auto, &square(0.5), &camera, &at(2.0, 0.0, 2.0));
    assert!(beside.region().is_empty());
}

#[test]
fn any_near_plane_is_valid() {
    for near_meters in [f64::NAN, f64::NEG_INFINITY, -1.0, 0.0, 1e-300] {
        let config = RasterConfig {
            near_meters,
            ..RasterConfig::default()
        };
        let view = render_over(
            config,
            &square(1.0),
            &at(0.0, 0.0, 0.001),
            &camera().region(),
        );
        assert!(view.depth().iter().all(|z| *z == 0.001), "{near_meters}");
    }
    let config = RasterConfig {
        near_meters: 2.0,
        ..RasterConfig::default()
    };
    let mut view = RenderedView::default();
    Rasterizer::new(config).render(
        &square(1.0),
        &camera(),
        &at(0.0, 0.0, 1.9),
        &camera().region(),
        &mut view,
    );
    assert!(view.region().is_empty());
}

#[test]
fn the_depth_image_contains_the_view() {
    let (mesh, camera) = (torus(12, 7), camera());
    for pose in [at(0.03, -0.1, 0.5), at(0.0, 0.0, 0.05), at(0.0, 0.0, -1.0)] {
        let image = render_depth_image(&mesh, &camera, &pose);
        let view = render(Culling::Auto, &mesh, &camera, &pose);
        assert_eq!(
            (image.width(), image.height()),
            (camera.width(), camera.height())
        );
        for (u, v) in pixels(&camera) {
            assert_eq!(image.get(u, v), Some(view.depth_at(u, v)));
        }
    }
}

/// Rendering the same again uses the same memory.
#[test]
fn a_warm_view_keeps_its_buffers() {
    let (mesh, camera) = (torus(12, 7), camera());
    let (mut rasterizer, mut view) = (Rasterizer::default(), RenderedView::default());
    let pose = at(0.0, 0.0, 0.3);
    rasterizer.render(&mesh, &camera, &pose, &camera.region(), &mut view);
    let before = (
        view.depth().as_ptr(),
        view.triangles().as_ptr(),
        view.clone(),
    );
    for z in [0.5, 0.9, 0.3] {
        rasterizer.render(
            &mesh,
            &camera,
            &at(0.0, 0.0, z),
            &camera.region(),
            &mut view,
        );
    }
    assert_eq!(
        (view.depth().as_ptr(), view.triangles().as_ptr(), view),
        before
    );
}

/// Tests focal lengths far beyond those of cameras, up to the largest accepted one.
///
/// Beyond it, pixels would leave the range of `f64`, and infinities of both signs would meet in
/// clipping.
#[test]
fn the_longest_focal_lengths_do_not_panic() {
    let corners = [[-0.57, -0.57, 0.125], [0.5, 0.5, 0.42], [0.0, 0.0, -0.1]].map(Point3::from);
    let long = TriMesh::new(corners.to_vec(), vec![[0, 1, 2]]).unwrap();
    for huge in [1e6, 1e8, MAX_FOCAL_LENGTH] {
        let cameras = [
            (huge, 500.0, 16.0, 12.0),
            (500.0, huge, 16.0, 12.0),
            (500.0, 500.0, huge, 12.0),
            (500.0, 500.0, 16.0, -huge),
            (huge, 500.0, -huge, 12.0),
            (huge, huge, 16.0, 12.0),
        ];
        for (fx, fy, cx, cy) in cameras {
            let camera = PinholeCamera::new(fx, fy, cx, cy, 32, 24).unwrap();
            for mesh in [&long, &square(1e-3), &square(1.0), &square(1e5)] {
                for tilt in [0.0, 0.3, 1.2] {
                    // Across the near plane and beyond it.
                    for z in [0.0, 0.5, 0.6, 1e3] {
                        let turn = Isometry3::rotation([tilt, tilt, 0.0].into());
                        let view = render(Culling::Never, mesh, &camera, &(at(0.0, 0.0, z) * turn));
                        assert!(view.depth().iter().all(|z| z.is_finite() && *z >= 0.0));
                    }
                }
            }
        }
    }
}

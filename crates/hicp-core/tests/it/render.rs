//! Tests of rendered views and the cache that avoids repeated renders.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::support::{Numbers, RayCaster, bits, cuboid, observe, pose, wedge};
use hicp_core::{
    Context, Isometry3, Model, NO_TRIANGLE, PinholeCamera, PixelRegion, Problem, RenderCache,
    RenderedView, Renderer, TriMesh, Vector3,
};

fn camera() -> PinholeCamera {
    PinholeCamera::new(90.0, 92.0, 23.0, 17.5, 48, 36).unwrap()
}

fn region(u_min: u32, v_min: u32, u_max: u32, v_max: u32) -> PixelRegion {
    PixelRegion {
        u_min,
        v_min,
        u_max,
        v_max,
    }
}

/// Renders a pose into a new view with the ray caster.
fn fresh(
    mesh: &TriMesh,
    camera: &PinholeCamera,
    pose: &Isometry3<f64>,
    region: &PixelRegion,
) -> RenderedView {
    let mut view = RenderedView::default();
    RayCaster.render(mesh, camera, pose, region, &mut view);
    view
}

/// Views of the object from all sides, in front of the camera.
fn poses(count: usize) -> Vec<Isometry3<f64>> {
    let mut numbers = Numbers(81);
    (0..count)
        .map(|_| {
            let mut pose = numbers.pose(0.02);
            pose.translation.vector.z += 0.35;
            pose
        })
        .collect()
}

#[test]
fn a_view_is_empty_before_it_is_filled_and_after_a_reset() {
    let mut view = RenderedView::default();
    assert_eq!(view.region(), PixelRegion::default());
    for area in [
        region(3, 5, 7, 8),
        region(2, 2, 4, 4),
        region(0, 1, 300, 400),
    ] {
        view.reset(area);
        assert_eq!(view.region(), area);
        assert_eq!(view.depth(), vec![0.0; area.area()]);
        assert_eq!(view.triangles(), vec![NO_TRIANGLE; area.area()]);
        assert_eq!(view.n_rendered(), 0);

        // Fill every third pixel. The largest region has more than 2¹⁶ pixels.
        let (depth, triangles) = view.buffers_mut();
        for (index, (z, triangle)) in depth.iter_mut().zip(triangles).enumerate() {
            if index % 3 == 0 {
                *z = 0.5 + index as f32;
                *triangle = u32::try_from(index).unwrap();
            }
        }
        assert_eq!(view.n_rendered(), area.area().div_ceil(3));
        for (index, (u, v)) in area.pixels().enumerate() {
            let shown = index % 3 == 0;
            let z = if shown { 0.5 + index as f32 } else { 0.0 };
            assert_eq!(view.depth_at(u, v), z);
            assert_eq!(view.triangles()[index] != NO_TRIANGLE, shown);
        }
        let outside = [
            (area.u_max, area.v_min),
            (area.u_min, area.v_max),
            (area.u_min.wrapping_sub(1), area.v_min),
            (area.u_min, area.v_min.wrapping_sub(1)),
        ];
        for (u, v) in outside {
            assert_eq!(view.depth_at(u, v), 0.0);
        }
    }
}

#[test]
fn a_copy_is_equal_for_every_previous_content() {
    let (mesh, camera) = (wedge(), camera());
    let mut copy = RenderedView::default();
    for (pose, area) in poses(3).iter().zip([
        camera.region(),
        region(20, 10, 30, 30),
        region(0, 0, 40, 36),
    ]) {
        let view = fresh(&mesh, &camera, pose, &area);
        assert!(view.n_rendered() > 0);
        copy.copy_from(&view);
        assert_eq!(copy, view);
        assert_eq!(copy.region(), area);
    }
}

#[test]
fn a_surfel_lies_on_its_pixels_ray_with_the_triangles_normal_facing_the_camera() {
    let (outward, camera) = (wedge(), camera());
    let turned = |[a, b, c]: &[u32; 3]| [*a, *c, *b];
    let inward = outward.triangles().iter().map(turned).collect();
    let inward = TriMesh::new(outward.vertices().to_vec(), inward).unwrap();
    // A view of the whole mesh shows triangles that this mesh does not have.
    let one = TriMesh::new(
        outward.vertices().to_vec(),
        outward.triangles()[..1].to_vec(),
    )
    .unwrap();
    let mut judged = 0;
    for pose in poses(6) {
        for mesh in [&outward, &inward] {
            let whole = fresh(mesh, &camera, &pose, &camera.region());
            // A view of a part agrees with the view of the whole.
            let part = region(15, 9, 33, 30);
            let view = fresh(mesh, &camera, &pose, &part);
            for (u, v) in camera.region().pixels() {
                let surfel = whole.surfel_at(u, v, mesh, &camera, &pose);
                assert_eq!(whole.surfel_at(u, v, &one, &camera, &pose).is_some(), {
                    let index = camera.region().index(u, v).unwrap();
                    whole.triangles()[index] == 0
                });
                assert_eq!(surfel.is_some(), whole.depth_at(u, v) > 0.0);
                let of_part = view.surfel_at(u, v, mesh, &camera, &pose);
                assert_eq!(of_part, surfel.filter(|_| part.contains(u, v)));
                let Some(surfel) = surfel else { continue };
                judged += 1;
                // At half a meter, the resolution of f32 is 3e-8 m.
                let point = surfel.point.cast::<f64>();
                let pixel = camera.project(&point).unwrap();
                let off = (pixel.x - f64::from(u)).hypot(pixel.y - f64::from(v));
                assert!(off < 2e-5, "{off} pixels");
                assert_eq!(surfel.point.z, whole.depth_at(u, v));
                let normal = surfel.normal.cast::<f64>();
                assert!((normal.norm() - 1.0).abs() < 4e-7);
                assert!(normal.dot(&point.coords) < 0.0);
                let index = camera.region().index(u, v).unwrap();
                let corners = mesh
                    .corners(whole.triangles()[index] as usize)
                    .map(|p| pose * p.cast::<f64>());
                for corner in corners {
                    // Corners are in the plane of the point, up to the rounding of point and normal
                    // over a decimeter.
                    let off = normal.dot(&(corner - point));
                    assert!(off.abs() < 2e-7, "{off} m");
                }
            }
        }
    }
    assert!(judged > 2000, "{judged}");
}

#[test]
fn a_boxed_renderer_renders() {
    let (mesh, camera) = (cuboid(0.05, 0.06, 0.07), camera());
    let mut boxed: Box<dyn Renderer> = Box::new(RayCaster);
    for pose in poses(2) {
        let mut view = RenderedView::default();
        boxed.render(&mesh, &camera, &pose, &camera.region(), &mut view);
        assert_eq!(view, fresh(&mesh, &camera, &pose, &camera.region()));
        assert!(view.n_rendered() > 0);
    }
}

/// A ray caster that counts its renders and panics in the middle of the `broken` one.
#[derive(Default)]
struct Counted {
    renders: Arc<AtomicU64>,
    broken: Option<u64>,
}

impl Renderer for Counted {
    fn render(
        &mut self,
        mesh: &TriMesh,
        camera: &PinholeCamera,
        camera_from_object: &Isometry3<f64>,
        region: &PixelRegion,
        view: &mut RenderedView,
    ) {
        let number = 1 + self.renders.fetch_add(1, Ordering::Relaxed);
        if self.broken == Some(number) {
            view.reset(*region);
            view.buffers_mut().0.fill(9.0);
            panic!("half-way");
        }
        RayCaster.render(mesh, camera, camera_from_object, region, view);
    }
}

/// Returns a cache, and the number of renders requested from its renderer.
fn counted(broken: Option<u64>) -> (RenderCache, Arc<AtomicU64>) {
    let renderer = Counted {
        broken,
        ..Counted::default()
    };
    let renders = Arc::clone(&renderer.renders);
    (RenderCache::new(renderer), renders)
}

#[test]
fn the_four_most_recently_used_renders_are_cached() {
    let (model, camera, poses) = (Model::new(wedge()), camera(), poses(7));
    let (mut cache, renders) = counted(None);
    let expected: Vec<RenderedView> = poses
        .iter()
        .map(|pose| fresh(model.mesh(), &camera, pose, &camera.region()))
        .collect();
    let mut numbers = Numbers(82);
    let mut remembered: Vec<usize> = Vec::new();
    let (mut made, mut hits) = (0, 0);
    for _ in 0..300 {
        let asked = numbers.below(poses.len());
        if let Some(place) = remembered.iter().position(|index| *index == asked) {
            remembered.remove(place);
            hits += 1;
        } else {
            made += 1;
        }
        remembered.push(asked);
        if remembered.len() > 4 {
            remembered.remove(0);
        }
        assert_eq!(*cache.view(&model, &camera, &poses[asked]), expected[asked]);
        assert_eq!(cache.renders(), made);
        assert_eq!(renders.load(Ordering::Relaxed), made);
    }
    assert!(made > 100 && hits > 100, "{made} renders and {hits} hits");
}

#[test]
fn the_cache_key_is_model_camera_and_every_bit_of_the_pose() {
    let (model, camera) = (Model::new(wedge()), camera());
    let truth = pose(0.01, -0.02, 0.4, 0.3, -0.2, 0.1);
    let (mut cache, _) = counted(None);
    let mut renders = |model: &Model, camera: &PinholeCamera, pose: &Isometry3<f64>| {
        let before = cache.renders();
        cache.view(model, camera, pose);
        cache.renders() - before
    };
    assert_eq!(renders(&model, &camera, &truth), 1);
    assert_eq!(renders(&model, &camera, &truth), 0);
    // A clone is the same object. Another model of the same mesh is not.
    assert_eq!(renders(&model.clone(), &camera, &truth), 0);
    assert_eq!(renders(&Model::new(wedge()), &camera, &truth), 1);
    let other = PinholeCamera::new(90.0, 92.0, 23.0, 17.5, 47, 36).unwrap();
    assert_eq!(renders(&model, &other, &truth), 1);
    for number in 0..7 {
        let mut moved = truth;
        if number < 3 {
            moved.translation.vector[number] = moved.translation.vector[number].next_up();
        } else {
            let mut q = moved.rotation.into_inner();
            q.coords[number - 3] = q.coords[number - 3].next_up();
            moved.rotation = hicp_core::UnitQuaternion::new_unchecked(q);
        }
        assert_ne!(bits(&moved), bits(&truth));
        assert_eq!(renders(&model, &camera, &truth), 0, "{number}");
        assert_eq!(renders(&model, &camera, &moved), 1, "{number}");
    }
}

#[test]
fn a_render_that_panicked_is_not_cached() {
    let (model, camera, poses) = (Model::new(wedge()), camera(), poses(5));
    // The fifth render replaces the first and panics.
    let (mut cache, _) = counted(Some(5));
    for pose in &poses[..4] {
        cache.view(&model, &camera, pose);
    }
    let broken = catch_unwind(AssertUnwindSafe(|| {
        cache.view(&model, &camera, &poses[4]).n_rendered()
    }));
    assert!(broken.is_err());
    for pose in [&poses[0], &poses[4]] {
        let expected = fresh(model.mesh(), &camera, pose, &camera.region());
        assert_eq!(*cache.view(&model, &camera, pose), expected);
    }
}

#[test]
fn a_context_shows_the_model_in_the_observations_camera() {
    let (model, camera) = (Model::new(wedge()), camera());
    let truth = pose(0.0, 0.01, 0.4, 0.2, 0.1, -0.3);
    let observation = observe(&model, &camera, &truth);
    let problem = Problem::new(&model, &observation);
    assert!(std::ptr::eq(problem.model().unwrap(), &raw const model));
    assert!(std::ptr::eq(
        problem.observation().unwrap(),
        &raw const observation
    ));
    let (mut cache, renders) = counted(None);
    let nearby = truth * Isometry3::translation(0.01, 0.0, 0.0);
    let away = Isometry3::from_parts(Vector3::new(0.0, 0.0, -1.0).into(), truth.rotation);
    for pose in [truth, nearby, away, truth] {
        let mut context = Context::new(problem, &mut cache);
        let expected = fresh(model.mesh(), &camera, &pose, &camera.region());
        assert_eq!(*context.view(&pose).unwrap(), expected);
        assert_eq!(expected.region().is_empty(), pose == away);
        assert!(std::ptr::eq(
            context.problem.model().unwrap(),
            &raw const model
        ));
    }
    assert_eq!(renders.load(Ordering::Relaxed), 3);
}

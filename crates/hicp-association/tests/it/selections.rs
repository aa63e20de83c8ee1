//! Tests of point selections: the pixels and normals of the visible surface, and all samples.

use crate::support::{Numbers, RayCaster, camera, cuboid, observe, pose, render_depth, wedge};
use hicp_association::{AllSamples, PointSelection, Stride, VisibleSurface};
use hicp_core::{
    Context, Isometry3, Model, ModelConfig, Observation, Problem, RenderCache, Surfel, TriMesh,
};

fn select(
    selection: &mut dyn PointSelection,
    model: &Model,
    observation: &Observation,
    pose: &Isometry3<f64>,
) -> Vec<Surfel> {
    let mut renders = RenderCache::new(RayCaster);
    let mut context = Context::new(Problem::new(model, observation), &mut renders);
    let mut source = Vec::new();
    selection.select(&mut context, pose, &mut source);
    source
}

#[test]
fn the_visible_surface_has_the_pixels_of_the_grid_and_faces_the_camera() {
    let mut numbers = Numbers(231);
    // Inward winding must not flip the normals.
    let wedge_inside_out = {
        let mesh = wedge();
        let triangles = mesh
            .triangles()
            .iter()
            .map(|[a, b, c]| [*a, *c, *b])
            .collect();
        TriMesh::new(mesh.vertices().to_vec(), triangles).unwrap()
    };
    for mesh in [wedge(), wedge_inside_out] {
        let model = Model::new(mesh);
        for stride in [1, 2, 3, 5, 8] {
            let mut at = numbers.pose(0.01);
            at.translation.vector.z += 0.22;
            let observation = observe(&model, &camera(), &at);
            let source = select(
                &mut VisibleSurface::with_stride(Stride::Pixels(stride)),
                &model,
                &observation,
                &at,
            );
            let depth = render_depth(&model, &camera(), &at);
            let mut expected = Vec::new();
            for v in (0..48).step_by(stride as usize) {
                for u in (0..64).step_by(stride as usize) {
                    if depth.get(u, v) > Some(0.0) {
                        expected.push((u, v));
                    }
                }
            }
            assert_eq!(source.len(), expected.len());
            assert!(expected.len() > 5);
            for (surfel, (u, v)) in source.iter().zip(expected) {
                let point = at * surfel.point.cast::<f64>();
                let pixel = camera().project(&point).unwrap();
                // The resolution of f32 at the object's 6 cm is 4e-9 m: at 0.2 m with f = 84, a
                // millionth of a pixel.
                assert!(
                    (pixel.x - f64::from(u)).abs() < 1e-5 && (pixel.y - f64::from(v)).abs() < 1e-5
                );
                assert!((point.z - f64::from(depth.get(u, v).unwrap())).abs() < 1e-8);
                let normal = at.rotation * surfel.normal.cast::<f64>().into_inner();
                assert!(
                    normal.dot(&point.coords) <= 0.0,
                    "the normal faces the camera"
                );
                assert!((normal.norm() - 1.0).abs() < 1e-6);
                let on_a_face = (0..model.mesh().triangles().len()).any(|t| {
                    let n = model.mesh().normal(t).unwrap();
                    let [corner, ..] = model.mesh().corners(t);
                    (n.dot(&surfel.normal).abs() - 1.0).abs() < 1e-6
                        && n.dot(&(surfel.point - corner)).abs() < 1e-7
                });
                assert!(on_a_face);
            }
        }
    }
}

#[test]
fn strides_select_about_the_requested_number_of_points() {
    let model = Model::new(cuboid(0.1, 0.1, 0.1));
    let at = pose(0.0, 0.0, 0.3, 0.3, 0.4, 0.0);
    let observation = observe(&model, &camera(), &at);
    let all = select(
        &mut VisibleSurface::with_stride(Stride::Pixels(1)),
        &model,
        &observation,
        &at,
    )
    .len();
    for points in [50, 200, 10_000] {
        let stride = Stride::AboutPoints(points);
        let found = select(
            &mut VisibleSurface::with_stride(stride),
            &model,
            &observation,
            &at,
        )
        .len();
        let pixels = stride.pixels(all);
        let thinned = select(
            &mut VisibleSurface::with_stride(Stride::Pixels(pixels)),
            &model,
            &observation,
            &at,
        );
        assert_eq!(found, thinned.len());
        // Within a factor of two. A grid covers its share of a compact region, up to the region's
        // border.
        assert!(found <= 2 * points + points / 3, "{found} of {points}");
        assert!(found == all || found >= points / 3, "{found} of {points}");
    }
}

#[test]
fn invisible_objects_give_no_points() {
    let model = Model::new(cuboid(0.1, 0.1, 0.1));
    let observation = observe(&model, &camera(), &pose(0.0, 0.0, 0.3, 0.0, 0.0, 0.0));
    for at in [
        pose(0.0, 0.0, -0.3, 0.0, 0.0, 0.0),
        pose(5.0, 0.0, 0.3, 0.0, 0.0, 0.0),
        pose(0.0, 0.0, 1e30, 0.0, 0.0, 0.0),
        Isometry3::translation(0.0, 0.0, f64::NAN),
    ] {
        assert!(select(&mut VisibleSurface::default(), &model, &observation, &at).is_empty());
    }
}

#[test]
fn all_samples_selects_every_sample() {
    let config = ModelConfig {
        samples: 77,
        ..ModelConfig::default()
    };
    let model = Model::with_config(wedge(), config);
    let at = pose(0.0, 0.0, 0.3, 0.0, 0.0, 0.0);
    let observation = observe(&model, &camera(), &at);
    assert_eq!(
        select(&mut AllSamples, &model, &observation, &at),
        model.samples()
    );
    assert_eq!(model.samples().len(), 77);
}

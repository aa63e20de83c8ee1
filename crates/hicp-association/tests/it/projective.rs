//! Tests of projective association against its definition (pitfall 22).

use crate::nearest_neighbor::associate;
use crate::support::{
    Numbers, RayCaster, camera, depth_image, observe, observe_depth, pose, wedge,
};
use hicp_association::{DataAssociation, PointSelection, Projective, Stride, VisibleSurface};
use hicp_core::{
    Context, Correspondences, Isometry3, Model, Point3, Problem, RenderCache, Surfel, UnitVector3,
    Vector3,
};

fn surfel(point: Point3<f32>) -> Surfel {
    Surfel {
        point,
        normal: UnitVector3::new_normalize(-Vector3::z()),
    }
}

#[test]
fn pitfall_22_every_point_is_paired_with_the_pixel_it_projects_to() {
    let mut numbers = Numbers(211);
    // A wall with a hole in the middle.
    let observation = observe_depth(
        depth_image(
            &camera(),
            |ray| if ray.xy().norm() < 0.1 { 0.0 } else { 0.5 },
        ),
        &camera(),
    );
    let (mut paired, mut alone) = (0, 0);
    for _ in 0..40 {
        let mut pose = numbers.pose(0.2);
        pose.translation.vector.z += 0.4;
        let source: Vec<Surfel> = (0..200)
            .map(|_| surfel(Point3::from((numbers.vector() * 0.3).cast::<f32>())))
            .collect();
        let pairs = associate(&mut Projective, &observation, &source, &pose);
        let mut found = pairs.as_slice().iter().peekable();
        for (index, surfel) in (0_u32..).zip(&source) {
            let here = found.next_if(|p| p.source_index == index);
            let moved = pose * surfel.point.cast::<f64>();
            let pixel = camera().project(&moved);
            // Within a thousandth of a pixel's border, or of the camera plane, f32 may decide
            // either way.
            let border = |x: f64| ((x + 0.5).round() - (x + 0.5)).abs() < 1e-3;
            if moved.z.abs() < 1e-4 || pixel.is_some_and(|p| border(p.x) || border(p.y)) {
                continue;
            }
            let expected = pixel.and_then(|p| {
                let (u, v) = ((p.x + 0.5).floor(), (p.y + 0.5).floor());
                let inside = (0.0..64.0).contains(&u) && (0.0..48.0).contains(&v);
                inside
                    .then(|| observation.surfel_at(u as u32, v as u32))
                    .flatten()
            });
            assert_eq!(here.map(|p| p.target), expected.copied(), "{moved}");
            if let Some(pair) = here {
                assert_eq!(pair.weight, 1.0);
                assert!((pair.source.point.cast::<f64>() - moved).norm() < 1e-6);
                let normal = pose.rotation * surfel.normal.cast::<f64>().into_inner();
                assert!((pair.source.normal.cast::<f64>().into_inner() - normal).norm() < 1e-6);
                paired += 1;
            } else {
                alone += 1;
            }
        }
        assert_eq!(
            found.next(),
            None,
            "pairs are in the order of the points, one each"
        );
    }
    assert!(paired > 300 && alone > 300, "{paired} {alone}");
}

#[test]
fn pitfall_22_points_behind_the_camera_or_not_finite_have_no_pair() {
    let observation = observe_depth(depth_image(&camera(), |_| 0.5), &camera());
    let front = Point3::new(0.01, 0.02, 0.5);
    assert_eq!(
        associate(
            &mut Projective,
            &observation,
            &[surfel(front)],
            &Isometry3::identity()
        )
        .len(),
        1
    );
    for z in [
        -0.5,
        -1e-6,
        0.0,
        -0.0,
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
    ] {
        let bad = surfel(Point3::new(0.01, 0.02, z));
        assert!(
            associate(
                &mut Projective,
                &observation,
                &[bad],
                &Isometry3::identity()
            )
            .is_empty(),
            "z = {z}"
        );
    }
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX] {
        for point in [Point3::new(bad, 0.0, 0.5), Point3::new(0.0, bad, 0.5)] {
            assert!(
                associate(
                    &mut Projective,
                    &observation,
                    &[surfel(point)],
                    &Isometry3::identity()
                )
                .is_empty()
            );
        }
    }
    // A pose that is finite in f64 but not in f32 moves every point to infinity.
    for far in [1e39, 1e300, f64::MAX] {
        let pose = Isometry3::translation(0.0, 0.0, far);
        assert!(
            associate(&mut Projective, &observation, &[surfel(front)], &pose).is_empty(),
            "{far}"
        );
    }
    assert!(
        associate(
            &mut Projective,
            &observation,
            &[surfel(front)],
            &pose(0.0, 0.0, 0.0, 0.0, 4.0, 0.0)
        )
        .is_empty()
    );
}

/// The surface rendered at a pose projects onto its own pixels in an image rendered at that pose.
#[test]
fn a_render_is_paired_with_itself() {
    let model = Model::new(wedge());
    let mut numbers = Numbers(212);
    for _ in 0..6 {
        let mut pose = numbers.pose(0.01);
        pose.translation.vector.z += 0.22;
        let observation = observe(&model, &camera(), &pose);
        let mut renders = RenderCache::new(RayCaster);
        let mut context = Context::new(Problem::new(&model, &observation), &mut renders);
        let mut source = Vec::new();
        VisibleSurface::with_stride(Stride::Pixels(1)).select(&mut context, &pose, &mut source);
        assert!(source.len() > 300, "{}", source.len());
        let mut pairs = Correspondences::new();
        Projective.associate(&mut context, &source, &pose, &mut pairs);
        // Only pixels whose neighborhood has no normal have no pair.
        assert_eq!(pairs.len(), observation.n_surfels());
        for pair in pairs.as_slice() {
            // To the object frame and back: three roundings of f32 at 0.3 m.
            assert!(pair.distance() < 1e-7, "{}", pair.distance());
        }
    }
}

//! Tests of the sampled MVE against its definition, pixel by pixel.

use std::collections::BTreeMap;

use crate::rendered::{at, score};
use crate::support::{Numbers, camera, cuboid, median, observe, pose, wedge};
use hicp_core::{DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, Sides, TriMesh};
use hicp_score::{Occlusion, SampledMve, Score, VISIBILITY_TOLERANCE_METERS, tolerances};

/// Projects points into the pixels of a coarse image, keeps the nearest of each, and computes the
/// VSD.
fn by_definition(
    (samples, pixels): (usize, usize),
    model: &Model,
    observation: &Observation,
    pose: &Isometry3<f64>,
) -> f64 {
    let per_pixel = observation.n_measured() as f64 / pixels.max(1) as f64;
    let coarse = observation.decimated((per_pixel.sqrt().round() as u32).max(1));
    let camera = coarse.camera();
    let [fx, fy, cx, cy] = [camera.fx(), camera.fy(), camera.cx(), camera.cy()];
    let rotation = pose.cast::<f32>().rotation.to_rotation_matrix();
    let mut seen: BTreeMap<(u32, u32), f32> = BTreeMap::new();
    for surfel in &Sides::of(model, samples).facing(pose).surfels {
        let p = rotation * surfel.point.coords + pose.translation.vector.cast::<f32>();
        if p.z <= f32::EPSILON {
            continue;
        }
        let u = fx as f32 * p.x / p.z + cx as f32 + 0.5;
        let v = fy as f32 * p.y / p.z + cy as f32 + 0.5;
        if u >= 0.0 && v >= 0.0 && u < camera.width() as f32 && v < camera.height() as f32 {
            let nearest = seen.entry((u as u32, v as u32)).or_insert(p.z);
            *nearest = nearest.min(p.z);
        }
    }
    let factor = (observation.camera().fx() / camera.fx()).round() as u32;
    let mut differences = Vec::new();
    let mut outside = 0;
    for ((u, v), z) in seen {
        let place = (u * factor, v * factor);
        let measured = match coarse.mask().get(u, v) {
            Some(true) if factor > 1 => median_around(observation, place, factor),
            _ => coarse.depth().get(u, v).unwrap(),
        };
        let measured = f64::from(measured);
        let ray = ((f64::from(u) - cx) / fx)
            .hypot((f64::from(v) - cy) / fy)
            .hypot(1.0);
        let behind = (f64::from(z) - measured) * ray;
        match (coarse.mask().get(u, v).unwrap(), measured > 0.0) {
            (true, true) => differences.push(behind.abs()),
            (true, false) => {}
            (false, true) if behind > VISIBILITY_TOLERANCE_METERS => {}
            (false, _) => outside += 1,
        }
    }
    let union = coarse.n_measured() + outside;
    let errors = tolerances().map(|tolerance| {
        let within = |d: &&f64| **d < tolerance * model.diameter();
        match union {
            0 => 1.0,
            _ => (union - differences.iter().filter(within).count()) as f64 / union as f64,
        }
    });
    errors.iter().sum::<f64>() / errors.len() as f64
}

/// Returns the upper median of 25 masked depths, half a coarse pixel apart; 0 at a hole.
fn median_around(observation: &Observation, (u, v): (u32, u32), factor: u32) -> f32 {
    if observation.depth().get(u, v) == Some(0.0) {
        return 0.0;
    }
    let mut depths = Vec::new();
    for (x, y) in (0..5).flat_map(|y| (0..5).map(move |x| (x, y))) {
        let moved = |from: u32, step: u32| (from + factor * step / 2).checked_sub(factor);
        if let (Some(u), Some(v)) = (moved(u, x), moved(v, y))
            && observation.mask().get(u, v) == Some(true)
        {
            depths.extend(observation.depth().get(u, v).filter(|z| *z > 0.0));
        }
    }
    depths.sort_by(f32::total_cmp);
    depths[depths.len() / 2]
}

/// Returns the wedge without its last triangle.
fn open() -> TriMesh {
    let mesh = wedge();
    let (_, triangles) = mesh.triangles().split_last().unwrap();
    TriMesh::new(mesh.vertices().to_vec(), triangles.to_vec()).unwrap()
}

/// Returns an observation with changed depths and another mask.
fn changed(
    observation: &Observation,
    depth: impl Fn(usize, f32) -> f32,
    mask: impl Fn(usize, bool) -> bool,
) -> Observation {
    let camera = *observation.camera();
    let (width, height) = (camera.width(), camera.height());
    let depths = observation.depth().pixels().iter().enumerate();
    let depths = depths.map(|(i, z)| depth(i, *z)).collect();
    let set = observation.mask().pixels().iter().enumerate();
    let set = set.map(|(i, on)| mask(i, *on)).collect();
    Observation::new(
        DepthImage::from_meters(width, height, depths).unwrap(),
        Mask::new(width, height, set).unwrap(),
        camera,
    )
    .unwrap()
}

#[test]
fn the_sampled_mve_equals_its_definition() {
    let mut numbers = Numbers(5);
    let mut distinct = std::collections::BTreeSet::new();
    // One instance for all: the state after one score must not change the next.
    let mut kept = SampledMve::default();
    for mesh in [wedge(), open(), cuboid(0.03, 0.02, 0.04)] {
        let model = Model::new(mesh);
        let plain = observe(&model, &camera(), &at());
        let scenes = [
            changed(&plain, |_, z| z, |_, on| on),
            // Holes, a wall behind, an occluder in front, half of the mask.
            changed(&plain, |i, z| if i % 3 == 0 { 0.0 } else { z }, |_, on| on),
            changed(&plain, |_, z| if z > 0.0 { z } else { 0.5 }, |_, on| on),
            changed(
                &plain,
                |i, z| if i % 64 < 31 { 0.1 } else { z },
                |i, on| on && i % 64 >= 31,
            ),
            changed(&plain, |_, z| z * 1.03, |i, on| on && i / 64 < 24),
            changed(&plain, |_, z| z, |_, _| false),
        ];
        for observation in &scenes {
            for (samples, pixels) in [
                (0, 10),
                (1, 200),
                (400, 0),
                (400, 30),
                (1500, 200),
                (3000, 100_000),
            ] {
                let near = pose(0.0, 0.0, 0.03, 0.1, 0.0, 0.0);
                let aside = pose(-0.1, 0.0, 0.25, 0.4, -0.3, 0.2);
                let below = pose(0.0, 0.08, 0.25, 0.4, -0.3, 0.2);
                let behind = pose(0.0, 0.0, -0.25, 0.4, -0.3, 0.2);
                let mut poses = vec![at(), near, aside, below, behind];
                for size in [0.002, 0.01, 0.04] {
                    let [x, y, z, a, b, c] =
                        std::array::from_fn(|_| size * numbers.between(-0.5, 0.5));
                    poses.push(at() * pose(x, y, z, 10.0 * a, 10.0 * b, 10.0 * c));
                }
                for pose in &poses {
                    let expected = by_definition((samples, pixels), &model, observation, pose);
                    let mut fresh = SampledMve::new(samples, pixels);
                    let found = score(&mut fresh, &model, observation, pose);
                    assert!((found - expected).abs() < 1e-12, "{found} {expected}");
                    (kept.samples, kept.pixels) = (samples, pixels);
                    assert_eq!(score(&mut kept, &model, observation, pose), found);
                    distinct.insert(found.to_bits());
                }
            }
        }
    }
    assert!(distinct.len() > 200, "{}", distinct.len());
    assert_eq!(kept.name(), "sampled-mve");
    assert_eq!(
        (SampledMve::default().samples, SampledMve::default().pixels),
        (600, 150)
    );
}

/// An open triangle in a plane through the origin, seen by every possible pixel.
fn sheet(corners: [[f32; 3]; 3]) -> Model {
    let corners = corners.map(hicp_core::Point3::from);
    Model::new(TriMesh::new(corners.to_vec(), vec![[0, 1, 2]]).unwrap())
}

/// An image with a depth of half a meter everywhere, masked except for one pixel.
fn wall(camera: PinholeCamera, but: Option<usize>, depth_there: f32) -> Observation {
    let n = (camera.width() * camera.height()) as usize;
    let mut depth = vec![0.5; n];
    let mut mask = vec![true; n];
    if let Some(index) = but {
        (depth[index], mask[index]) = (depth_there, false);
    }
    Observation::new(
        DepthImage::from_meters(camera.width(), camera.height(), depth).unwrap(),
        Mask::new(camera.width(), camera.height(), mask).unwrap(),
        camera,
    )
    .unwrap()
}

/// Samples outside must not enter at another edge.
#[test]
fn samples_outside_the_image_do_not_count() {
    let model = Model::new(wedge());
    let observation = wall(camera(), None, 0.0);
    let mut sampled = SampledMve::new(1500, 100_000);
    let mut at = |x: f64, y: f64| {
        let pose = pose(x, y, 0.5, 0.4, -0.3, 0.2);
        score(&mut sampled, &model, &observation, &pose)
    };
    assert!(at(0.0, 0.0) < 1.0);
    // The image is 0.4 m wide there and 0.29 m high.
    for x in [-0.4, 0.0, 0.4] {
        for y in [-0.3, 0.0, 0.3] {
            assert_eq!(at(x, y) < 1.0, (x, y) == (0.0, 0.0), "{x} {y}");
        }
    }
}

/// Pixel centers are at integers, so the image ends half a pixel after the last. That line is
/// outside.
#[test]
fn the_right_and_the_lower_edge_are_not_in_the_image() {
    let pose = Isometry3::translation(0.0, 0.0, 0.5);
    let mut sampled = SampledMve::new(1500, 100_000);
    let mut found = |model: &Model, cx: f64, cy: f64| {
        let camera = PinholeCamera::new(20.0, 20.0, cx, cy, 8, 8).unwrap();
        score(&mut sampled, model, &wall(camera, None, 0.0), &pose)
    };
    // Both contain the optical axis and are seen from the side: all x, or all y, are zero.
    let upright = sheet([[0.0, -0.1, -0.1], [0.0, 0.1, -0.1], [0.0, 0.0, 0.2]]);
    let level = sheet([[-0.1, 0.0, -0.1], [0.1, 0.0, -0.1], [0.0, 0.0, 0.2]]);
    assert_eq!(found(&upright, 7.5, 3.0), 1.0);
    assert!(found(&upright, 7.49, 3.0) < 1.0);
    assert_eq!(found(&level, 3.0, 7.5), 1.0);
    assert!(found(&level, 3.0, 7.49) < 1.0);
}

#[test]
fn an_occluder_at_exactly_the_tolerance_does_not_hide() {
    let model = sheet([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 2.0, 0.0]]);
    let pose = Isometry3::translation(0.0, 0.0, 0.5);
    // The pixel outside the mask is the principal point, where depths equal distances to the bit.
    let camera = PinholeCamera::new(8.0, 8.0, 4.0, 3.0, 8, 8).unwrap();
    let observation = wall(camera, Some(3 * 8 + 4), 0.25);
    let found = |tolerance: f64| {
        let mut sampled = SampledMve::new(20_000, 100_000);
        sampled.occlusion = Occlusion::Tolerated { meters: tolerance };
        score(&mut sampled, &model, &observation, &pose)
    };
    // All others agree.
    assert_eq!(found(f64::from(0.25_f32.next_down())), 0.0);
    assert!((found(0.25) - 1.0 / 64.0).abs() < 1e-15);
}

/// The points of a side leave few pixels empty, and none of them shows through the side in front.
/// That matters most for an open box: half of its surface is inside.
#[test]
fn a_true_pose_scores_nearly_as_well_as_with_many_points() {
    let closed = cuboid(0.05, 0.04, 0.06);
    let (_, but_one_side) = closed.triangles().split_at(2);
    let open = TriMesh::new(closed.vertices().to_vec(), but_one_side.to_vec()).unwrap();
    let camera = PinholeCamera::new(250.0, 250.0, 60.0, 45.0, 120, 90).unwrap();
    let mut numbers = Numbers(9);
    for mesh in [closed, open, wedge()] {
        let model = Model::new(mesh);
        let mut more = Vec::new();
        for _ in 0..60 {
            let shift = pose(0.0, 0.0, 0.5, 0.0, 0.0, 0.0);
            let pose = shift * Isometry3::from_parts(Default::default(), numbers.rotation());
            let observation = observe(&model, &camera, &pose);
            let mut few = SampledMve::default();
            let mut many = SampledMve::new(10 * few.samples, few.pixels);
            let many = score(&mut many, &model, &observation, &pose);
            more.push(score(&mut few, &model, &observation, &pose) - many);
        }
        assert!(median(&mut more) < 0.02, "{}", median(&mut more));
    }
}

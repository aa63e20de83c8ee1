//! Volumes reproduce the surfaces that were integrated into them.

use std::collections::{HashMap, HashSet};

use hicp_core::{Facing, Model, PinholeCamera, Point3, TriMesh};
use hicp_raster::render_depth_image;
use hicp_sim::{
    Household, Reconstruction, ReconstructionNoise, SimError, Solid, TsdfConfig, TsdfVolume,
    WrongPose, components, object_pose, rng,
};

fn camera() -> PinholeCamera {
    PinholeCamera::new(572.4, 573.6, 325.3, 242.0, 640, 480).unwrap()
}

/// Returns V − E + F, which is 2 for a sphere.
fn euler_characteristic(mesh: &TriMesh) -> i64 {
    let edges: HashSet<_> = mesh
        .triangles()
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
        .map(|(a, b)| (a.min(b), a.max(b)))
        .collect();
    let used = mesh.used_vertices().iter().filter(|used| **used).count();
    let count = |n: usize| i64::try_from(n).unwrap();
    count(used) - count(edges.len()) + count(mesh.triangles().len())
}

/// Checks that a mesh is a closed manifold.
///
/// Every edge must be in exactly two triangles, once in each direction. The triangles around every
/// vertex must form one disc.
fn assert_manifold(mesh: &TriMesh) {
    let mut next: HashMap<u32, HashMap<u32, u32>> = HashMap::new();
    for &[a, b, c] in mesh.triangles() {
        for (vertex, from, to) in [(a, b, c), (b, c, a), (c, a, b)] {
            assert_eq!(next.entry(vertex).or_default().insert(from, to), None);
        }
    }
    for around in next.values() {
        let start = *around.keys().next().unwrap();
        let (mut at, mut steps) = (around[&start], 1);
        while at != start {
            at = around[&at];
            steps += 1;
        }
        assert_eq!(steps, around.len());
    }
}

/// Returns a sphere of 80 mm radius around a point off the grid.
fn sphere(center: &Point3<f64>) -> TriMesh {
    let profile: Vec<_> = (0..=120)
        .map(|i| {
            let t = std::f64::consts::PI * f64::from(i) / 120.0;
            let r = if i == 0 || i == 120 {
                0.0
            } else {
                0.08 * t.sin()
            };
            (r, -0.08 * t.cos())
        })
        .collect();
    let at = hicp_core::Isometry3::translation(center.x, center.y, center.z);
    Solid::lathe(&profile, 160).moved(&at).to_mesh().unwrap()
}

#[test]
fn an_integrated_sphere_is_a_closed_manifold_with_its_radius() {
    let center = Point3::new(0.0013, -0.0007, 0.0021);
    let mesh = sphere(&center);
    let voxel_meters = 0.004;
    let mut volume = TsdfVolume::new(TsdfConfig {
        min: Point3::new(-0.1, -0.1, -0.1),
        max: Point3::new(0.1, 0.1, 0.1),
        voxel_meters,
        truncation_meters: 0.012,
    })
    .unwrap();
    let mut rng = rng(31);
    for _ in 0..60 {
        let pose = object_pose(&mut rng, &center, 0.3..0.6, 0.02);
        let depth = render_depth_image(&mesh, &camera(), &pose);
        volume.integrate(&depth, &camera(), &pose).unwrap();
    }
    let surface = volume.surface().unwrap();
    assert_eq!(surface.facing(), Facing::Outward);
    assert_eq!(euler_characteristic(&surface), 2);
    assert_eq!(components(&surface).unwrap().len(), 1);
    assert_manifold(&surface);
    let errors: Vec<f64> = surface
        .vertices()
        .iter()
        .map(|p| (p.cast::<f64>() - center).norm() - 0.08)
        .collect();
    let worst = errors.iter().fold(0.0_f64, |worst, e| worst.max(e.abs()));
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    println!(
        "{} vertices, radius error {:.3} mm on average, {:.3} mm at most",
        errors.len(),
        mean * 1e3,
        worst * 1e3
    );
    assert!(worst < voxel_meters, "{worst}");
    assert!(mean.abs() < 0.25 * voxel_meters, "{mean}");
}

#[test]
fn unseen_voxels_are_solid() {
    let center = Point3::origin();
    let mesh = sphere(&center);
    let config = TsdfConfig {
        min: Point3::new(-0.1, -0.1, -0.1),
        max: Point3::new(0.1, 0.1, 0.1),
        voxel_meters: 0.005,
        truncation_meters: 0.015,
    };
    let mut volume = TsdfVolume::new(config).unwrap();
    assert_eq!(
        volume.surface().unwrap_err(),
        SimError::NoSurface { images: 0 }
    );
    let pose = hicp_core::Isometry3::translation(0.0, 0.0, 0.5);
    let depth = render_depth_image(&mesh, &camera(), &pose);
    volume.integrate(&depth, &camera(), &pose).unwrap();
    let solid = volume.surface().unwrap();
    // The surface is closed, but an unreached voxel between two rays may be a separate part.
    assert_manifold(&solid);
    let parts = components(&solid).unwrap();
    assert!(parts[0].volume > 0.0 && parts[0].area > 0.99 * solid.area());
}

#[test]
fn invalid_volumes_are_refused() {
    let config = TsdfConfig {
        min: Point3::origin(),
        max: Point3::new(10.0, 10.0, 10.0),
        voxel_meters: 0.001,
        truncation_meters: 0.01,
    };
    let message = TsdfVolume::new(config).unwrap_err().to_string();
    assert!(
        message.starts_with("the volume has 10001x10001x10001 voxels"),
        "{message}"
    );
    let message = TsdfVolume::new(TsdfConfig {
        voxel_meters: 0.0,
        ..config
    })
    .unwrap_err()
    .to_string();
    assert_eq!(
        message,
        "voxel size in meters is 0, expected a number from 0.000001 to 1000"
    );
    let message = TsdfVolume::new(TsdfConfig {
        max: Point3::new(1.0, -1.0, 1.0),
        ..config
    })
    .unwrap_err()
    .to_string();
    assert!(
        message.starts_with("volume along y in meters is -1"),
        "{message}"
    );
    let message = ReconstructionNoise::level(5).unwrap_err().to_string();
    assert_eq!(
        message,
        "reconstruction level is 5, expected a number from 1 to 4"
    );
}

/// Returns the mean distance from samples of one model to the nearest of dense samples of another,
/// meters.
fn surface_error(from: &Model, to: &Model) -> f64 {
    let dense = hicp_core::sample_surface(to.mesh(), 20_000);
    let nearest = |p: &Point3<f32>| {
        dense
            .iter()
            .map(|s| (s.point - p).norm_squared())
            .fold(f32::INFINITY, f32::min)
    };
    let samples = from.samples();
    samples
        .iter()
        .map(|s| f64::from(nearest(&s.point).sqrt()))
        .sum::<f64>()
        / samples.len() as f64
}

#[test]
fn reconstructions_are_closed_and_less_accurate_at_every_level() {
    for object in [Household::Mug, Household::Car] {
        let model = object.model().unwrap();
        let mut errors = Vec::new();
        for level in 1..=4 {
            let settings = Reconstruction {
                images: 60,
                voxel_meters: 0.003,
                ..Reconstruction::new(camera(), ReconstructionNoise::level(level).unwrap())
            };
            let made = settings.reconstruct(&model, object.name(), 1).unwrap();
            assert_eq!(
                made.mesh().facing(),
                Facing::Outward,
                "{} level {level}",
                object.name()
            );
            assert_manifold(made.mesh());
            assert_eq!(made.symmetries(), model.symmetries());
            assert_eq!(made.diameter().to_bits(), model.diameter().to_bits());
            errors.push(f64::midpoint(
                surface_error(&made, &model),
                surface_error(&model, &made),
            ));
        }
        println!(
            "{}: {:?} mm",
            object.name(),
            errors
                .iter()
                .map(|e| (e * 1e5).round() / 1e2)
                .collect::<Vec<_>>()
        );
        assert!(errors[0] < 0.003, "{errors:?}");
        assert!(
            errors.windows(2).all(|pair| pair[0] < pair[1]),
            "{errors:?}"
        );
    }
}

#[test]
fn noisy_images_and_wrong_cameras_make_a_worse_model_and_a_longer_truncation() {
    let model = Household::Mug.model().unwrap();
    let exact = ReconstructionNoise::default();
    let noisy = ReconstructionNoise {
        depth: "d435-ahn2019-axial".parse().unwrap(),
        ..exact
    };
    let wrong = |wrong_pose| ReconstructionNoise {
        translation_meters: 0.005,
        rotation_degrees: 1.1,
        wrong_pose,
        ..noisy
    };
    // A camera turns far from the object, and so moves its surface more.
    let noises = [
        exact,
        noisy,
        wrong(WrongPose::Object),
        wrong(WrongPose::Camera),
    ];
    let (mut errors, mut truncations) = (Vec::new(), Vec::new());
    for noise in noises {
        let settings = Reconstruction {
            images: 60,
            voxel_meters: 0.003,
            ..Reconstruction::new(camera(), noise)
        };
        truncations.push(settings.truncation_meters(&model));
        let made = settings.reconstruct(&model, "mug", 1).unwrap();
        errors.push(surface_error(&made, &model));
    }
    let rises = |values: &[f64]| values.windows(2).all(|pair| pair[0] < pair[1]);
    assert!(
        rises(&errors) && rises(&truncations),
        "{errors:?}, {truncations:?}"
    );
    assert!((truncations[0] - 0.009).abs() < 1e-12);
}

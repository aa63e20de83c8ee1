//! The instances of the comparison with other libraries: an object of about 14,400 visible pixels in a 640×480 image.

use std::collections::{HashMap, HashSet};

use hicp_sim::{
    Household, MEAN_ROTATION_ERROR_DEGREES, MEAN_TRANSLATION_ERROR_METERS, RelativeGaussian,
    object_pose, perturb, rng,
};
use hicp_tests::{Scene, camera, render};
use hybrid_icp::association::{PointSelection, Stride, VisibleSurface};
use hybrid_icp::core::{
    Isometry3, Model, ModelConfig, Observation, Point3, Problem, Surfel, Translation3, TriMesh,
};
use hybrid_icp::icp::Workspace;
use hybrid_icp::raster::Rasterizer;

/// The objects: those without a symmetry, so that a rotation error means something.
pub const OBJECTS: [Household; 5] = [
    Household::Mug,
    Household::Hammer,
    Household::Bracket,
    Household::Iron,
    Household::Car,
];

/// Visible pixels aimed at.
pub const VISIBLE_PIXELS: f64 = 14_400.0;

/// Points that the point-based libraries are given.
pub const POINTS: usize = 2000;

/// An instance.
#[derive(Debug)]
pub struct Instance {
    /// Name of the object.
    pub object: &'static str,
    /// Model, image and true pose.
    pub scene: Scene,
    /// The initial pose, 6.2 mm and 9.5° off.
    pub init: Isometry3<f64>,
    /// About [`POINTS`] points that are visible at the initial pose, object frame.
    pub source: Vec<Surfel>,
}

/// Makes an instance from its number.
///
/// # Panics
///
/// Never for the objects that ship.
#[must_use]
pub fn instance(number: usize, noise_percent: f64) -> Instance {
    let object = OBJECTS[number % OBJECTS.len()];
    let mut rng = rng(1000 + number as u64);
    let model = object.model().expect("the objects that ship are valid");
    let camera = camera();
    let mut truth = object_pose(&mut rng, &model.center(), 0.5..0.5001, 0.01);
    // Pixels go with the inverse square of the distance, nearly.
    for _ in 0..4 {
        let (_, mask) = render(&model, &camera, &truth);
        let pixels = mask.pixels().iter().filter(|m| **m).count() as f64;
        let center = (truth * model.center()).coords;
        let factor = (pixels / VISIBLE_PIXELS).sqrt();
        truth = Translation3::from(center * (factor - 1.0)) * truth;
    }
    let (depth, mask) = render(&model, &camera, &truth);
    let noise = RelativeGaussian {
        percent: noise_percent,
    };
    let depth = noise.apply(&mut rng, &depth);
    let init = perturb(
        &mut rng,
        &truth,
        MEAN_TRANSLATION_ERROR_METERS,
        MEAN_ROTATION_ERROR_DEGREES.to_radians(),
    );
    let observation = Observation::new(depth, mask, camera).expect("sizes agree");
    let mut source = Vec::new();
    let mut workspace = Workspace::new(Rasterizer::default());
    let mut selection = VisibleSurface {
        stride: Stride::AboutPoints(POINTS),
    };
    selection.select(
        &mut workspace.context(&Problem::new(&model, &observation)),
        &init,
        &mut source,
    );
    let scene = Scene {
        model,
        observation,
        truth,
    };
    Instance {
        object: object.name(),
        scene,
        init,
        source,
    }
}

/// Splits the longest edges, and with each both of its triangles, until there are at least `triangles`.
///
/// The surface stays what it was, and closed if it was closed: neighbours split a shared edge at the same point.
///
/// # Panics
///
/// Never: a valid mesh stays one.
#[must_use]
pub fn subdivided(mesh: &TriMesh, triangles: usize) -> TriMesh {
    // Vertices in one place become one: an edge between two of a seam's vertices must be split on both its sides.
    let mut index_of = HashMap::new();
    let mut vertices: Vec<Point3<f32>> = Vec::new();
    let welded: Vec<u32> = mesh
        .vertices()
        .iter()
        .map(|point| {
            // Zero is −0 as well.
            let place = [point.x, point.y, point.z].map(|x| (x + 0.0).to_bits());
            *index_of.entry(place).or_insert_with(|| {
                vertices.push(*point);
                vertices.len() as u32 - 1
            })
        })
        .collect();
    let mut faces: Vec<[u32; 3]> = mesh
        .triangles()
        .iter()
        .map(|corners| corners.map(|corner| welded[corner as usize]))
        .collect();
    while faces.len() < triangles {
        let mut edges: Vec<(f32, u32, u32)> = faces
            .iter()
            .flat_map(|f| [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])])
            .filter(|(a, b)| a < b)
            .map(|(a, b)| {
                let length = (vertices[a as usize] - vertices[b as usize]).norm();
                (length, a, b)
            })
            .collect();
        edges.sort_by(|x, y| y.0.total_cmp(&x.0).then((x.1, x.2).cmp(&(y.1, y.2))));
        // Edges whose faces are not touched by another split of this round.
        let wanted = (triangles - faces.len()).div_ceil(2);
        let mut middle_of = HashMap::new();
        let mut touched = HashSet::<usize>::new();
        let mut faces_of = HashMap::<(u32, u32), Vec<usize>>::new();
        for (index, f) in faces.iter().enumerate() {
            for (a, b) in [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])] {
                faces_of
                    .entry((a.min(b), a.max(b)))
                    .or_default()
                    .push(index);
            }
        }
        for (_, a, b) in edges {
            let around = &faces_of[&(a, b)];
            if middle_of.len() >= wanted || around.iter().any(|f| touched.contains(f)) {
                continue;
            }
            touched.extend(around);
            let middle = vertices.len() as u32;
            vertices.push(center_of(&vertices[a as usize], &vertices[b as usize]));
            middle_of.insert((a, b), middle);
        }
        faces = faces
            .iter()
            .flat_map(|f| {
                let split = (0..3).find_map(|i| {
                    let (a, b) = (f[i], f[(i + 1) % 3]);
                    let middle = middle_of.get(&(a.min(b), a.max(b)))?;
                    let c = f[(i + 2) % 3];
                    Some(vec![[a, *middle, c], [*middle, b, c]])
                });
                split.unwrap_or_else(|| vec![*f])
            })
            .collect();
    }
    TriMesh::new(vertices, faces).expect("a valid mesh stays one")
}

fn center_of(a: &Point3<f32>, b: &Point3<f32>) -> Point3<f32> {
    Point3::from((a.coords + b.coords) * 0.5)
}

/// The model of an instance with a mesh of about 10,000 triangles, for the comparison of renderers.
///
/// # Panics
///
/// Never: a valid mesh stays one.
#[must_use]
pub fn with_10_000_triangles(model: &Model) -> Model {
    let config = ModelConfig {
        diameter: Some(model.diameter()),
        ..ModelConfig::default()
    };
    Model::with_config(subdivided(model.mesh(), 10_000), config)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hybrid_icp::core::Facing;

    #[test]
    fn instances_are_of_the_size_that_is_stated() {
        for number in 0..OBJECTS.len() {
            let instance = instance(number, 0.0);
            let pixels = instance.scene.observation.n_measured() as f64;
            assert!(
                (pixels / VISIBLE_PIXELS - 1.0).abs() < 0.1,
                "{}: {pixels}",
                instance.object
            );
            assert!(
                (1000..4000).contains(&instance.source.len()),
                "{}",
                instance.source.len()
            );
        }
    }

    #[test]
    fn a_subdivided_mesh_is_closed_and_of_the_same_area() {
        for object in OBJECTS {
            let mesh = object.solid().to_mesh().unwrap();
            let fine = subdivided(&mesh, 10_000);
            let triangles = fine.triangles().len();
            assert!((10_000..10_010).contains(&triangles), "{triangles}");
            assert_eq!(fine.facing(), Facing::Outward, "{}", object.name());
            assert!((fine.area() / mesh.area() - 1.0).abs() < 1e-5);
        }
    }
}

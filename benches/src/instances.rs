//! Instances for the comparison with other libraries.
//!
//! Each is an object of about 14,400 visible pixels in a 640×480 image.

use hicp_sim::{Household, RelativeGaussian, object_pose, perturb_by_mean, rng};
use hicp_tests::{Scene, camera, render};
use hybrid_icp::association::{Stride, VisibleSurface};
use hybrid_icp::core::internal::index;
use hybrid_icp::core::{Isometry3, Model, ModelConfig, Observation, Surfel, Translation3, TriMesh};
use hybrid_icp::nalgebra::center;

use crate::selected;

/// The objects. None has a symmetry, so that a rotation error is meaningful.
pub const OBJECTS: [Household; 5] = [
    Household::Mug,
    Household::Hammer,
    Household::Bracket,
    Household::Iron,
    Household::Car,
];

/// Target number of visible pixels.
pub const VISIBLE_PIXELS: f64 = 14_400.0;

/// Number of points that the point-based libraries receive.
pub const POINTS: usize = 2000;

/// An object in an image with an initial pose.
#[derive(Debug)]
pub struct Instance {
    /// Name of the object.
    pub object: &'static str,
    /// The model, the image and the true pose.
    pub scene: Scene,
    /// The initial pose, 6.2 mm and 9.5° off.
    pub init: Isometry3<f64>,
    /// About [`POINTS`] points in the object frame that are visible at the initial pose.
    pub source: Vec<Surfel>,
}

/// Creates an instance from its number.
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
    // The number of pixels is nearly proportional to the inverse square of the distance.
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
    let init = perturb_by_mean(&mut rng, &truth);
    let observation = Observation::new(depth, mask, camera).expect("sizes agree");
    let scene = Scene {
        model,
        observation,
        truth,
    };
    let mut selection = VisibleSurface::with_stride(Stride::AboutPoints(POINTS));
    let (source, _) = selected(&scene, &init, &mut selection);
    Instance {
        object: object.name(),
        scene,
        init,
        source,
    }
}

/// Splits the longest edge, and the triangles on its sides, until there are at least `triangles`.
///
/// The surface does not change, and a closed surface stays closed.
///
/// # Panics
///
/// Never: a valid mesh stays valid.
#[must_use]
pub fn subdivided(mesh: &TriMesh, triangles: usize) -> TriMesh {
    let (mut vertices, mut faces) = (mesh.vertices().to_vec(), mesh.triangles().to_vec());
    while faces.len() < triangles {
        let edges = faces.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let ends = |edge: [u32; 2]| edge.map(|corner| vertices[corner as usize]);
        let longest = edges.max_by(|x, y| {
            let [x, y] = [ends(*x), ends(*y)].map(|[a, b]| (a - b).norm_squared());
            x.total_cmp(&y)
        });
        let edge = longest.expect("a mesh has triangles");
        let [a, b] = ends(edge);
        let middle = index(vertices.len());
        vertices.push(center(&a, &b));
        for face in 0..faces.len() {
            let corners = faces[face];
            if edge.iter().all(|end| corners.contains(end)) {
                let [first, second] =
                    edge.map(|end| corners.map(|c| if c == end { middle } else { c }));
                faces[face] = first;
                faces.push(second);
            }
        }
    }
    TriMesh::new(vertices, faces).expect("a valid mesh stays valid")
}

/// Returns a model with a mesh of about 10,000 triangles, for the comparison of renderers.
///
/// # Panics
///
/// Never: a valid mesh stays valid.
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
    fn instances_have_the_stated_size() {
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
    fn a_subdivided_mesh_stays_closed_and_keeps_its_area() {
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

//! The object to be registered.

use std::sync::OnceLock;

use nalgebra::Point3;

use crate::derived::Derived;
use crate::id::Id;
use crate::internal::bounds;
use crate::object::diameter::diameter;
use crate::object::mesh::TriMesh;
use crate::object::sampling::sample_surface;
use crate::object::simplify::simplified;
use crate::object::symmetry::Symmetries;
use crate::surfel::Surfel;

/// The configuration of a [`Model`], without its mesh.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ModelConfig {
    /// Number of area-uniform surface samples, at most [`MAX_SAMPLES`](crate::MAX_SAMPLES); default
    /// 1000.
    ///
    /// Between 300 and 3000, the number hardly affects the accuracy.
    pub samples: usize,
    /// Diameter in meters, if a dataset prescribes one.
    ///
    /// By default it is the largest distance between two used vertices.
    pub diameter: Option<f64>,
    /// Declared symmetries.
    pub symmetries: Symmetries,
    /// Number of triangles above which a simplified mesh is rendered ([`Model::drawn`]); default
    /// 20,000.
    ///
    /// `usize::MAX` renders every mesh as it is.
    pub simplify_above: usize,
}

impl Default for ModelConfig {
    fn default() -> Self {
        Self {
            // Open: number of points of O for nearest neighbors: §III-A. They are uniform over the
            // whole surface, as §IV-B.1 says of common practice. Between 300 and 3,000 points, the
            // accuracy hardly changes.
            samples: 1000,
            diameter: None,
            symmetries: Symmetries::default(),
            // Deviation: dense meshes: §III-A renders the model. If it has more triangles than
            // this, and is not compared with a color image, a simplified mesh is rendered, because
            // the time of a render is proportional to its triangles.
            simplify_above: 20_000,
        }
    }
}

/// An object to be registered: its mesh, surface samples, size and symmetries.
///
/// Immutable, in meters, in the object frame. Building one costs O(triangles), once per object.
/// Threads share it by reference or `Arc`.
#[derive(Clone, Debug)]
pub struct Model {
    id: Id,
    mesh: TriMesh,
    samples: Vec<Surfel>,
    diameter: f64,
    center: Point3<f64>,
    radius: f64,
    symmetries: Symmetries,
    simplify_above: usize,
    /// The simplified mesh, if there is one.
    simplified: OnceLock<Option<TriMesh>>,
    derived: Derived,
}

impl Model {
    /// Creates a model with the default configuration.
    #[must_use]
    pub fn new(mesh: TriMesh) -> Self {
        Self::with_config(mesh, ModelConfig::default())
    }

    /// Creates a model from a mesh and a configuration.
    ///
    /// A configured diameter that is not finite and positive is ignored.
    #[must_use]
    pub fn with_config(mesh: TriMesh, config: ModelConfig) -> Self {
        let used: Vec<Point3<f32>> = mesh.used_points().collect();
        let [min, max] = bounds(used.iter().copied()).unwrap_or_default();
        let center = nalgebra::center(&min.cast::<f64>(), &max.cast::<f64>());
        let radius = used
            .iter()
            .map(|p| (p.cast::<f64>() - center).norm())
            .fold(0.0, f64::max);
        Self {
            id: Id::next(),
            samples: sample_surface(&mesh, config.samples),
            diameter: config
                .diameter
                .filter(|d| d.is_finite() && *d > 0.0)
                .unwrap_or_else(|| diameter(&used)),
            center,
            radius,
            symmetries: config.symmetries,
            simplify_above: config.simplify_above,
            simplified: OnceLock::new(),
            derived: Derived::default(),
            mesh,
        }
    }

    /// The identity of this model, for caches.
    #[must_use]
    pub fn id(&self) -> Id {
        self.id
    }

    /// The mesh.
    #[must_use]
    pub fn mesh(&self) -> &TriMesh {
        &self.mesh
    }

    /// The mesh that is rendered: the mesh itself, or a simplified one if it has more triangles
    /// than [`ModelConfig::simplify_above`].
    ///
    /// A simplified mesh has about 12,000 triangles, and no colors. For color images, see
    /// [`Problem::drawn`](crate::Problem::drawn). Most of its surface is within a thousandth of the
    /// diameter of the mesh. The first call computes it, in some 30 ms for 100,000 triangles.
    #[must_use]
    pub fn drawn(&self) -> &TriMesh {
        let simplify = || {
            let dense = self.mesh.triangles().len() > self.simplify_above;
            dense.then(|| simplified(&self.mesh))?
        };
        let simplified = self.simplified.get_or_init(simplify);
        simplified.as_ref().unwrap_or(&self.mesh)
    }

    /// Area-uniform samples of the whole surface with outward normals, in the object frame.
    #[must_use]
    pub fn samples(&self) -> &[Surfel] {
        &self.samples
    }

    /// Largest distance between two used vertices, or the configured diameter, in meters.
    #[must_use]
    pub fn diameter(&self) -> f64 {
        self.diameter
    }

    /// Center of the bounding box, meters, object frame.
    #[must_use]
    pub fn center(&self) -> Point3<f64> {
        self.center
    }

    /// Largest distance of a vertex from [`Model::center`], meters.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Returns whether the diameter can be that of the mesh, up to 5 %.
    ///
    /// [`ModelConfig::diameter`] may be in another unit, or of another object. Every share of the
    /// diameter is then wrong. Cost: O(1). The diameter of a mesh is between 2/√3 and 2 times
    /// [`Model::radius`].
    #[must_use]
    pub fn has_possible_diameter(&self) -> bool {
        let radii = self.diameter / self.radius;
        (0.95 * 2.0 / f64::sqrt(3.0)..=1.05 * 2.0).contains(&radii)
    }

    /// The declared symmetries.
    #[must_use]
    pub fn symmetries(&self) -> &Symmetries {
        &self.symmetries
    }

    /// Values derived from this model, built once and shared.
    #[must_use]
    pub fn derived(&self) -> &Derived {
        &self.derived
    }
}

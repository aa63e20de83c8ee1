//! Procedural household objects.

use hicp_core::{
    Isometry3, MeshError, Model, ModelConfig, Point3, Symmetries, SymmetryAxis, Vector3,
};
use rand::RngExt;

use crate::objects::shapes::{boxes, tools, vessels};
use crate::objects::solid::Solid;
use crate::stream::stream;

/// A procedural household object with declared symmetries.
///
/// Diameters are 0.08 to 0.3 m. Meshes have 2,000 to 10,000 triangles. Each part of an object is
/// closed. Parts (a mug's wall and its handle) overlap instead of being joined.
///
/// The shapes are those on which ICP variants differ: thin walls, handles, near-symmetric bodies,
/// flat boxes, concave bowls, thin plates. There are twenty categories, like the twenty `ShapeNet`
/// categories of §VI-A.1. Ten serve to tune thresholds ([`Household::TUNING`]), and ten to report
/// results ([`Household::TEST`]). Both sets have bodies of revolution, discrete symmetries, thin
/// plates, handles and asymmetric objects.
// Deviation: objects instead of ShapeNet: §VI-A.1 uses 20 ShapeNet objects of 20 categories, which
// cannot be redistributed. Here 20 procedural household objects of 20 categories replace them. The
// option `--objects` of `hybrid-icp experiment` reads any meshes instead.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Household {
    /// A cup with a thin wall and a handle.
    Mug,
    /// A bottle with a neck. It is symmetric under any rotation around its axis.
    Bottle,
    /// A thin-walled bowl. It is symmetric under any rotation around its axis.
    Bowl,
    /// A flat carton. It is symmetric under half rotations around its axes.
    Carton,
    /// An angle bracket of two thin plates.
    Bracket,
    /// A hammer: a handle and an asymmetric head.
    Hammer,
    /// A dinner plate. It is symmetric under any rotation around its axis.
    Plate,
    /// A clothes iron: a wedge with a handle.
    Iron,
    /// A toy car: a body, a cabin and four wheels.
    Car,
    /// A pan with a long handle.
    Pan,
    /// A can. It is symmetric under any rotation around its axis and when turned upside down.
    Can,
    /// An open laptop: two thin plates at an angle, one twice as thick as the other.
    Laptop,
    /// A teapot: a round body with a spout and a handle.
    Teapot,
    /// A kitchen knife: a thin blade and a handle.
    Knife,
    /// A closed book. It is symmetric when turned end over end.
    Book,
    /// A hexagonal planter with a thin wall. It is symmetric under six rotations around its axis.
    Pot,
    /// A roll of tape. It is symmetric under any rotation around its axis and when turned upside
    /// down.
    Tape,
    /// Headphones. They are symmetric under a half rotation.
    Headphones,
    /// A camera: a box with a lens.
    Camera,
    /// A ladle: a small bowl with a long handle.
    Ladle,
}

use Household::*;

impl Household {
    /// Every object. The order is fixed; new objects are appended.
    // Open: resolution of the objects: §VI-A.1. Each has 2,000 to 10,000 triangles and 0.08 to 0.3
    // m.
    pub const ALL: [Self; 20] = [
        Mug, Bottle, Bowl, Carton, Bracket, Hammer, Plate, Iron, Car, Pan, Can, Laptop, Teapot,
        Knife, Book, Pot, Tape, Headphones, Camera, Ladle,
    ];

    /// The ten objects for tuning thresholds (supplementary material, III). None is in
    /// [`Household::TEST`].
    pub const TUNING: [Self; 10] = [
        Bottle, Plate, Carton, Pot, Bracket, Teapot, Iron, Ladle, Car, Knife,
    ];

    /// The ten objects for reporting results (§VI-A.1).
    pub const TEST: [Self; 10] = [
        Bowl, Can, Tape, Book, Headphones, Laptop, Mug, Pan, Hammer, Camera,
    ];

    /// Returns the name, and the function that builds the solid.
    fn shape(self) -> (&'static str, fn() -> Solid) {
        match self {
            Mug => ("mug", vessels::mug),
            Bottle => ("bottle", vessels::bottle),
            Bowl => ("bowl", vessels::bowl),
            Carton => ("carton", boxes::carton),
            Bracket => ("bracket", tools::bracket),
            Hammer => ("hammer", tools::hammer),
            Plate => ("plate", vessels::plate),
            Iron => ("iron", tools::iron),
            Car => ("car", boxes::car),
            Pan => ("pan", vessels::pan),
            Can => ("can", vessels::can),
            Laptop => ("laptop", boxes::laptop),
            Teapot => ("teapot", vessels::teapot),
            Knife => ("knife", tools::knife),
            Book => ("book", boxes::book),
            Pot => ("pot", vessels::pot),
            Tape => ("tape", tools::tape),
            Headphones => ("headphones", boxes::headphones),
            Camera => ("camera", boxes::camera),
            Ladle => ("ladle", vessels::ladle),
        }
    }

    /// Returns the name in tables and files: one word in lower case.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.shape().0
    }

    /// Builds the object's model in its nominal proportions, with its symmetries. Meters, z up.
    ///
    /// # Errors
    ///
    /// Never fails for the objects that ship; the error is that of the mesh.
    pub fn model(self) -> Result<Model, MeshError> {
        self.model_with(Proportions::default())
    }

    /// Builds the object's model in other proportions, with its symmetries. Meters, z up.
    ///
    /// # Errors
    ///
    /// [`MeshError`] if the proportions leave no mesh, for example because one is zero.
    pub fn model_with(self, proportions: Proportions) -> Result<Model, MeshError> {
        Ok(Model::with_config(
            self.solid_with(proportions).to_mesh()?,
            ModelConfig {
                symmetries: self.symmetries(),
                ..ModelConfig::default()
            },
        ))
    }

    /// Returns the object's solid in its nominal proportions, meters, z up.
    #[must_use]
    pub fn solid(self) -> Solid {
        self.shape().1()
    }

    /// Returns the object's solid in other proportions, meters, z up.
    #[must_use]
    pub fn solid_with(self, proportions: Proportions) -> Solid {
        let Proportions { width, height } = proportions;
        self.solid().scaled(&Vector3::new(width, width, height))
    }

    /// Returns the declared symmetries, which hold in any [`Proportions`].
    #[must_use]
    pub fn symmetries(self) -> Symmetries {
        let turn = |axis: Vector3<f64>, share: f64| {
            Isometry3::rotation(axis * (std::f64::consts::TAU * share))
        };
        let half_turn = |axis| turn(axis, 0.5);
        let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
        let discrete = match self {
            Can | Tape | Book => vec![half_turn(x)],
            Carton => [x, y, z].map(half_turn).to_vec(),
            Pot => (1..6).map(|k| turn(z, f64::from(k) / 6.0)).collect(),
            Headphones => vec![half_turn(z)],
            _ => Vec::new(),
        };
        let revolves = matches!(self, Bottle | Bowl | Plate | Can | Tape);
        let axis = SymmetryAxis::new(z, Point3::origin());
        Symmetries {
            discrete,
            continuous: axis.into_iter().filter(|_| revolves).collect(),
        }
    }
}

/// Factors that stretch an object relative to its nominal shape; 1 leaves it unchanged.
///
/// There is one factor for x and y and one for z, so every declared symmetry is preserved. The
/// thickness of walls scales with them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Proportions {
    /// Factor in x and y.
    pub width: f64,
    /// Factor in z.
    pub height: f64,
}

impl Proportions {
    /// Draws proportions from a seed, each uniform in [0.8, 1].
    ///
    /// They give another specimen of the category, within the sizes of [`Household`].
    #[must_use]
    pub fn from_seed(seed: u64) -> Self {
        let mut rng = stream(seed, &["proportions"], 0);
        let mut factor = || 0.8 + 0.2 * rng.random::<f64>();
        Self {
            width: factor(),
            height: factor(),
        }
    }
}

impl Default for Proportions {
    fn default() -> Self {
        Self {
            width: 1.0,
            height: 1.0,
        }
    }
}

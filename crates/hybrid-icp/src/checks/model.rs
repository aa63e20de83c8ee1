//! Checks of a model alone.

use std::f64::consts::PI;

use hicp_core::{Model, diameter};

use crate::warning::Warning;

/// Diameters that a depth camera can see. A coin in meters or a car in millimeters is outside.
const PLAUSIBLE_DIAMETERS_METERS: std::ops::RangeInclusive<f64> = 0.002..=10.0;

/// Share of the diameter that rounding the coordinates may cost.
const COARSE: f64 = 1e-3;

/// Largest distance by which a symmetry may move the center, diameters.
const MOVED: f64 = 0.5;

/// Share of the mesh's diameter by which a stated one may differ. BOP states the diameters of other
/// versions of the mesh, with more vertices.
const DIAMETER_TOLERANCE: f64 = 0.05;

/// Returns the [`warnings`](crate::warnings) about a model that need no image.
///
/// ```
/// use hybrid_icp::core::{Model, Point3, TriMesh};
/// use hybrid_icp::{Warning, checks::warnings_of_model};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// // A mesh of 80 mm that was read as meters.
/// let corners = [[0., 0., 0.], [80., 0., 0.], [0., 80., 0.]].map(Point3::from);
/// let model = Model::new(TriMesh::new(corners.to_vec(), vec![[0, 1, 2]])?);
/// assert!(matches!(warnings_of_model(&model)[..], [Warning::Diameter { .. }]));
/// # Ok(()) }
/// ```
#[must_use]
pub fn warnings_of_model(model: &Model) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let diameter = model.diameter();
    if !PLAUSIBLE_DIAMETERS_METERS.contains(&diameter) {
        warnings.push(Warning::Diameter { diameter });
    }
    if !model.has_possible_diameter() {
        warnings.extend(warning_of_diameter(model));
    }
    warnings.extend(warning_of_symmetries(model));
    let step = model.mesh().coordinate_step();
    if step > COARSE * diameter {
        warnings.push(Warning::CoarseCoordinates { step, diameter });
    }
    warnings
}

/// Returns [`Warning::Symmetry`] if a declared symmetry moves the center by more than half of the
/// diameter.
///
/// ```
/// use hybrid_icp::core::{Model, ModelConfig, Point3, Symmetries, SymmetryAxis, TriMesh, Vector3};
/// use hybrid_icp::{Warning, checks::warning_of_symmetries};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let corners = [[0., 0., 0.], [0.1, 0., 0.], [0., 0.1, 0.]].map(Point3::from);
/// let mesh = TriMesh::new(corners.to_vec(), vec![[0, 1, 2]])?;
/// // An offset of 50 mm that was read as meters.
/// let axis = SymmetryAxis::new(Vector3::z(), Point3::new(50.0, 50.0, 0.0))?;
/// let symmetries = Symmetries { continuous: vec![axis], ..Symmetries::default() };
/// let model = Model::with_config(mesh, ModelConfig { symmetries, ..ModelConfig::default() });
/// assert!(matches!(warning_of_symmetries(&model), Some(Warning::Symmetry { .. })));
/// # Ok(()) }
/// ```
#[must_use]
pub fn warning_of_symmetries(model: &Model) -> Option<Warning> {
    let (center, diameter) = (model.center(), model.diameter());
    let symmetries = model.symmetries();
    let half_turns = symmetries.continuous.iter().map(|axis| axis.rotation(PI));
    let motions = symmetries.discrete.iter().copied().chain(half_turns);
    let distances = motions.map(|motion| (motion * center - center).norm());
    let distance = distances.fold(0.0, f64::max);
    (distance > MOVED * diameter).then_some(Warning::Symmetry { distance, diameter })
}

/// Returns [`Warning::StatedDiameter`] if a model's stated diameter differs by more than 5 % from
/// that of its mesh.
///
/// The stated diameter is [`ModelConfig::diameter`](hicp_core::ModelConfig::diameter). A dataset's
/// file can be wrong or belong to other models; all lengths in diameters are then wrong. It costs
/// about O(n log n) of the vertices, so call it once per model. [`warnings_of_model`] includes only
/// the diameters that no mesh of that radius has.
///
/// ```
/// use hybrid_icp::core::{Model, ModelConfig, Point3, TriMesh};
/// use hybrid_icp::{Warning, checks::warning_of_diameter};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let corners = [[0., 0., 0.], [0.1, 0., 0.], [0., 0.1, 0.]].map(Point3::from);
/// let mesh = TriMesh::new(corners.to_vec(), vec![[0, 1, 2]])?;
/// assert_eq!(warning_of_diameter(&Model::new(mesh.clone())), None);
/// let config = ModelConfig { diameter: Some(1.4), ..ModelConfig::default() };
/// let warning = warning_of_diameter(&Model::with_config(mesh, config));
/// assert!(matches!(warning, Some(Warning::StatedDiameter { .. })));
/// # Ok(()) }
/// ```
#[must_use]
pub fn warning_of_diameter(model: &Model) -> Option<Warning> {
    let vertices: Vec<_> = model.mesh().used_points().collect();
    let (stated, measured) = (model.diameter(), diameter(&vertices));
    let differ = (stated - measured).abs() > DIAMETER_TOLERANCE * measured;
    differ.then_some(Warning::StatedDiameter { stated, measured })
}

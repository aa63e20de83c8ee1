//! What looks wrong about inputs of which each is well-formed, mostly units that do not go together, and about what came of them.

use std::f64::consts::FRAC_PI_4;

use hicp_core::{Isometry3, Model, Observation, diameter};
use hicp_score::Flatness;
use hicp_switch::PAPER_ALPHA;
use thiserror::Error;

/// Diameters beyond which an object is taken for one in another unit: a coin in metres, a car in millimetres.
const PLAUSIBLE_DIAMETERS_METERS: std::ops::RangeInclusive<f64> = 0.002..=10.0;

/// Share of the diameter that rounding the coordinates may cost.
const COARSE: f64 = 1e-3;

/// How flat a surface is said to be at most, metres: the step of most depth images.
const FINEST: f64 = 1e-3;

/// How many times nearer or further than the pose says the measured surface may be.
const DEPTH_RATIO: f64 = 3.0;

/// How many times more pixels than the model can cover the mask may have.
const MASK_RATIO: f64 = 10.0;

/// How many times fewer pixels than the smallest side of the model's box the mask may have: nineteen twentieths may be occluded. A unit
/// that is wrong by ten makes a hundred times the pixels.
const SLIVER_RATIO: f64 = 20.0;

/// MVE from which on an initial pose explains nothing of the mask ([`Warning::FoundElsewhere`]): of 71 poses that four estimators gave for their
/// own object one has it, and so has everything that was found in the mask of another object (`docs/robustness.md`).
pub const EXPLAINS_NOTHING: f64 = 0.9;

/// Share of the mesh's diameter by which a stated one may differ: BOP's are those of other versions of the mesh, with more vertices.
const DIAMETER_TOLERANCE: f64 = 0.05;

/// Something that looks wrong about the inputs of a refinement or about its result, though nothing is refused. Lengths are metres.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// The object is smaller or larger than what is looked at with a depth camera: probably a wrong unit of the mesh.
    #[error("the model's diameter is {}", Meters(*diameter))]
    Diameter {
        /// Diameter of the model.
        diameter: f64,
    },
    /// The diameter that the model was given is another than that of its mesh ([`warning_of_diameter`]).
    #[error("the stated diameter is {}, but that of the mesh is {}", Meters(*stated), Meters(*measured))]
    StatedDiameter {
        /// The diameter that the model was made with.
        stated: f64,
        /// Largest distance between two vertices that triangles use.
        measured: f64,
    },
    /// The mesh is so far from its origin that `f32` rounds its shape.
    #[error(
        "the model's coordinates are so far from its origin that they are rounded to steps of {}, with a diameter of {}",
        Meters(*step),
        Meters(*diameter)
    )]
    CoarseCoordinates {
        /// Distance between neighbouring coordinates.
        step: f64,
        /// Diameter of the model.
        diameter: f64,
    },
    /// The object is behind the camera at the initial pose, or the pose is not finite.
    #[error("the object's centre is at z = {}, behind the camera, which looks along +z", Meters(*z))]
    BehindCamera {
        /// z of the centre of the object in the camera frame.
        z: f64,
    },
    /// There is a mask, but no depth inside.
    #[error("no depth inside the mask")]
    NoDepth,
    /// The surface inside the mask is much nearer or further than the object at the initial pose: probably a wrong depth scale or a
    /// translation in another unit.
    #[error(
        "the median depth inside the mask is {}, but the object at the initial pose is at {}",
        Meters(*measured),
        Meters(*expected)
    )]
    Depth {
        /// Median depth inside the mask.
        measured: f64,
        /// z of the centre of the object.
        expected: f64,
    },
    /// The mask has many more pixels than the object can cover at its distance: probably a wrong unit of the mesh.
    #[error(
        "the mask has {pixels} pixels, but the model ({}) at the initial pose ({}) covers at most {at_most:.0}",
        Meters(*diameter),
        Meters(*distance)
    )]
    Mask {
        /// Pixels of the mask.
        pixels: usize,
        /// Pixels of a disc of the model's diameter at its distance.
        at_most: f64,
        /// Diameter of the model.
        diameter: f64,
        /// z of the centre of the object.
        distance: f64,
    },
    /// From its smallest side the object covers many more pixels than the mask has, which does not touch the border of the image: probably
    /// a wrong unit of the mesh, or a mask of something else.
    #[error(
        "the mask has {pixels} pixels, but the model ({}) at the initial pose ({}) covers {at_least:.0} from its smallest side",
        Meters(*diameter),
        Meters(*distance)
    )]
    Sliver {
        /// Pixels of the mask.
        pixels: usize,
        /// Pixels of the smallest side of the model's bounding box at its distance.
        at_least: f64,
        /// Diameter of the model.
        diameter: f64,
        /// z of the centre of the object.
        distance: f64,
    },
    /// The refinement made the pose worse, by the score that judges both.
    #[error(
        "the returned pose explains the image worse than the initial one (MVE {mve:.3}, was {mve_initial:.3})"
    )]
    Worse {
        /// MVE of the initial pose.
        mve_initial: f64,
        /// MVE of the returned pose.
        mve: f64,
    },
    /// The returned pose has an MVE of [`PAPER_ALPHA`] or more.
    #[error("MVE {mve:.3}: the pose does not explain the image, do not trust it")]
    Unexplained {
        /// MVE of the returned pose.
        mve: f64,
    },
    /// The returned pose explains what the initial one has nothing to do with: the mask may be that of another object, and whatever is there
    /// looks enough like this one from one side to be matched.
    #[error(
        "the initial pose explained nothing of the mask (MVE {mve_initial:.3}): what was found there (MVE {mve:.3}) may be another object"
    )]
    FoundElsewhere {
        /// MVE of the initial pose.
        mve_initial: f64,
        /// MVE of the returned pose.
        mve: f64,
    },
    /// A plane explains the depth inside the mask better than the returned pose does, and the model is not flat there ([`Flatness::is_flat`]): the
    /// mask may be of a wall, a table, a box, or of something that the sensor does not see.
    #[error(
        "the surface inside the mask is flat to within {}, that of the model at the pose only to within {}, and {} away from it: what is there may be another object",
        Meters(flatness.measured.max(FINEST)),
        Meters(flatness.rendered),
        Meters(flatness.residual)
    )]
    Flat {
        /// How flat the two surfaces are, and how far one is from the other.
        flatness: Flatness,
    },
}

/// Returns what looks wrong about the inputs of a refinement; `init` is camera from object, metres.
///
/// Nothing is refused for it: a caller with a person to tell tells them, a robot cell counts them. Cost: one look at the
/// pixels of the mask's box, and one at the vertices.
///
/// ```
/// use hybrid_icp::*;
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let corners = [[0., 0., 0.], [0.1, 0., 0.], [0., 0.1, 0.]].map(Point3::from);
/// let model = Model::new(TriMesh::new(corners.to_vec(), vec![[0, 1, 2]])?);
/// // The wall is 0.8 m away, but the depth was read at a tenth of its scale.
/// let depth = DepthImage::from_meters(64, 48, vec![0.08; 64 * 48])?;
/// let camera = PinholeCamera::new(60.0, 60.0, 31.5, 23.5, 64, 48)?;
/// let observation = Observation::new(depth, Mask::full(64, 48), camera)?;
/// let warnings = warnings(&model, &observation, &Isometry3::translation(0.0, 0.0, 0.8));
/// assert!(matches!(warnings[0], Warning::Depth { .. }));
/// # Ok(()) }
/// ```
#[must_use]
pub fn warnings(model: &Model, observation: &Observation, init: &Isometry3<f64>) -> Vec<Warning> {
    let mut warnings = warnings_of_model(model);
    let diameter = model.diameter();
    let distance = (init * model.center()).z;
    if distance.is_nan() || distance <= 0.0 {
        warnings.push(Warning::BehindCamera { z: distance });
        return warnings;
    }
    let (pixels, median) = inside_mask(observation);
    let plausible = distance / DEPTH_RATIO..=distance * DEPTH_RATIO;
    match median {
        None if pixels > 0 => warnings.push(Warning::NoDepth),
        Some(measured) if !plausible.contains(&measured) => warnings.push(Warning::Depth {
            measured,
            expected: distance,
        }),
        _ => {}
    }
    // No silhouette of that diameter is larger than a disc.
    let camera = observation.camera();
    let at_most =
        FRAC_PI_4 * (camera.fx() * diameter / distance) * (camera.fy() * diameter / distance);
    // One warning about the same numbers is enough.
    if !warnings.is_empty() || pixels == 0 {
        return warnings;
    }
    if pixels as f64 > MASK_RATIO * at_most.max(1.0) {
        warnings.push(Warning::Mask {
            pixels,
            at_most,
            diameter,
            distance,
        });
    }
    let at_least = camera.fx() * camera.fy() * smallest_side(model) / distance.powi(2);
    if at_least > SLIVER_RATIO * pixels as f64 && !touches_border(observation) {
        warnings.push(Warning::Sliver {
            pixels,
            at_least,
            diameter,
            distance,
        });
    }
    warnings
}

/// Returns what looks wrong about a model by itself: those of [`warnings`] that no image is needed for.
///
/// ```
/// use hybrid_icp::*;
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// // A mesh of 80 mm that was read as metres.
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
    let step = model.mesh().coordinate_step();
    if step > COARSE * diameter {
        warnings.push(Warning::CoarseCoordinates { step, diameter });
    }
    warnings
}

/// Returns [`Warning::StatedDiameter`] where the diameter that a model was made with ([`ModelConfig::diameter`](crate::ModelConfig::diameter))
/// differs by more than a twentieth from that of its mesh.
///
/// A dataset's file can be wrong or that of other models, and what is measured in diameters is then wrong without a trace. Not one of
/// [`warnings_of_model`], for it costs about O(n log n) of the vertices: ask once per model.
///
/// ```
/// use hybrid_icp::*;
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

/// Returns what looks wrong about the result of a refinement, by the scores of its initial and of its returned pose
/// ([`Refinement::mve_initial`](crate::Refinement::mve_initial), [`Refinement::mve`](crate::Refinement::mve) and
/// [`Refinement::flatness`](crate::Refinement::flatness)).
///
/// No warning does not mean that the pose is right: an object that looks nearly the same from two sides explains the image in both
/// orientations, and one of similar shape may have an MVE of 0.2 or 0.3.
///
/// ```
/// use hybrid_icp::*;
/// // A rough pose that became a good one.
/// let at = |residual| Some(Flatness { residual, measured: 0.0025, rendered: 0.009, diameter: 0.2 });
/// assert_eq!(warnings_of_result(0.6, 0.1, at(0.002)), []);
/// // Something was found in the mask, but nothing that the detector had seen there.
/// assert!(matches!(warnings_of_result(0.95, 0.2, None)[..], [Warning::FoundElsewhere { .. }]));
/// // Nothing was found.
/// assert!(matches!(warnings_of_result(0.95, 0.7, None)[..], [Warning::Unexplained { .. }]));
/// // It got worse, but not bad.
/// assert!(matches!(warnings_of_result(0.1, 0.2, None)[..], [Warning::Worse { .. }]));
/// // The object was found on a wall.
/// assert!(matches!(warnings_of_result(0.6, 0.1, at(0.008))[..], [Warning::Flat { .. }]));
/// ```
#[must_use]
pub fn warnings_of_result(mve_initial: f64, mve: f64, flatness: Option<Flatness>) -> Vec<Warning> {
    let mut warnings = Vec::new();
    if mve > mve_initial {
        warnings.push(Warning::Worse { mve_initial, mve });
    }
    if mve >= PAPER_ALPHA {
        warnings.push(Warning::Unexplained { mve });
        return warnings;
    }
    if mve_initial >= EXPLAINS_NOTHING {
        warnings.push(Warning::FoundElsewhere { mve_initial, mve });
    }
    if let Some(flatness) = flatness.filter(Flatness::is_flat) {
        warnings.push(Warning::Flat { flatness });
    }
    warnings
}

/// Area of the smallest side of the model's box along its axes, m²: 0 for a sheet.
fn smallest_side(model: &Model) -> f64 {
    let vertices: Vec<_> = model.mesh().used_points().collect();
    let mut sides = [0, 1, 2].map(|axis| {
        let along = vertices.iter().map(|p| f64::from(p[axis]));
        let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        });
        (high - low).max(0.0)
    });
    sides.sort_by(f64::total_cmp);
    sides[0] * sides[1]
}

/// Whether the mask goes on beyond the image, for all one can tell.
fn touches_border(observation: &Observation) -> bool {
    let (camera, region) = (observation.camera(), observation.region());
    region.u_min == 0
        || region.v_min == 0
        || region.u_max == camera.width()
        || region.v_max == camera.height()
}

/// A length as people write it, however large or small.
struct Meters(f64);

impl std::fmt::Display for Meters {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let length = self.0;
        match length.abs() {
            size if size != 0.0 && !(1e-3..1e5).contains(&size) => write!(f, "{length:.3e} m"),
            _ => write!(f, "{length:.4} m"),
        }
    }
}

/// The pixels of the mask, and the median of the depth that was measured in them, metres.
fn inside_mask(observation: &Observation) -> (usize, Option<f64>) {
    let width = observation.camera().width() as usize;
    let region = observation.region();
    let columns = region.u_min as usize..region.u_max as usize;
    let mut pixels = 0;
    let mut inside: Vec<f32> = Vec::new();
    for v in region.v_min as usize..region.v_max as usize {
        let row = v * width + columns.start..v * width + columns.end;
        let depth = &observation.depth().pixels()[row.clone()];
        let mask = &observation.mask().pixels()[row];
        for (z, _) in depth.iter().zip(mask).filter(|(_, set)| **set) {
            pixels += 1;
            inside.extend(Some(*z).filter(|z| *z > 0.0));
        }
    }
    inside.sort_by(f32::total_cmp);
    let median = inside.get(inside.len() / 2).copied();
    (pixels, median.map(f64::from))
}

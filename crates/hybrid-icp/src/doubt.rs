//! What looks wrong about inputs of which each is well-formed: mostly units that do not go together.

use std::f64::consts::FRAC_PI_4;

use hicp_core::{Isometry3, Model, Observation};
use thiserror::Error;

/// Diameters beyond which an object is taken for one in another unit: a coin in metres, a car in millimetres.
const PLAUSIBLE_DIAMETERS_METERS: std::ops::RangeInclusive<f64> = 0.002..=10.0;

/// Share of the diameter that rounding the coordinates may cost.
const COARSE: f64 = 1e-3;

/// How many times nearer or further than the pose says the measured surface may be.
const DEPTH_RATIO: f64 = 3.0;

/// How many times more pixels than the model can cover the mask may have.
const MASK_RATIO: f64 = 10.0;

/// How many times fewer pixels than the smallest side of the model's box the mask may have: nineteen twentieths may be occluded. A unit
/// that is wrong by ten makes a hundred times the pixels.
const SLIVER_RATIO: f64 = 20.0;

/// Something that looks wrong about the inputs of a refinement, though none of them is refused. Lengths are metres.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum Doubt {
    /// The object is smaller or larger than what is looked at with a depth camera: probably a wrong unit of the mesh.
    #[error("the model's diameter is {}", Meters(*diameter))]
    Diameter {
        /// Diameter of the model.
        diameter: f64,
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
/// let doubts = doubts(&model, &observation, &Isometry3::translation(0.0, 0.0, 0.8));
/// assert!(matches!(doubts[0], Doubt::Depth { .. }));
/// # Ok(()) }
/// ```
#[must_use]
pub fn doubts(model: &Model, observation: &Observation, init: &Isometry3<f64>) -> Vec<Doubt> {
    let mut doubts = doubts_of_model(model);
    let diameter = model.diameter();
    let distance = (init * model.center()).z;
    if distance.is_nan() || distance <= 0.0 {
        doubts.push(Doubt::BehindCamera { z: distance });
        return doubts;
    }
    let (pixels, median) = inside_mask(observation);
    let plausible = distance / DEPTH_RATIO..=distance * DEPTH_RATIO;
    match median {
        None if pixels > 0 => doubts.push(Doubt::NoDepth),
        Some(measured) if !plausible.contains(&measured) => doubts.push(Doubt::Depth {
            measured,
            expected: distance,
        }),
        _ => {}
    }
    // No silhouette of that diameter is larger than a disc.
    let camera = observation.camera();
    let at_most =
        FRAC_PI_4 * (camera.fx() * diameter / distance) * (camera.fy() * diameter / distance);
    // One doubt about the same numbers is enough.
    if !doubts.is_empty() || pixels == 0 {
        return doubts;
    }
    if pixels as f64 > MASK_RATIO * at_most.max(1.0) {
        doubts.push(Doubt::Mask {
            pixels,
            at_most,
            diameter,
            distance,
        });
    }
    let at_least = camera.fx() * camera.fy() * smallest_side(model) / distance.powi(2);
    if at_least > SLIVER_RATIO * pixels as f64 && !touches_border(observation) {
        doubts.push(Doubt::Sliver {
            pixels,
            at_least,
            diameter,
            distance,
        });
    }
    doubts
}

/// Returns what looks wrong about a model by itself: those of [`doubts`] that no image is needed for.
///
/// ```
/// use hybrid_icp::*;
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// // A mesh of 80 mm that was read as metres.
/// let corners = [[0., 0., 0.], [80., 0., 0.], [0., 80., 0.]].map(Point3::from);
/// let model = Model::new(TriMesh::new(corners.to_vec(), vec![[0, 1, 2]])?);
/// assert!(matches!(doubts_of_model(&model)[..], [Doubt::Diameter { .. }]));
/// # Ok(()) }
/// ```
#[must_use]
pub fn doubts_of_model(model: &Model) -> Vec<Doubt> {
    let mut doubts = Vec::new();
    let diameter = model.diameter();
    if !PLAUSIBLE_DIAMETERS_METERS.contains(&diameter) {
        doubts.push(Doubt::Diameter { diameter });
    }
    let step = model.mesh().coordinate_step();
    if step > COARSE * diameter {
        doubts.push(Doubt::CoarseCoordinates { step, diameter });
    }
    doubts
}

/// Area of the smallest side of the model's box along its axes, m²: 0 for a sheet.
fn smallest_side(model: &Model) -> f64 {
    let vertices = model.mesh().vertices();
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

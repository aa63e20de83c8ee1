//! What looks wrong about the inputs of a refinement although each of them is well-formed.

use std::f64::consts::FRAC_PI_4;
use std::path::Display;

use hicp_io::LengthUnit;
use hybrid_icp::{Isometry3, Model, Observation, Refinement, Verdict};

/// Diameters beyond which an object is taken for one in another unit: a coin in metres, a car in millimetres.
const PLAUSIBLE_DIAMETERS_METERS: std::ops::RangeInclusive<f64> = 0.002..=10.0;

/// Where depth images end, as `DepthImage` has it.
const MAX_DEPTH_METERS: f32 = 1000.0;

/// How many times nearer or further than the pose says the measured surface may be.
const DEPTH_RATIO: f64 = 3.0;

/// How many times more pixels than the model can cover the mask may have.
const MASK_RATIO: f64 = 10.0;

/// Says why a refinement ended as it did; for a pose that was kept, the cause in the inputs where there is a plain one.
pub(crate) fn reason(
    refined: &Refinement,
    model: &Model,
    observation: &Observation,
    init: &Isometry3<f64>,
) -> String {
    let ended = refined.outcome.termination.explain();
    if refined.outcome.verdict == Verdict::Refined {
        return ended.to_owned();
    }
    let cause = if observation.mask().bounding_region().area() == 0 {
        "the mask is empty"
    } else if observation.n_measured() == 0 {
        "no depth was measured inside the mask"
    } else if observation.n_surfels() == 0 {
        "the depth measured inside the mask is too sparse for surface normals"
    } else if (init * model.center()).z + model.radius() <= 0.0 {
        "the object at the initial pose is behind the camera"
    } else {
        return ended.to_owned();
    };
    format!("{cause}, so that {ended}")
}

/// Returns what to warn of before a refinement: units that do not go together.
pub(crate) fn about_units(
    model: &Model,
    observation: &Observation,
    init: &Isometry3<f64>,
    names: &Names<'_>,
) -> Vec<String> {
    let mut doubts = Vec::new();
    let diameter = model.diameter();
    if !PLAUSIBLE_DIAMETERS_METERS.contains(&diameter) {
        doubts.push(format!(
            "{}: the model's diameter is {}, check --model-unit {}",
            names.model,
            meters(diameter),
            names.model_unit
        ));
    }
    let distance = (init * model.center()).z;
    if distance <= 0.0 {
        doubts.push(format!(
            "{}: the object's centre is at z = {}, behind the camera, which looks along +z",
            names.init,
            meters(distance)
        ));
        return doubts;
    }
    let masked = observation.mask().pixels().iter().filter(|set| **set);
    let masked = masked.count();
    match median_depth(observation) {
        None if masked > 0 => doubts.push(format!(
            "{}: no depth inside the mask at {} mm per unit; depths beyond {MAX_DEPTH_METERS} m count as missing: check \
             --depth-scale and {}",
            names.depth, names.depth_scale, names.mask
        )),
        Some(depth) if !(distance / DEPTH_RATIO..=distance * DEPTH_RATIO).contains(&depth) => {
            doubts.push(format!(
                "{}: the median depth inside the mask is {}, but the object at the initial pose is at {}: check \
                 --depth-scale (now {} mm per unit) and cam_t_m2c (mm)",
                names.depth,
                meters(depth),
                meters(distance),
                names.depth_scale
            ));
        }
        _ => {}
    }
    // No silhouette of that diameter is larger than a disc.
    let camera = observation.camera();
    let most =
        FRAC_PI_4 * (camera.fx() * diameter / distance) * (camera.fy() * diameter / distance);
    // One doubt about the same numbers is enough.
    if doubts.is_empty() && masked as f64 > MASK_RATIO * most.max(1.0) {
        doubts.push(format!(
            "{}: the mask has {masked} pixels, but the model ({}) at the initial pose ({}) covers at most {most:.0}: check \
             --model-unit {} and cam_t_m2c (mm)",
            names.mask,
            meters(diameter),
            meters(distance),
            names.model_unit
        ));
    }
    doubts
}

/// What the inputs are called in messages.
pub(crate) struct Names<'a> {
    pub(crate) model: Display<'a>,
    pub(crate) model_unit: LengthUnit,
    pub(crate) depth: Display<'a>,
    pub(crate) depth_scale: f64,
    pub(crate) mask: Display<'a>,
    pub(crate) init: Display<'a>,
}

/// A length as people write it, however large or small.
fn meters(length: f64) -> String {
    match length.abs() {
        size if size != 0.0 && !(1e-3..1e5).contains(&size) => format!("{length:.3e} m"),
        _ => format!("{length:.4} m"),
    }
}

fn median_depth(observation: &Observation) -> Option<f64> {
    let depth = observation.depth().pixels();
    let mask = observation.mask().pixels();
    let mut inside: Vec<f32> = depth
        .iter()
        .zip(mask)
        .filter(|(z, set)| **set && **z > 0.0)
        .map(|(z, _)| *z)
        .collect();
    inside.sort_by(f32::total_cmp);
    inside.get(inside.len() / 2).copied().map(f64::from)
}

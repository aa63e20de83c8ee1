//! What looks wrong about the inputs of a refinement although each of them is well-formed.

use std::f64::consts::FRAC_PI_4;

use hybrid_icp::{Isometry3, Model, Observation, Refinement, Verdict};

use crate::report;

/// Diameters beyond which an object is taken for one in another unit: a coin in metres, a car in millimetres.
const PLAUSIBLE_DIAMETERS_METERS: std::ops::RangeInclusive<f64> = 0.002..=10.0;

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
    let ended = report::explain(refined.outcome.termination);
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
    let odd_size = !PLAUSIBLE_DIAMETERS_METERS.contains(&diameter);
    if odd_size {
        doubts.push(format!(
            "{}: the model's diameter is {diameter:.4} m, check --model-unit {}",
            names.model, names.model_unit
        ));
    }
    let distance = (init * model.center()).z;
    if distance <= 0.0 {
        doubts.push(format!(
            "{}: the object's centre is at z = {distance:.4} m, behind the camera, which looks along +z",
            names.init
        ));
        return doubts;
    }
    if let Some(depth) = median_depth(observation)
        && !(distance / DEPTH_RATIO..=distance * DEPTH_RATIO).contains(&depth)
    {
        doubts.push(format!(
            "{}: the median depth inside the mask is {depth:.4} m, but the object at the initial pose is at {distance:.4} m: \
             check --depth-scale (now {} mm per unit) and cam_t_m2c (mm)",
            names.depth, names.depth_scale
        ));
    }
    // No silhouette of that diameter is larger than a disc.
    let camera = observation.camera();
    let most =
        FRAC_PI_4 * (camera.fx() * diameter / distance) * (camera.fy() * diameter / distance);
    let masked = observation.mask().pixels().iter().filter(|set| **set);
    let masked = masked.count();
    if !odd_size && masked as f64 > MASK_RATIO * most.max(1.0) {
        doubts.push(format!(
            "{}: the mask has {masked} pixels, but the model ({diameter:.4} m) at the initial pose ({distance:.4} m) covers at \
             most {most:.0}: check --model-unit {} and cam_t_m2c (mm)",
            names.mask, names.model_unit
        ));
    }
    doubts
}

/// What the inputs are called in messages.
pub(crate) struct Names<'a> {
    pub(crate) model: std::path::Display<'a>,
    pub(crate) model_unit: hicp_io::LengthUnit,
    pub(crate) depth: std::path::Display<'a>,
    pub(crate) depth_scale: f64,
    pub(crate) mask: std::path::Display<'a>,
    pub(crate) init: std::path::Display<'a>,
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

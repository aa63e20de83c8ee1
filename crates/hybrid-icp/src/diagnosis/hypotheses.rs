//! The hypotheses: for each possible fault, the inputs without it.

use std::f64::consts::PI;
use std::ops::RangeInclusive;

use hicp_core::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::fault::Fault;
use super::images::{
    depth_reversed, depth_shifted, mask_inverted, mask_shifted, mask_too_large, mirrored,
    ray_distance,
};
use super::inputs::Inputs;
use super::scales::{
    DECIMAL, depth_scale, focal_length, intrinsics, mesh_scale, mesh_size, translation_scale,
};

/// The possible faults of some inputs, each with the corrected inputs.
type Hypothesis = for<'a> fn(&Inputs<'a>) -> Vec<(Fault, Inputs<'a>)>;

/// Distances between two origins of a model that are a fault, in diameters.
const ELSEWHERE: RangeInclusive<f64> = 0.25..=3.0;

/// All hypotheses.
pub(super) const ALL: [Hypothesis; 15] = [
    mesh_scale,
    mesh_size,
    depth_scale,
    translation_scale,
    pose_convention,
    origin,
    intrinsics,
    focal_length,
    mask_inverted,
    ray_distance,
    mirrored,
    depth_reversed,
    depth_shifted,
    mask_shifted,
    mask_too_large,
];

/// Returns the improvement of the score that counts as none.
///
/// Most rigid corrections have no parameter to fit. The others can improve the score of right
/// inputs a little, and that of inputs with another fault.
pub(super) fn handicap(fault: &Fault) -> f64 {
    match fault {
        Fault::DepthInverted | Fault::Misaligned { .. } => 0.02,
        // These remove all that contradicts the model, also if it is the model that is wrong.
        Fault::MaskTooLarge { .. } | Fault::PlaneInMask { .. } => 0.06,
        // The mask of another object at another place is also explained a little.
        Fault::Origin { .. } => 0.2,
        Fault::MeshScale { factor } if (0.5..=2.0).contains(factor) => 0.03,
        Fault::MeshScale { factor } if !DECIMAL.contains(factor) => 0.05,
        Fault::FocalLength { .. } => 0.05,
        Fault::Disparity { product } if product.log10().fract() != 0.0 => 0.1,
        _ => 0.0,
    }
}

fn pose_convention<'a>(inputs: &Inputs<'a>) -> Vec<(Fault, Inputs<'a>)> {
    let init = &inputs.init;
    let transposed = Isometry3::from_parts(init.translation, init.rotation.inverse());
    let opengl = Isometry3::rotation(PI * Vector3::x()) * init;
    let reordered = |w, x, y, z| {
        let rotation = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
        Isometry3::from_parts(init.translation, rotation)
    };
    let [x, y, z, w] = init.rotation.coords.into();
    let order = |w_first| Fault::QuaternionOrder { w_first };
    let found = [
        (Fault::RotationTransposed, transposed),
        (Fault::PoseInverted, init.inverse()),
        (Fault::OpenglPose, opengl),
        (order(true), reordered(x, y, z, w)),
        (order(false), reordered(z, w, x, y)),
    ];
    found
        .map(|(fault, init)| (fault, inputs.with_init(init)))
        .into()
}

/// Moves the model so that the middle of its visible surface is that of the measured one.
fn origin<'a>(inputs: &Inputs<'a>) -> Vec<(Fault, Inputs<'a>)> {
    let Some(measured) = inputs.middle(&inputs.depth, |i| inputs.mask.pixels()[i]) else {
        return Vec::new();
    };
    let moved = |inputs: &Inputs<'a>, shift: Vector3<f64>| {
        inputs.with_init(Translation3::from(shift) * inputs.init)
    };
    let centered = moved(inputs, measured - inputs.init * inputs.model.center());
    let Some(rendered) = centered.middle(&centered.rendered(), |_| true) else {
        return Vec::new();
    };
    let found = moved(&centered, measured - rendered);
    let shift = inputs.init.rotation.inverse()
        * (found.init.translation.vector - inputs.init.translation.vector);
    let shift_meters = shift.into();
    match ELSEWHERE.contains(&(shift.norm() / inputs.model.diameter())) {
        true => vec![(Fault::Origin { shift_meters }, found)],
        false => Vec::new(),
    }
}

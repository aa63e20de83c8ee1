//! The hypotheses: for each possible fault, the inputs without it.

use std::f64::consts::PI;
use std::ops::RangeInclusive;

use hicp_core::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::fault::{Fault, is_measured};
use super::images::{
    depth_reversed, depth_shifted, mask_inverted, mask_shifted, mask_too_large, mirrored,
    ray_distance,
};
use super::inputs::{Corrected, Inputs};
use super::scales::{
    DECIMAL, depth_scale, focal_length, intrinsics, mesh_scale, mesh_size, translation_scale,
};

/// Distances between two origins of a model that are a fault, in diameters.
const ELSEWHERE: RangeInclusive<f64> = 0.25..=3.0;

/// Returns all possible faults of some inputs, each with the corrected inputs.
pub(super) fn all<'a>(inputs: &Inputs<'a>) -> impl Iterator<Item = Corrected<'a>> {
    let several: [for<'i> fn(&Inputs<'i>) -> Vec<Corrected<'i>>; 5] = [
        mesh_scale,
        pose_convention,
        intrinsics,
        mirrored,
        depth_reversed,
    ];
    let one: [for<'i> fn(&Inputs<'i>) -> Option<Corrected<'i>>; 10] = [
        mesh_size,
        depth_scale,
        translation_scale,
        origin,
        focal_length,
        mask_inverted,
        ray_distance,
        depth_shifted,
        mask_shifted,
        mask_too_large,
    ];
    let several = several.into_iter().flat_map(|of| of(inputs));
    several.chain(one.into_iter().filter_map(|of| of(inputs)))
}

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
        Fault::MeshScale { factor } if is_measured(*factor) => 0.03,
        Fault::MeshScale { factor } if !DECIMAL.contains(factor) => 0.05,
        Fault::FocalLength { .. } => 0.05,
        Fault::Disparity { product } if product.log10().fract() != 0.0 => 0.1,
        _ => 0.0,
    }
}

fn pose_convention<'a>(inputs: &Inputs<'a>) -> Vec<Corrected<'a>> {
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
fn origin<'a>(inputs: &Inputs<'a>) -> Option<Corrected<'a>> {
    let measured = inputs.middle(&inputs.depth, |i| inputs.mask.pixels()[i])?;
    let moved = |inputs: &Inputs<'a>, shift: Vector3<f64>| {
        inputs.with_init(Translation3::from(shift) * inputs.init)
    };
    let centered = moved(inputs, measured - inputs.init * inputs.model.center());
    let rendered = centered.middle(&centered.rendered(), |_| true)?;
    let found = moved(&centered, measured - rendered);
    let shift = inputs.init.rotation.inverse()
        * (found.init.translation.vector - inputs.init.translation.vector);
    let shift_meters = shift.into();
    let is_elsewhere = ELSEWHERE.contains(&(shift.norm() / inputs.model.diameter()));
    is_elsewhere.then_some((Fault::Origin { shift_meters }, found))
}

//! The hypotheses: for each possible fault, the inputs without it.

use std::f64::consts::PI;

use hicp_core::{Isometry3, Vector3};

use super::fault::Fault;
use super::images::{
    depth_reversed, depth_shifted, mask_inverted, mask_shifted, mask_too_large, mirrored,
    ray_distance,
};
use super::inputs::Inputs;
use super::scales::{DECIMAL, depth_scale, intrinsics, mesh_scale, translation_scale};

/// The possible faults of some inputs, each with the corrected inputs.
type Hypothesis = for<'a> fn(&Inputs<'a>) -> Vec<(Fault, Inputs<'a>)>;

/// All hypotheses.
pub(super) const ALL: [Hypothesis; 12] = [
    mesh_scale,
    depth_scale,
    translation_scale,
    pose_convention,
    intrinsics,
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
/// Rigid corrections have no parameter to fit. The others can improve the score of right inputs a
/// little, and that of inputs with another fault.
pub(super) fn handicap(fault: &Fault) -> f64 {
    match fault {
        Fault::DepthInverted
        | Fault::Misaligned { .. }
        | Fault::MaskTooLarge { .. }
        | Fault::PlaneInMask { .. } => 0.02,
        Fault::MeshScale { factor } if !DECIMAL.contains(factor) => 0.05,
        Fault::Disparity { product } if product.log10().fract() != 0.0 => 0.1,
        _ => 0.0,
    }
}

fn pose_convention<'a>(inputs: &Inputs<'a>) -> Vec<(Fault, Inputs<'a>)> {
    let init = &inputs.init;
    let transposed = Isometry3::from_parts(init.translation, init.rotation.inverse());
    let opengl = Isometry3::rotation(PI * Vector3::x()) * init;
    let found = [
        (Fault::RotationTransposed, transposed),
        (Fault::PoseInverted, init.inverse()),
        (Fault::OpenglPose, opengl),
    ];
    found
        .map(|(fault, init)| (fault, inputs.with_init(init)))
        .into()
}

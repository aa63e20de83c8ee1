//! Checks of the intrinsics.

use hicp_core::{Model, Observation, PinholeCamera};

use crate::warning::{CenterFault, Warning};

/// Sizes of images, relative to this one, to which its intrinsics may belong.
const SIZES: [f64; 8] = [0.25, 1.0 / 3.0, 0.5, 2.0 / 3.0, 1.5, 2.0, 3.0, 4.0];

/// Largest distance of a principal point from the middle of that image, in halves of the width.
const CENTERED: f64 = 0.06;

/// Length of a mask, in diameters, that no object has, also if the mask has errors.
const TOO_LONG: f64 = 1.15;

/// Length from which on a mask shows more than the object, so that its length says nothing.
const NOT_OF_OBJECT: f64 = 1.3;

/// Largest logarithm of the ratio of the sides of a pixel.
const SQUARE: f64 = 0.1;

/// Largest angle between the optical axis and a pixel. The corners of the widest depth cameras are
/// at 68°.
const FARTHEST_DEGREES: f64 = 70.0;

/// Returns [`Warning::Center`] if the intrinsics are hardly those of the image.
///
/// The principal point of a cropped image may be anywhere, also outside. If a crop looks like a
/// resized image, the mask decides ([`was_cropped`]).
pub(super) fn warning_of_center(camera: &PinholeCamera) -> Option<Warning> {
    let (width, height) = (f64::from(camera.width()), f64::from(camera.height()));
    let (u, v) = (0.5 * width, 0.5 * height);
    let [fx, fy, cx, cy] = [camera.fx(), camera.fy(), camera.cx(), camera.cy()];
    let off = |x: f64, y: f64| (x - u).abs() + (y - v).abs();
    let resized = |factor: &f64| off(cx / factor, cy / factor) < CENTERED * u;
    // Pixels are about square, but the halves of an image's sides are not.
    let square = |x: f64, y: f64| (x / y).ln().abs() < SQUARE;
    let exchanged = off(fx, fy) < 0.2 * u && square(cx, cy);
    let corner = (cx.max(width - cx) / fx).hypot(cy.max(height - cy) / fy);
    let degrees = corner.atan().to_degrees();
    let fault = if off(cx, cy) <= 0.2 * u {
        (degrees > FARTHEST_DEGREES).then_some(CenterFault::Far { degrees })
    } else if off(cy, cx) < 0.25 * off(cx, cy) {
        Some(CenterFault::Swapped)
    } else if exchanged && (!square(fx, fy) || cx > width || cy > height) {
        Some(CenterFault::Exchanged)
    } else if let Some(factor) = SIZES.into_iter().find(resized) {
        Some(CenterFault::Resized { factor })
    } else {
        (degrees > FARTHEST_DEGREES).then_some(CenterFault::Far { degrees })
    };
    fault.map(|fault| Warning::Center { cx, cy, fault })
}

/// Returns whether an image that seems to be resized was cropped, by the length of its mask.
///
/// With the focal length of a resized image, the mask would be longer than the model at that depth.
pub(super) fn was_cropped(
    model: &Model,
    observation: &Observation,
    depth: f64,
    fault: CenterFault,
) -> bool {
    let CenterFault::Resized { factor } = fault else {
        return false;
    };
    let (camera, region) = (observation.camera(), observation.region());
    let across = region.width() as f64 / camera.fx();
    let down = region.height() as f64 / camera.fy();
    let length = across.max(down) * depth / model.diameter();
    factor * length > TOO_LONG && length < NOT_OF_OBJECT && !touches_border(observation)
}

/// Returns whether the mask may continue beyond the image.
pub(super) fn touches_border(observation: &Observation) -> bool {
    let (camera, region) = (observation.camera(), observation.region());
    region.u_min == 0
        || region.v_min == 0
        || region.u_max == camera.width()
        || region.v_max == camera.height()
}

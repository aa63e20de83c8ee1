//! A coarse depth image, for scores at low resolution.

use std::sync::Arc;

use hicp_core::Observation;

use crate::mve::trust_map::{CERTAIN, TrustMap};

/// A pixel of the coarse image.
pub(crate) struct CoarsePixel {
    /// Meters; 0 without a measured depth.
    pub(crate) measured: f32,
    /// The certainty that it shows the object, at most [`CoarseGrid::one`].
    pub(crate) weight: u64,
    /// Distance from the camera divided by the depth.
    pub(crate) distance_per_depth: f32,
}

/// The pixels of a decimated observation, without most of the noise.
pub(crate) struct CoarseGrid {
    pub(crate) pixels: Vec<CoarsePixel>,
    /// The weight of a pixel that certainly shows the object.
    pub(crate) one: u64,
    /// The sum of the weights of measured pixels.
    pub(crate) total: u64,
    /// The distance behind the rendered surface from which on the camera sees through it; `None`
    /// for an exact mask.
    pub(crate) seen_through_meters: Option<f64>,
}

/// Number of pixels along a side of the window whose median is the depth of a coarse pixel.
///
/// They are half a coarse pixel apart.
const WINDOW: u32 = 5;

impl CoarseGrid {
    /// Returns the grid of an exact mask. It is built once and shared.
    pub(crate) fn exact(fine: &Observation, coarse: &Observation) -> Arc<Self> {
        coarse.derived().get_or_build(0, || {
            let mask = coarse.mask().pixels();
            Self {
                pixels: pixels(fine, coarse, |index, _| u64::from(mask[index])),
                one: 1,
                total: coarse.n_measured() as u64,
                seen_through_meters: None,
            }
        })
    }

    /// Returns the grid of an imperfect mask for objects of a diameter in meters.
    ///
    /// It is built once per diameter and shared.
    pub(crate) fn imperfect(fine: &Observation, coarse: &Observation, diameter: f64) -> Arc<Self> {
        coarse.derived().get_or_build(diameter.to_bits(), || {
            let trust = TrustMap::of(fine, diameter);
            let pixels = pixels(fine, coarse, |_, (u, v)| u64::from(trust.weight(u, v)));
            let measured = pixels.iter().filter(|pixel| pixel.measured > 0.0);
            Self {
                one: u64::from(CERTAIN),
                total: measured.map(|pixel| pixel.weight).sum(),
                seen_through_meters: Some(trust.seen_through_meters()),
                pixels,
            }
        })
    }
}

/// Returns the factor between the resolutions of the two images.
fn factor(fine: &Observation, coarse: &Observation) -> u32 {
    let ratio = fine.camera().fx() / coarse.camera().fx();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // A small whole number.
    let factor = ratio.round() as u32;
    factor.max(1)
}

/// Returns the pixels, with weights for their indices and for their places in the fine image.
fn pixels(
    fine: &Observation,
    coarse: &Observation,
    weight: impl Fn(usize, (u32, u32)) -> u64,
) -> Vec<CoarsePixel> {
    let (camera, factor) = (coarse.camera(), factor(fine, coarse));
    let places = (0..camera.height()).flat_map(|v| (0..camera.width()).map(move |u| (u, v)));
    let depth = coarse.depth().pixels().iter().enumerate();
    let pixels = places.zip(depth).map(|((u, v), (index, z))| {
        let x = (f64::from(u) - camera.cx()) / camera.fx();
        let y = (f64::from(v) - camera.cy()) / camera.fy();
        let place = (u * factor, v * factor);
        CoarsePixel {
            measured: median_around(fine, place, factor).unwrap_or(*z),
            weight: weight(index, place),
            #[allow(clippy::cast_possible_truncation)] // f32 is the precision of depth.
            distance_per_depth: (x * x + y * y + 1.0).sqrt() as f32,
        }
    });
    pixels.collect()
}

/// Returns the median depth around a pixel of the mask.
///
/// The window is two coarse pixels wide. Only masked pixels count.
fn median_around(fine: &Observation, (u, v): (u32, u32), factor: u32) -> Option<f32> {
    let (depth, mask) = (fine.depth(), fine.mask());
    if factor == 1 || mask.get(u, v) != Some(true) || depth.get(u, v)? <= 0.0 {
        return None;
    }
    let mut window = [0.0; (WINDOW * WINDOW) as usize];
    let mut count = 0;
    let offset = |step: u32, from: u32| (from + factor * step / 2).wrapping_sub(factor);
    for (a, b) in (0..WINDOW).flat_map(|b| (0..WINDOW).map(move |a| (a, b))) {
        let (a, b) = (offset(a, u), offset(b, v));
        if mask.get(a, b) == Some(true)
            && let Some(z) = depth.get(a, b)
            && z > 0.0
        {
            window[count] = z;
            count += 1;
        }
    }
    let window = &mut window[..count];
    Some(*window.select_nth_unstable_by(count / 2, f32::total_cmp).1)
}

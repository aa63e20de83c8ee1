//! A coarse depth image, for scores at low resolution.

use std::sync::Arc;

use hicp_core::Observation;

use crate::mve::sampled_mve::LANES;
use crate::mve::trust_map::{CERTAIN, TrustMap};

/// The pixels of a decimated observation, without most of the noise.
///
/// Row-major, and followed by [`LANES`] pixels without a measured depth.
pub(crate) struct CoarseGrid {
    /// Number of columns.
    pub(crate) width: usize,
    /// Meters; 0 without a measured depth.
    pub(crate) measured: Vec<f32>,
    /// The certainties that pixels show the object, at most [`CoarseGrid::one`].
    pub(crate) weights: Vec<u32>,
    /// Distances from the camera divided by the depth.
    pub(crate) distance_per_depth: Vec<f32>,
    /// The weight of a pixel that certainly shows the object.
    pub(crate) one: u32,
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
            let grid = Self::new(fine, coarse, |index, _| u32::from(mask[index]));
            Self {
                one: 1,
                total: coarse.n_measured() as u64,
                ..grid
            }
        })
    }

    /// Returns the grid of an imperfect mask for objects of a diameter in meters.
    ///
    /// It is built once per diameter and shared.
    pub(crate) fn imperfect(fine: &Observation, coarse: &Observation, diameter: f64) -> Arc<Self> {
        coarse.derived().get_or_build(diameter.to_bits(), || {
            let trust = TrustMap::of(fine, diameter);
            let grid = Self::new(fine, coarse, |_, (u, v)| u32::from(trust.weight(u, v)));
            let pixels = grid.measured.iter().zip(&grid.weights);
            let known = pixels.filter(|(z, _)| **z > 0.0);
            Self {
                one: u32::from(CERTAIN),
                total: known.map(|(_, weight)| u64::from(*weight)).sum(),
                seen_through_meters: Some(trust.seen_through_meters()),
                ..grid
            }
        })
    }

    /// Creates a grid with weights for the indices of pixels and their places in the fine image.
    fn new(
        fine: &Observation,
        coarse: &Observation,
        weight: impl Fn(usize, (u32, u32)) -> u32,
    ) -> Self {
        let (camera, factor) = (coarse.camera(), factor(fine, coarse));
        let size = coarse.depth().pixels().len() + LANES;
        let mut grid = Self {
            width: camera.width() as usize,
            measured: Vec::with_capacity(size),
            weights: Vec::with_capacity(size),
            distance_per_depth: Vec::with_capacity(size),
            one: 0,
            total: 0,
            seen_through_meters: None,
        };
        let places = (0..camera.height()).flat_map(|v| (0..camera.width()).map(move |u| (u, v)));
        let depth = coarse.depth().pixels().iter().enumerate();
        for ((u, v), (index, z)) in places.zip(depth) {
            let x = (f64::from(u) - camera.cx()) / camera.fx();
            let y = (f64::from(v) - camera.cy()) / camera.fy();
            let place = (u * factor, v * factor);
            let measured = median_around(fine, place, factor).unwrap_or(*z);
            grid.measured.push(measured);
            grid.weights.push(weight(index, place));
            #[allow(clippy::cast_possible_truncation)] // f32 is the precision of depth.
            grid.distance_per_depth
                .push((x * x + y * y + 1.0).sqrt() as f32);
        }
        grid.measured.resize(size, 0.0);
        grid.weights.resize(size, 0);
        grid.distance_per_depth.resize(size, 1.0);
        grid
    }
}

/// Returns the factor between the resolutions of the two images.
fn factor(fine: &Observation, coarse: &Observation) -> u32 {
    let ratio = fine.camera().fx() / coarse.camera().fx();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // A small whole number.
    let factor = ratio.round() as u32;
    factor.max(1)
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

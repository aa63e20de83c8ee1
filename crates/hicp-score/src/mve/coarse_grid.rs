//! A coarse depth image, for scores at low resolution.

use std::ops::Range;
use std::sync::Arc;

use hicp_core::Observation;
use hicp_core::internal::{VectorLoop, median, whole};

use crate::mve::agreement::all_bits;
use crate::mve::trust_map::{CERTAIN, TrustMap};
use crate::tolerances::N_TOLERANCES;

/// Number of zeros after the last pixel, for loops over many pixels at once.
pub(crate) const PADDING: usize = 8;

/// The pixels of a decimated observation, without most of the noise.
///
/// Each of the three lists is row-major and ends with [`PADDING`] zeros.
pub(crate) struct CoarseGrid {
    /// Meters; 0 without a measured depth.
    pub(crate) measured: Vec<f32>,
    /// The certainty that a pixel shows the object, at most [`CoarseGrid::one`].
    pub(crate) weight: Vec<u32>,
    /// Distance from the camera divided by the depth.
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
            Self {
                total: coarse.n_measured() as u64,
                ..Self::new(fine, coarse, |index, _| u32::from(mask[index]))
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
            let measured = (grid.weight.iter().zip(&grid.measured)).filter(|(_, z)| **z > 0.0);
            Self {
                one: u32::from(CERTAIN),
                total: measured.map(|(weight, _)| u64::from(*weight)).sum(),
                seen_through_meters: Some(trust.seen_through_meters()),
                ..grid
            }
        })
    }

    /// Creates a grid with weights for the indices of pixels and for their places in the fine
    /// image.
    fn new(
        fine: &Observation,
        coarse: &Observation,
        weight: impl Fn(usize, (u32, u32)) -> u32,
    ) -> Self {
        let (camera, factor) = (coarse.camera(), factor(fine, coarse));
        let depth = coarse.depth().pixels();
        let length = depth.len() + PADDING;
        let mut grid = Self {
            measured: Vec::with_capacity(length),
            weight: Vec::with_capacity(length),
            distance_per_depth: Vec::with_capacity(length),
            one: 1,
            total: 0,
            seen_through_meters: None,
        };
        for ((u, v), (index, z)) in camera.region().pixels().zip(depth.iter().enumerate()) {
            let place = (u * factor, v * factor);
            grid.measured
                .push(median_around(fine, place, factor).unwrap_or(*z));
            grid.weight.push(weight(index, place));
            #[allow(clippy::cast_possible_truncation)] // f32 is the precision of depth.
            let distance = camera.distance_per_depth(u.into(), v.into()) as f32;
            grid.distance_per_depth.push(distance);
        }
        grid.measured.resize(length, 0.0);
        grid.weight.resize(length, 0);
        grid.distance_per_depth.resize(length, 0.0);
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
    median(&mut window[..count], f32::total_cmp)
}

/// Number of pixels compared at once.
const LANES: usize = PADDING;

/// Number of pixels whose agreement fits a sum of 32 bits.
const MOST_PIXELS: usize = 1 << 20;

/// The loop that compares the touched pixels of a buffer with a grid, and clears them.
///
/// It returns the weights of pixels that agree, summed over the tolerances, and the weights that
/// pixels outside the mask lack.
pub(crate) struct CompareCoarse<'a> {
    pub(crate) grid: &'a CoarseGrid,
    pub(crate) image_width: usize,
    /// The columns and rows that contain the touched pixels.
    pub(crate) touched: [Range<usize>; 2],
    /// Inverse depths, 0 for a pixel that is not touched. It has the length of the grid's lists.
    pub(crate) buffer: &'a mut [f32],
    /// Tolerances per meter.
    pub(crate) per_meter: f32,
    /// Meters behind the measured surface from which on a pixel is hidden.
    pub(crate) hidden_beyond: f32,
}

impl VectorLoop for CompareCoarse<'_> {
    type Output = (u64, u64);

    #[inline(always)]
    fn run(self) -> (u64, u64) {
        #[allow(clippy::cast_possible_truncation)] // A small constant.
        let most = N_TOLERANCES as u32;
        let grid = self.grid;
        let [columns, rows] = self.touched;
        let (mut all_agree, mut all_outside) = (0, 0);
        let (mut agreement, mut outside) = ([0_u32; LANES], [0_u32; LANES]);
        let mut pixels = 0;
        for row in rows {
            // The last pixels may be in the next row, or in the padding. A pixel counts once,
            // because it is cleared.
            for column in columns.clone().step_by(LANES) {
                let first = row * self.image_width + column;
                let Some(buffer) = self.buffer[first..].first_chunk_mut::<LANES>() else {
                    unreachable!("the buffer is padded")
                };
                let inverse = std::mem::replace(buffer, [0.0; LANES]);
                let (measured, weight) = (lanes(&grid.measured, first), lanes(&grid.weight, first));
                let distance_per_depth = lanes(&grid.distance_per_depth, first);
                for lane in 0..LANES {
                    let behind = (1.0 / inverse[lane] - measured[lane]) * distance_per_depth[lane];
                    let touched = all_bits(inverse[lane] > 0.0);
                    let known = all_bits(measured[lane] > 0.0);
                    // A pixel agrees within a tolerance if it differs by less.
                    let beyond = whole((behind.abs() * self.per_meter).min(most as f32));
                    agreement[lane] += touched & known & ((most - beyond) * weight[lane]);
                    let hidden = known & all_bits(behind > self.hidden_beyond);
                    outside[lane] += touched & !hidden & (grid.one - weight[lane]);
                }
                pixels += LANES;
                if pixels >= MOST_PIXELS {
                    all_agree += total(&std::mem::take(&mut agreement));
                    all_outside += total(&std::mem::take(&mut outside));
                    pixels = 0;
                }
            }
        }
        (all_agree + total(&agreement), all_outside + total(&outside))
    }
}

/// Returns the numbers from an index on.
#[inline(always)]
fn lanes<T>(numbers: &[T], first: usize) -> &[T; LANES] {
    let Some(lanes) = numbers[first..].first_chunk() else {
        unreachable!("the grid is padded")
    };
    lanes
}

fn total(lanes: &[u32; LANES]) -> u64 {
    lanes.iter().map(|lane| u64::from(*lane)).sum()
}

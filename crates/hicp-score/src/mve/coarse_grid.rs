//! A coarse depth image, for scores at low resolution.

use std::ops::Range;
use std::sync::Arc;

use hicp_core::internal::{VectorLoop, median, whole};
use hicp_core::{Derived, Observation, PixelRegion};

use crate::mve::agreement::all_bits;
use crate::mve::trust_map::{CERTAIN, TrustMap};
use crate::tolerances::N_TOLERANCES;

/// Number of zeros after the last pixel, for loops over many pixels at once.
pub(crate) const PADDING: usize = 8;

/// Every few pixels of an observation, without most of the noise.
///
/// Each of the three lists is row-major and ends with [`PADDING`] zeros.
pub(crate) struct CoarseGrid {
    /// The camera of the coarse image.
    pub(crate) camera: hicp_core::PinholeCamera,
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

/// The grids of an observation at one resolution.
#[derive(Default)]
struct Grids(Derived);

/// Number of pixels along a side of the window whose median is the depth of a coarse pixel.
///
/// They are half a coarse pixel apart.
const WINDOW: u32 = 5;

impl CoarseGrid {
    /// Returns the grid of every `factor`-th pixel of every `factor`-th row, from pixel (0, 0).
    ///
    /// `imperfect` is the diameter of the object in meters if the mask is imperfect. The grid is
    /// built once and shared. Cost: O(image / factor²).
    pub(crate) fn of(fine: &Observation, factor: u32, imperfect: Option<f64>) -> Arc<Self> {
        let grids: Arc<Grids> = fine.derived().get_or_build(factor.into(), Grids::default);
        // No diameter has the key of an exact mask.
        let key = imperfect.map_or(0, f64::to_bits);
        grids.0.get_or_build(key, || match imperfect {
            None => Self::new(fine, factor, &fine.region(), |_, masked| masked.into()),
            Some(diameter) => {
                let trust = TrustMap::of(fine, diameter);
                let weight = |(u, v), _| trust.weight(u, v).into();
                Self {
                    one: CERTAIN.into(),
                    seen_through_meters: Some(trust.seen_through_meters()),
                    ..Self::new(fine, factor, trust.region(), weight)
                }
            }
        })
    }

    /// Creates a grid with weights for pixels of a region of the fine image, and their mask.
    ///
    /// The mask lies in the region. Outside, weights are 0.
    fn new(
        fine: &Observation,
        factor: u32,
        region: &PixelRegion,
        weight: impl Fn((u32, u32), bool) -> u32,
    ) -> Self {
        let camera = fine.camera().scaled_down(factor);
        let (width, height) = camera.size();
        let length = width as usize * height as usize + PADDING;
        let mut measured = Vec::with_capacity(length);
        measured.extend_from_slice(fine.depth().decimated(factor).pixels());
        let mut distance_per_depth = Vec::with_capacity(length);
        // `PinholeCamera::distance_per_depth`, with one division per row and column.
        let squared = |pixel: u32, center: f64, focal_length: f64| {
            let slope = (f64::from(pixel) - center) / focal_length;
            slope * slope
        };
        let x = (0..width).map(|u| squared(u, camera.cx(), camera.fx()));
        let x: Vec<f64> = x.collect();
        for v in 0..height {
            let y = squared(v, camera.cy(), camera.fy());
            #[allow(clippy::cast_possible_truncation)] // f32 is the precision of depth.
            distance_per_depth.extend(x.iter().map(|x| (x + y + 1.0).sqrt() as f32));
        }
        measured.resize(length, 0.0);
        distance_per_depth.resize(length, 0.0);
        let (mut weights, mut total) = (vec![0; length], 0);
        for (u, v) in region.decimated(factor).pixels() {
            let (place, index) = ((u * factor, v * factor), (v * width + u) as usize);
            let masked = fine.mask().get(place.0, place.1) == Some(true);
            weights[index] = weight(place, masked);
            if measured[index] > 0.0 {
                total += u64::from(weights[index]);
                if masked && factor > 1 {
                    measured[index] = median_around(fine, place, factor);
                }
            }
        }
        Self {
            camera,
            measured,
            weight: weights,
            distance_per_depth,
            one: 1,
            total,
            seen_through_meters: None,
        }
    }
}

/// Returns the median depth around a measured pixel of the mask.
///
/// The window is two coarse pixels wide. Only masked pixels count.
fn median_around(fine: &Observation, (u, v): (u32, u32), factor: u32) -> f32 {
    let (depth, mask) = (fine.depth(), fine.mask());
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
    median(&mut window[..count], f32::total_cmp).unwrap_or(0.0)
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

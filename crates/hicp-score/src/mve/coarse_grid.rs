//! A coarse depth image, for scores at low resolution.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use hicp_core::internal::{VectorLoop, median, whole};
use hicp_core::{DepthImage, Derived, Observation, PinholeCamera, PixelRegion};

use crate::mve::agreement::all_bits;
use crate::mve::trust_map::{CERTAIN, TrustMap, share_of};
use crate::tolerances::N_TOLERANCES;

/// Number of zeros after each row, for loops over many pixels at once.
pub(crate) const PADDING: usize = 8;

/// Every few pixels of an observation, without most of the noise.
pub(crate) struct CoarseGrid {
    /// The camera of the coarse image.
    pub(crate) camera: PinholeCamera,
    /// The weight of a pixel that certainly shows the object.
    pub(crate) one: u32,
    /// The sum of the weights of measured pixels.
    pub(crate) total: u64,
    /// The share of the weight of masked pixels without a depth that counts against a pose where it
    /// does not cover them, and the places of these pixels in a buffer.
    uncovered_share: f32,
    unmeasured: Vec<usize>,
    /// The distance behind the rendered surface from which on the camera sees through it; `None`
    /// for an exact mask.
    pub(crate) seen_through_meters: Option<f64>,
    depth: Arc<DepthImage>,
    factor: u32,
    /// The coarse region outside which weights are 0, with the depth and the weight of its pixels.
    region: PixelRegion,
    inside: Vec<(f32, u32)>,
    /// The rows that a score has read.
    rows: Vec<OnceLock<Row>>,
}

/// A row of a grid. Each list ends with [`PADDING`] zeros.
pub(crate) struct Row {
    /// Meters; 0 without a measured depth.
    measured: Vec<f32>,
    /// The certainty that a pixel shows the object, at most [`CoarseGrid::one`].
    weight: Vec<u32>,
    /// Distance from the camera divided by the depth.
    distance_per_depth: Vec<f32>,
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
    /// built once and shared. Cost: O(pixels of the mask's box), then O(width) for each row that is
    /// read for the first time.
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
                    uncovered_share: trust.uncovered_share(),
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
        let region = region.decimated(factor);
        let (mut total, mut unmeasured) = (0, Vec::new());
        let stride = camera.width() as usize + PADDING;
        let pixel = |(u, v): (u32, u32)| {
            let place = v as usize * stride + u as usize;
            let (u, v) = (u * factor, v * factor);
            let masked = fine.mask().get(u, v) == Some(true);
            let certainty = weight((u, v), masked);
            let mut measured = fine.depth().get(u, v).unwrap_or(0.0);
            if measured > 0.0 {
                total += u64::from(certainty);
                if masked && factor > 1 {
                    // A thin part is not mistaken for the table around it.
                    let counts = |place| 2 * weight(place, true) >= certainty;
                    measured = median_around(fine, (u, v), factor, counts);
                }
            } else if certainty > 0 {
                unmeasured.push(place);
            }
            (measured, certainty)
        };
        let inside = region.pixels().map(pixel).collect();
        Self {
            camera,
            one: 1,
            total,
            uncovered_share: 0.0,
            unmeasured,
            seen_through_meters: None,
            depth: Arc::clone(fine.shared_depth()),
            factor,
            region,
            inside,
            rows: (0..camera.height()).map(|_| OnceLock::new()).collect(),
        }
    }

    /// Returns the weight with which masked pixels without a depth count against a pose.
    ///
    /// `buffer` has the inverse depths of the pose, as for [`CompareCoarse`].
    pub(crate) fn uncovered(&self, buffer: &[f32]) -> u64 {
        if self.uncovered_share <= 0.0 {
            return 0;
        }
        let pixels = self.unmeasured.iter();
        let missed = pixels.filter(|place| buffer[**place] <= 0.0).count();
        share_of(self.uncovered_share, missed as u64 * u64::from(self.one))
    }

    /// Number of pixels from one row of a buffer to the next.
    pub(crate) fn stride(&self) -> usize {
        self.camera.width() as usize + PADDING
    }

    /// Returns a row.
    #[inline]
    fn row(&self, v: usize) -> &Row {
        self.rows[v].get_or_init(|| self.new_row(v))
    }

    #[cold]
    fn new_row(&self, v: usize) -> Row {
        let (camera, region) = (&self.camera, &self.region);
        let squared = |pixel: usize, center: f64, focal_length: f64| {
            let slope = (pixel as f64 - center) / focal_length;
            slope * slope
        };
        let y = squared(v, camera.cy(), camera.fy());
        // `PinholeCamera::distance_per_depth`.
        let distance = |u| (squared(u, camera.cx(), camera.fx()) + y + 1.0).sqrt();
        let width = camera.width() as usize;
        let fine = self.depth.width() as usize;
        let first = v * self.factor as usize * fine;
        let depths = self.depth.pixels()[first..first + fine].iter();
        let mut row = Row {
            measured: depths.step_by(self.factor as usize).copied().collect(),
            weight: vec![0; width],
            #[allow(clippy::cast_possible_truncation)] // f32 is the precision of depth.
            distance_per_depth: (0..width).map(|u| distance(u) as f32).collect(),
        };
        if (region.v_min as usize..region.v_max as usize).contains(&v) {
            let start = (v - region.v_min as usize) * region.width();
            for (u, (measured, weight)) in
                (region.u_min as usize..).zip(&self.inside[start..start + region.width()])
            {
                (row.measured[u], row.weight[u]) = (*measured, *weight);
            }
        }
        row.measured.resize(self.stride(), 0.0);
        row.weight.resize(self.stride(), 0);
        row.distance_per_depth.resize(self.stride(), 0.0);
        row
    }
}

/// Returns the median depth around a measured pixel of the mask.
///
/// The window is two coarse pixels wide. Only masked pixels that meet a condition count.
fn median_around(
    fine: &Observation,
    (u, v): (u32, u32),
    factor: u32,
    counts: impl Fn((u32, u32)) -> bool,
) -> f32 {
    let (depth, mask) = (fine.depth(), fine.mask());
    let mut window = [0.0; (WINDOW * WINDOW) as usize];
    let mut count = 0;
    let offset = |step: u32, from: u32| (from + factor * step / 2).wrapping_sub(factor);
    for (a, b) in (0..WINDOW).flat_map(|b| (0..WINDOW).map(move |a| (a, b))) {
        let (a, b) = (offset(a, u), offset(b, v));
        if mask.get(a, b) == Some(true)
            && let Some(z) = depth.get(a, b)
            && z > 0.0
            && counts((a, b))
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
/// pixels outside the mask lack. A third counter would double its instructions.
pub(crate) struct CompareCoarse<'a> {
    pub(crate) grid: &'a CoarseGrid,
    /// The columns and rows that contain the touched pixels.
    pub(crate) touched: [Range<usize>; 2],
    /// Inverse depths, 0 for a pixel that is not touched. Its rows are a [`CoarseGrid::stride`]
    /// apart.
    pub(crate) buffer: &'a mut [f32],
    /// Tolerances per meter.
    pub(crate) per_meter: f32,
    /// Meters behind the measured surface from which on a pixel is hidden.
    pub(crate) hidden_beyond: f32,
}

impl VectorLoop for CompareCoarse<'_> {
    type Output = [u64; 2];

    #[inline(always)]
    fn run(self) -> [u64; 2] {
        #[allow(clippy::cast_possible_truncation)] // A small constant.
        let most = N_TOLERANCES as u32;
        let grid = self.grid;
        let [columns, rows] = self.touched;
        let mut all = [0; 2];
        let mut some = [[0_u32; LANES]; 2];
        let mut pixels = 0;
        for v in rows {
            let row = grid.row(v);
            for u in columns.clone().step_by(LANES) {
                let first = v * grid.stride() + u;
                let Some(buffer) = self.buffer[first..].first_chunk_mut::<LANES>() else {
                    unreachable!("the buffer is padded")
                };
                let inverse = std::mem::replace(buffer, [0.0; LANES]);
                let (measured, weight) = (lanes(&row.measured, u), lanes(&row.weight, u));
                let distance_per_depth = lanes(&row.distance_per_depth, u);
                for lane in 0..LANES {
                    let behind = (1.0 / inverse[lane] - measured[lane]) * distance_per_depth[lane];
                    let touched = all_bits(inverse[lane] > 0.0);
                    let known = all_bits(measured[lane] > 0.0);
                    // A pixel agrees within a tolerance if it differs by less.
                    let beyond = whole((behind.abs() * self.per_meter).min(most as f32));
                    some[0][lane] += touched & known & ((most - beyond) * weight[lane]);
                    let hidden = known & all_bits(behind > self.hidden_beyond);
                    some[1][lane] += touched & !hidden & (grid.one - weight[lane]);
                }
                pixels += LANES;
                if pixels >= MOST_PIXELS {
                    add(&mut all, &std::mem::take(&mut some));
                    pixels = 0;
                }
            }
        }
        add(&mut all, &some);
        all
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

/// Adds sums of lanes to sums.
#[inline(always)]
fn add(all: &mut [u64; 2], some: &[[u32; LANES]; 2]) {
    for (all, lanes) in all.iter_mut().zip(some) {
        *all += lanes.iter().map(|lane| u64::from(*lane)).sum::<u64>();
    }
}

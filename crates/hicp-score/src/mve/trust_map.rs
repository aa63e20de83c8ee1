//! The weights of the pixels of an imperfect mask.

use std::ops::Range;
use std::sync::Arc;

use hicp_core::internal::{Surroundings, median};
use hicp_core::{Observation, PinholeCamera, PixelRegion};

use crate::mve::distances::to_border;
use crate::mve::occlusion::VISIBILITY_TOLERANCE_METERS;
use crate::mve::surfaces::{Cells, trust_surfaces};

/// Width of the uncertain border, as a share of the square root of the mask's area.
const BORDER: f32 = 0.25;

/// Distance outside the mask up to which pixels in front of the background may show the object.
const BEYOND_PIXELS: f32 = 4.0;

/// Smallest step of depth at the border of an object, meters.
const STEP_METERS: f64 = 0.01;

/// Number of cells along the longer side of the grid on which weights are computed.
const SIDE: usize = 128;

/// Smallest share of the trust that the removal of a plane must leave.
const LEAST_KEPT: f32 = 0.15;

/// Share of the weight of a masked pixel without a depth that counts against a pose which does not
/// cover it, if the border of the mask is certain.
const UNCOVERED: f32 = 0.5;

/// The weight of a pixel that certainly shows the object.
pub(crate) const CERTAIN: u8 = 255;

/// The weights of the pixels of a mask.
pub(crate) struct TrustMap {
    /// The mask's box and a border.
    region: PixelRegion,
    /// The weights of the pixels of the region, row by row.
    ///
    /// Masked pixels without a measured depth have the full weight, so that they do not count
    /// against a pose.
    weights: Vec<u8>,
    /// The sum of the weights of measured pixels.
    total: u64,
    /// The share of the weight of masked pixels without a depth that counts against a pose where it
    /// does not cover them.
    uncovered: f32,
    /// Standard deviation of the depth noise, meters.
    noise: f64,
}

impl TrustMap {
    /// Returns the map of an observation for objects of a diameter in meters.
    ///
    /// It is built once and shared. Cost: O(pixels of the mask's box).
    pub(crate) fn of(observation: &Observation, diameter: f64) -> Arc<Self> {
        observation
            .derived()
            .get_or_build(diameter.to_bits(), || Self::new(observation, diameter))
    }

    fn new(observation: &Observation, diameter: f64) -> Self {
        let camera = observation.camera();
        let region = widened(&observation.region(), camera);
        // A coarse grid bounds the cost, which the first score of an observation pays.
        let step = region.width().max(region.height()).div_ceil(SIDE).max(1);
        let width = region.width().div_ceil(step).max(1);
        let (depth, mask) = (observation.depth(), observation.mask());
        let n_cells = width * region.height().div_ceil(step);
        let mut masked = Vec::with_capacity(n_cells);
        let mut depths = Vec::with_capacity(n_cells);
        for columns in rows(&region, depth.width()).step_by(step) {
            masked.extend(mask.pixels()[columns.clone()].iter().step_by(step));
            depths.extend(depth.pixels()[columns].iter().step_by(step));
        }
        let area = masked.iter().filter(|on| **on).count() * step * step;
        let distances = to_border(&masked, width, step as f32);
        let middle = middle_of(&depths, &distances);
        let Surroundings { noise, plane } = *Surroundings::of(observation);
        let grid = Cells {
            width,
            masked: &masked,
            depths: &depths,
        };
        let step_meters = STEP_METERS.max(4.0 * noise);
        let doubt = 1.0 - certainty(&grid, step_meters);
        let beyond = if plane.is_some() {
            doubt * BEYOND_PIXELS
        } else {
            0.0
        };
        let scale = 1.0 / (doubt * BORDER * (area as f32).sqrt() + beyond).max(1.0);
        let near = |z: f32| z > 0.0 && f64::from((z - middle).abs()) <= diameter;
        let distances = distances.iter().zip(&depths);
        let trust = distances.map(|([inside, outside], z)| {
            let ramp = ((inside - outside + beyond) * scale).clamp(0.0, 1.0);
            if near(*z) { ramp * ramp } else { 0.0 }
        });
        let mut trust: Vec<f32> = trust.collect();
        if let Some(plane) = plane {
            let off = plane.off_plane(region.grid(step).zip(depths.iter().copied()), width, step);
            let kept = trust
                .iter()
                .zip(&off)
                .map(|(trust, off)| trust * off)
                .sum::<f32>();
            // An object that is as flat as the plane cannot be separated from it.
            let separable = kept > LEAST_KEPT * trust.iter().sum::<f32>();
            for ((trust, off), on) in trust.iter_mut().zip(&off).zip(&masked) {
                if separable {
                    *trust *= off;
                } else if !on {
                    *trust = 0.0;
                }
            }
            if separable && doubt > 0.0 {
                let stands_out = |cell: usize| if near(depths[cell]) { off[cell] } else { 0.0 };
                #[allow(clippy::cast_possible_truncation)] // f32 is the precision of depths.
                trust_surfaces(&mut trust, &grid, stands_out, step_meters as f32);
            }
        }
        let mut weights = Vec::with_capacity(region.area());
        let mut total = 0;
        let mut trusted = Vec::with_capacity(width * step);
        for (row, columns) in rows(&region, depth.width()).enumerate() {
            if row % step == 0 {
                trusted.clear();
                for trust in &trust[row / step * width..][..width] {
                    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                    // At most 255.
                    let trust = (trust * f32::from(CERTAIN)) as u8;
                    trusted.extend(std::iter::repeat_n(trust, step));
                }
            }
            let masked = mask.pixels()[columns.clone()].iter();
            let pixels = depth.pixels()[columns].iter().zip(masked).zip(&trusted);
            total += pixels
                .clone()
                .map(|((z, _), trusted)| if *z > 0.0 { u64::from(*trusted) } else { 0 })
                .sum::<u64>();
            weights.extend(pixels.map(|((z, masked), trusted)| {
                let unmeasured = if *masked { CERTAIN } else { 0 };
                if *z > 0.0 { *trusted } else { unmeasured }
            }));
        }
        Self {
            region,
            weights,
            total,
            // The corners of a box are background, which may be without depth.
            uncovered: if grid.mask_is_box() {
                0.0
            } else {
                UNCOVERED * (1.0 - doubt)
            },
            noise,
        }
    }

    /// Returns the distance behind the rendered surface from which on the camera sees through it.
    pub(crate) fn seen_through_meters(&self) -> f64 {
        VISIBILITY_TOLERANCE_METERS.max(2.0 * self.noise)
    }

    /// Returns the region outside which weights are 0.
    pub(crate) fn region(&self) -> &PixelRegion {
        &self.region
    }

    /// Returns the sum of the weights of measured pixels.
    pub(crate) fn total(&self) -> u64 {
        self.total
    }

    /// Returns the share of the weight of masked pixels without a depth that counts against a pose
    /// where it does not cover them.
    pub(crate) fn uncovered(&self) -> f32 {
        self.uncovered
    }

    /// Returns the weight of a pixel.
    pub(crate) fn weight(&self, u: u32, v: u32) -> u8 {
        self.region.index(u, v).map_or(0, |i| self.weights[i])
    }

    /// Splits the columns `u..u + width` of a row at the borders of the mask's region.
    ///
    /// Returns the columns of each part, relative to `u`, and its weights.
    pub(crate) fn parts(
        &self,
        v: u32,
        u: u32,
        width: usize,
    ) -> impl Iterator<Item = (Range<usize>, Option<&[u8]>)> {
        let region = &self.region;
        let inside = (region.v_min..region.v_max).contains(&v);
        let column = |edge: u32| (edge.saturating_sub(u) as usize).min(width);
        let (from, to) = if inside {
            (column(region.u_min), column(region.u_max))
        } else {
            (width, width)
        };
        let middle = (from < to).then(|| {
            #[allow(clippy::cast_possible_truncation)] // A column of an image.
            let first = region.index(u + from as u32, v).unwrap_or(0);
            &self.weights[first..first + to - from]
        });
        [(0..from, None), (from..to, middle), (to..width, None)]
            .into_iter()
            .filter(|(columns, _)| !columns.is_empty())
    }
}

/// Returns a share of a weight.
pub(crate) fn share_of(share: f32, weight: u64) -> u64 {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // At most the weight.
    let part = (f64::from(share) * weight as f64) as u64;
    part
}

/// Returns the certainty that the border of the mask is that of the object, 0 to 1.
///
/// It is 1 if the depth has a step of `step_meters`, or is missing, at half of the border or more.
/// A border that is too far outside crosses smooth background.
fn certainty(cells: &Cells<'_>, step_meters: f64) -> f32 {
    let (mut border, mut steps) = (0.0_f32, 0.0_f32);
    cells.for_pairs(|a, b| {
        if cells.masked[a] != cells.masked[b] {
            let (a, b) = (cells.depths[a], cells.depths[b]);
            let step = a <= 0.0 || b <= 0.0 || f64::from((a - b).abs()) > step_meters;
            border += 1.0;
            steps += f32::from(u8::from(step));
        }
    });
    if border > 0.0 {
        (4.0 * steps / border - 1.0).clamp(0.0, 1.0)
    } else {
        1.0
    }
}

/// Widens a region by the border in which pixels outside the mask have a weight.
fn widened(region: &PixelRegion, camera: &PinholeCamera) -> PixelRegion {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // A small constant.
    let border = BEYOND_PIXELS as u32 + 1;
    if region.is_empty() {
        return *region;
    }
    region.grown(border).intersection(&camera.region())
}

/// Returns the places of the pixels of each row of a region in an image of some width.
fn rows(region: &PixelRegion, image_width: u32) -> impl Iterator<Item = Range<usize>> + use<> {
    let PixelRegion { u_min, u_max, .. } = *region;
    (region.v_min..region.v_max).map(move |v| {
        let start = v as usize * image_width as usize;
        start + u_min as usize..start + u_max as usize
    })
}

/// Returns the median depth of the inner half of the mask, meters, from distances to its border.
fn middle_of(depths: &[f32], distances: &[[f32; 2]]) -> f32 {
    let finite = distances.iter().map(|d| d[0]).filter(|d| d.is_finite());
    let inner = 0.5 * finite.fold(0.0, f32::max);
    let pixels = depths.iter().zip(distances);
    let within = pixels.filter(|(z, distance)| **z > 0.0 && distance[0] >= inner.max(1.0));
    let mut inside: Vec<f32> = within.map(|(z, _)| *z).collect();
    median(&mut inside, f32::total_cmp).unwrap_or(f32::INFINITY)
}

//! The weights of the pixels of an imperfect mask.

use std::ops::Range;
use std::sync::Arc;

use hicp_core::internal::{Surroundings, median};
use hicp_core::{Observation, PinholeCamera, PixelRegion, RenderedView};

use crate::mve::cells::{Cells, rows};
use crate::mve::distances::to_border;
use crate::mve::occlusion::VISIBILITY_TOLERANCE_METERS;
use crate::mve::surfaces::trust_surfaces;

/// Width of the uncertain border, as a share of the square root of the mask's area.
const BORDER: f32 = 0.25;

/// Distance outside the mask up to which pixels in front of the background may show the object.
const BEYOND_PIXELS: f32 = 4.0;

/// Smallest step of depth at the border of an object, meters.
const STEP_METERS: f64 = 0.01;

/// Smallest share of the trust that the removal of a plane must leave.
const LEAST_KEPT: f32 = 0.15;

/// Share of the weight of a masked pixel without a depth that counts against a pose which does not
/// cover it, if the border of the mask is certain.
const UNCOVERED: f32 = 0.5;

/// Distance from a mask that was cut to measured pixels within which pixels without a depth do not
/// count.
const CUT_PIXELS: f32 = 10.0;

/// The weight of a pixel that certainly shows the object.
pub(crate) const CERTAIN: u8 = 255;

/// The weights of the pixels of a mask.
pub(crate) struct TrustMap {
    /// The mask's box and a border.
    region: PixelRegion,
    /// The weights of the pixels of the region, row by row.
    ///
    /// Masked pixels without a measured depth have the full weight, so that they do not count
    /// against a pose. So do those near a mask that was cut to measured pixels.
    weights: Vec<u8>,
    /// The sum of the weights of measured pixels.
    total: u64,
    /// The share of the weight of masked pixels without a depth that counts against a pose where it
    /// does not cover them, and these pixels if it is not 0.
    uncovered_share: f32,
    unmeasured: Vec<(u32, u32)>,
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
        let (depth, mask) = (observation.depth(), observation.mask());
        let mut region = widened(&observation.region(), camera, BEYOND_PIXELS + 1.0);
        let mut grid = Cells::of(observation, &region);
        let Surroundings { noise, plane } = *Surroundings::of(observation);
        let step_meters = STEP_METERS.max(4.0 * noise);
        let border = grid.border(step_meters);
        let is_cut = border.is_cut() && is_measured_around(observation, grid.step);
        if is_cut {
            region = widened(&observation.region(), camera, CUT_PIXELS);
            grid = Cells::of(observation, &region);
        }
        let doubt = 1.0 - border.certainty();
        let (width, step) = (grid.width, grid.step);
        let (masked, depths) = (&grid.masked, &grid.depths);
        let area = masked.iter().filter(|on| **on).count() * step * step;
        let distances = to_border(masked, width, step as f32);
        let middle = middle_of(depths, &distances);
        let beyond = if plane.is_some() {
            doubt * BEYOND_PIXELS
        } else {
            0.0
        };
        let scale = 1.0 / (doubt * BORDER * (area as f32).sqrt() + beyond).max(1.0);
        let near = |z: f32| z > 0.0 && f64::from((z - middle).abs()) <= diameter;
        let trust = distances.iter().zip(depths).map(|([inside, outside], z)| {
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
            for ((trust, off), on) in trust.iter_mut().zip(&off).zip(masked) {
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
        // The corners of a box are background, which may be without depth.
        let uncovered_share = if is_cut || grid.mask_is_box() {
            0.0
        } else {
            UNCOVERED * (1.0 - doubt)
        };
        let (mut total, mut unmeasured) = (0, Vec::new());
        let mut trusted = Vec::with_capacity(width * step);
        for ((row, columns), v) in rows(&region, depth.width()).enumerate().zip(region.v_min..) {
            if row % step == 0 {
                trusted.clear();
                for trust in &trust[row / step * width..][..width] {
                    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                    // At most 255.
                    let trust = (trust * f32::from(CERTAIN)) as u8;
                    trusted.extend(std::iter::repeat_n(trust, step));
                }
            }
            let to_mask = &distances[row / step * width..][..width];
            let is_edge = |column: usize| is_cut && to_mask[column / step][1] <= CUT_PIXELS;
            let masked = mask.pixels()[columns.clone()].iter();
            let pixels = depth.pixels()[columns].iter().zip(masked).zip(&trusted);
            let pixels = pixels.enumerate().zip(region.u_min..);
            weights.extend(pixels.map(|((column, ((z, masked), trusted)), u)| {
                if *z > 0.0 {
                    total += u64::from(*trusted);
                    *trusted
                } else if *masked || is_edge(column) {
                    if uncovered_share > 0.0 {
                        unmeasured.push((u, v));
                    }
                    CERTAIN
                } else {
                    0
                }
            }));
        }
        Self {
            region,
            weights,
            total,
            uncovered_share,
            unmeasured,
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
    pub(crate) fn uncovered_share(&self) -> f32 {
        self.uncovered_share
    }

    /// Returns the weight with which masked pixels without a depth count against a render.
    pub(crate) fn uncovered(&self, view: &RenderedView) -> u64 {
        let pixels = self.unmeasured.iter();
        let missed = pixels.filter(|(u, v)| view.depth_at(*u, *v) <= 0.0).count();
        share_of(self.uncovered_share, missed as u64 * u64::from(CERTAIN))
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

/// Returns whether most pixels some way around the box of the mask are measured.
///
/// Then pixels without a depth along the mask are a band, and not the whole background.
fn is_measured_around(observation: &Observation, step: usize) -> bool {
    let (region, camera) = (observation.region(), observation.camera());
    let [inner, outer] = [1.0, 2.4].map(|bands| widened(&region, camera, bands * CUT_PIXELS));
    let (mut all, mut measured) = (0_usize, 0_usize);
    for (u, v) in outer.grid(step) {
        if inner.index(u, v).is_none() {
            all += 1;
            measured += usize::from(observation.depth().get(u, v).is_some_and(|z| z > 0.0));
        }
    }
    2 * measured > all
}

/// Widens a region by a border in pixels, in which pixels outside the mask have a weight.
fn widened(region: &PixelRegion, camera: &PinholeCamera, border: f32) -> PixelRegion {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // A small number.
    let border = border as u32;
    if region.is_empty() {
        return *region;
    }
    region.grown(border).intersection(&camera.region())
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

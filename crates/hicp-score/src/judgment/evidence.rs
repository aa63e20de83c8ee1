//! The evidence for and against a pose, and the quality of the mask.

use hicp_core::{Context, Isometry3, Observation, RenderedView};

use crate::judgment::grid::{Cell, Grid};

/// Share of the diameter within which the measured and the rendered surface agree.
const AGREES: f32 = 0.1;
/// Number of bins of the medians, and the share of the diameter that they cover.
const BINS: usize = 100;
const COVERED: f32 = 0.5;

/// The evidence for and against a pose, from one render.
///
/// The first five shares concern the rendered pixels and add up to 1. The model's pixels *agree*
/// with the image, or they *contradict* it, or the image tells nothing about them:
///
/// | field | the measured surface |
/// |---|---|
/// | [`agrees`](Self::agrees) | is within 10 % of the diameter of the rendered one |
/// | [`seen_through`](Self::seen_through) | is farther: the camera looks through the object |
/// | [`inside`](Self::inside) | is nearer, and continues an agreeing one: the object is in it |
/// | [`hidden`](Self::hidden) | is nearer, and ends in a step: something stands in front |
/// | [`unmeasured`](Self::unmeasured) | is missing |
///
/// The other fields describe what the mask shows besides the model, how accurate the agreement is,
/// and how well the mask fits the silhouette. A hidden or unmeasured pixel is never evidence for a
/// pose.
///
/// Distances are along the optical axis, as shares of the model's diameter. All numbers are
/// estimates from a grid of at most 4,096 pixels. Without a rendered pixel, every share of them is
/// 0.
///
/// ```
/// use hicp_score::Evidence;
/// fn doubtful(evidence: &Evidence) -> bool {
///     evidence.contradicts() > 0.2 || evidence.hidden > 0.6
/// }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Evidence {
    /// Number of rendered pixels.
    pub pixels: usize,
    /// Share of the rendered pixels at which the measured surface is the rendered one.
    pub agrees: f64,
    /// Share of the rendered pixels that the camera sees through.
    pub seen_through: f64,
    /// Share of the rendered pixels that lie inside a measured surface, such as a table.
    pub inside: f64,
    /// Share of the rendered pixels that a nearer surface hides.
    pub hidden: f64,
    /// Share of the rendered pixels without a measured depth.
    pub unmeasured: f64,
    /// Share of the measured pixels of the mask at which the model is not rendered, or does not
    /// agree.
    pub unexplained: f64,
    /// Median distance between the surfaces where the camera sees both, at most 0.5 diameters.
    ///
    /// Includes pixels that the camera sees through, but none that are hidden.
    pub residual: f64,
    /// Median distance of a measured pixel from the mean of its neighbors: the noise of the sensor.
    ///
    /// At a right pose, `residual` is not much larger.
    pub noise: f64,
    /// Share of the visible contour at which the measured surface ends.
    ///
    /// At a contour pixel, the measured surface one step outside is farther or nearer than the
    /// rendered one. A contour in the middle of a wall has a share near 0.
    pub contour: f64,
    /// Share of the measured pixels of the mask outside the silhouette: the mask is too large.
    pub mask_extra: f64,
    /// Share of the agreeing pixels outside the mask: the mask is too small.
    pub mask_missing: f64,
    /// The mean distance between the borders of the mask and the silhouette, pixels.
    ///
    /// Positive if the mask is too large, negative if it is too small. It has a meaning only near
    /// the true pose.
    pub mask_growth_pixels: f64,
}

impl Evidence {
    /// Measures the evidence at a pose, or returns `None` if the problem has no model or no image.
    ///
    /// Cost: one render (shared with other components that use this pose), at most 4,096 pixels,
    /// and about 20 µs. Allocates nothing.
    #[must_use]
    pub fn at(context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> Option<Self> {
        let (model, observation) = context.problem.sides()?;
        let view = context.view(camera_from_object)?;
        Some(Self::of(observation, view, model.diameter()))
    }

    /// Returns the share of the rendered pixels that contradict the pose.
    #[must_use]
    pub fn contradicts(&self) -> f64 {
        self.seen_through + self.inside
    }

    /// Returns the numbers with the names of their fields, for tables and files.
    #[must_use]
    pub fn named(&self) -> [(&'static str, f64); 13] {
        [
            ("pixels", self.pixels as f64),
            ("agrees", self.agrees),
            ("seen_through", self.seen_through),
            ("inside", self.inside),
            ("hidden", self.hidden),
            ("unmeasured", self.unmeasured),
            ("unexplained", self.unexplained),
            ("residual", self.residual),
            ("noise", self.noise),
            ("contour", self.contour),
            ("mask_extra", self.mask_extra),
            ("mask_missing", self.mask_missing),
            ("mask_growth_pixels", self.mask_growth_pixels),
        ]
    }

    /// Returns the share of the nearer measured surfaces that contain the object.
    pub(crate) fn inside_share(&self) -> f64 {
        let nearer = self.inside + self.hidden;
        if nearer > 0.0 {
            self.inside / nearer
        } else {
            0.0
        }
    }

    pub(crate) fn of(observation: &Observation, view: &RenderedView, diameter: f64) -> Self {
        #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
        let diameter = diameter as f32;
        let mut grid = Grid::new(observation, view, AGREES * diameter);
        grid.find_insides();
        let area = (grid.step() * grid.step()) as f64;
        let mut count = [0_usize; Cell::KINDS];
        let (mut masked, mut explained, mut missing) = (0_usize, 0_usize, 0_usize);
        let mut residuals = Median::default();
        let mut noise = Median::default();
        let (mut contour, mut supported, mut outline) = (0_usize, 0_usize, 0_usize);
        for (index, cell) in grid.rendered() {
            count[cell as usize] += 1;
            let (in_mask, agrees) = (grid.masked(index), cell == Cell::Agrees);
            masked += usize::from(in_mask && cell != Cell::Unmeasured);
            explained += usize::from(in_mask && agrees);
            missing += usize::from(!in_mask && agrees);
            if agrees || cell == Cell::SeenThrough {
                residuals.add(grid.gap(index) / diameter);
            }
            if agrees && let Some(roughness) = grid.roughness(observation, index) {
                noise.add(roughness / diameter);
            }
            let (edges, ends, compared) = grid.contour(index);
            outline += edges;
            if agrees {
                contour += compared;
                supported += ends;
            }
        }
        let rendered = count.iter().sum::<usize>();
        let share = |n: usize, of: usize| n as f64 / of.max(1) as f64;
        let of_mask = |n: usize| {
            let all = observation.n_measured() as f64;
            if all > 0.0 {
                (1.0 - n as f64 * area / all).clamp(0.0, 1.0)
            } else {
                0.0
            }
        };
        let agreeing = count[Cell::Agrees as usize];
        let extra = observation.n_measured() as f64 - masked as f64 * area;
        // A line at a random angle crosses 4/π pixel borders per pixel of its length.
        let length = outline as f64 * grid.step() as f64 * std::f64::consts::FRAC_PI_4;
        Self {
            pixels: rendered * grid.step().pow(2),
            agrees: share(agreeing, rendered),
            seen_through: share(count[Cell::SeenThrough as usize], rendered),
            inside: share(count[Cell::Inside as usize], rendered),
            hidden: share(count[Cell::Hidden as usize], rendered),
            unmeasured: share(count[Cell::Unmeasured as usize], rendered),
            unexplained: of_mask(explained),
            residual: residuals.get(),
            noise: noise.get(),
            contour: share(supported, contour),
            mask_extra: of_mask(masked),
            mask_missing: share(missing, agreeing),
            mask_growth_pixels: if length > 0.0 {
                (extra - missing as f64 * area) / length
            } else {
                0.0
            },
        }
    }
}

/// A median of shares of the diameter, from a histogram.
pub(crate) struct Median {
    bins: [u32; BINS],
    count: u32,
}

impl Default for Median {
    fn default() -> Self {
        Self {
            bins: [0; BINS],
            count: 0,
        }
    }
}

impl Median {
    pub(crate) fn add(&mut self, value: f32) {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // Saturates; NaN is 0.
        let bin = (value.abs() * (BINS as f32 / COVERED)) as usize;
        self.bins[bin.min(BINS - 1)] += 1;
        self.count += 1;
    }

    /// Returns the median, interpolated within its bin; 0 without values.
    pub(crate) fn get(&self) -> f64 {
        let half = f64::from(self.count) / 2.0;
        let mut below = 0.0;
        for (bin, count) in self.bins.iter().enumerate() {
            let count = f64::from(*count);
            if count > 0.0 && below + count >= half {
                let place = bin as f64 + (half - below) / count;
                return place * f64::from(COVERED) / BINS as f64;
            }
            below += count;
        }
        0.0
    }
}

//! The evidence for and against a pose, and the quality of the mask.

use hicp_core::{Context, Isometry3};

use crate::judgment::grid::{Cell, Grid};
use crate::judgment::insides::find_insides;
use crate::judgment::median::{Median, Scale};

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
    /// rendered one. A contour in the middle of a wall has a share near 0. `None` if nothing was
    /// measured next to the agreeing pixels of the contour.
    pub contour: Option<f64>,
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
        let mut grid = Grid::new(model.diameter());
        grid.compare(observation, view);
        find_insides(&mut grid);
        Some(Self::of(&grid))
    }

    /// Returns the share of the rendered pixels that contradict the pose.
    #[must_use]
    pub fn contradicts(&self) -> f64 {
        self.seen_through + self.inside
    }

    /// Returns the numbers with the names of their fields, for tables and files.
    ///
    /// A `contour` of `None` is NaN.
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
            ("contour", self.contour.unwrap_or(f64::NAN)),
            ("mask_extra", self.mask_extra),
            ("mask_missing", self.mask_missing),
            ("mask_growth_pixels", self.mask_growth_pixels),
        ]
    }

    pub(crate) fn of(grid: &Grid) -> Self {
        let area = (grid.step * grid.step) as f64;
        // Of the pixels outside and inside the mask.
        let mut counts = [[0_usize; Cell::KINDS]; 2];
        let mut residuals = Median::new();
        let scale = Scale::new(grid.diameter);
        for index in grid.rendered.iter() {
            let cell = grid.cells[index];
            counts[usize::from(grid.masked[index])][cell as usize] += 1;
            if matches!(cell, Cell::Agrees | Cell::SeenThrough) {
                residuals.add(scale.bin(grid.gap[index]));
            }
        }
        let contour = Contour::of(grid);
        let count = |cell: Cell| counts[0][cell as usize] + counts[1][cell as usize];
        let rendered = counts.iter().flatten().sum::<usize>();
        let agreeing = count(Cell::Agrees);
        let [missing, explained] = counts.map(|count| count[Cell::Agrees as usize]);
        let masked = counts[1].iter().sum::<usize>() - counts[1][Cell::Unmeasured as usize];
        let share = |n: usize, of: usize| n as f64 / of.max(1) as f64;
        let all = grid.n_measured;
        let of_mask = |n: usize| {
            if all > 0.0 {
                (1.0 - n as f64 * area / all).clamp(0.0, 1.0)
            } else {
                0.0
            }
        };
        let extra = all - masked as f64 * area;
        // A line at a random angle crosses 4/π pixel borders per pixel of its length.
        let length = (contour.sides * grid.step) as f64 * std::f64::consts::FRAC_PI_4;
        Self {
            pixels: rendered * grid.step.pow(2),
            agrees: share(agreeing, rendered),
            seen_through: share(count(Cell::SeenThrough), rendered),
            inside: share(count(Cell::Inside), rendered),
            hidden: share(count(Cell::Hidden), rendered),
            unmeasured: share(count(Cell::Unmeasured), rendered),
            unexplained: of_mask(explained),
            residual: residuals.get(),
            noise: grid.noise.get(),
            contour: (contour.compared > 0).then(|| share(contour.ends, contour.compared)),
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

/// The sides of cells at the silhouette.
#[derive(Default)]
struct Contour {
    sides: usize,
    /// Sides of agreeing cells with a measurement outside.
    compared: usize,
    /// Compared sides at which the measured surface ends.
    ends: usize,
}

impl Contour {
    fn of(grid: &Grid) -> Self {
        let mut contour = Self::default();
        for index in grid.rim.iter() {
            let agrees = grid.cells[index] == Cell::Agrees;
            let rendered = grid.gap[index] + grid.measured[index];
            for other in Grid::neighbors(index) {
                if !grid.cells[other].is_rendered() {
                    contour.sides += 1;
                    let measured = grid.measured[other];
                    if agrees && measured > 0.0 {
                        contour.compared += 1;
                        let ends = (measured - rendered).abs() > grid.tolerance();
                        contour.ends += usize::from(ends);
                    }
                }
            }
        }
        contour
    }
}

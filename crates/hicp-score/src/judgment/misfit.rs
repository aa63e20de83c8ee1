//! The disagreement of a pose with the image beyond the noise of the sensor.

use hicp_core::{Context, Isometry3};

use crate::judgment::grid::{Cell, Grid, SIDE};

/// Median of the distance from the mean of two neighbors, per standard deviation of the noise.
const ROUGHNESS_PER_SIGMA: f64 = 0.826;
/// Shares of the diameter that may separate the surfaces, and the standard deviations on top.
const FINE: (f64, f64) = (0.03, 2.0);
const RIM: (f64, f64) = (0.05, 2.0);
const NEAR: (f64, f64) = (0.15, 3.0);
const COARSE: (f64, f64) = (0.3, 2.0);
/// Distance, in cells, over which the noise of two pixels is independent.
const LAG: isize = 2;
/// Parts along each side of the rendered region.
const PARTS: usize = 8;
/// Fewest compared cells of a part.
const LEAST_CELLS: u32 = 8;

/// The disagreement of a pose with the image that the noise does not explain.
///
/// [`Evidence`](crate::Evidence) counts pixels within fixed tolerances. Here the tolerances grow
/// with the noise, which is estimated from neighboring pixels: at a right pose every number but
/// `sigma` is near 0 with any sensor. A model of similar shape differs by a few percent of the
/// diameter, which `systematic`, `rim_ahead` and `rim_open` show.
///
/// Distances are along the optical axis, as shares of the model's diameter. All numbers are
/// estimates from a grid of at most 4,096 pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Misfit {
    /// Standard deviation of the noise.
    pub sigma: f64,
    /// Root mean square of the distance between the surfaces, without the noise of single pixels.
    ///
    /// It comes from products of the distances at pixels two cells apart, whose noise is
    /// independent.
    pub systematic: f64,
    /// Mean distance between the surfaces; positive if the measured one is farther.
    pub bias: f64,
    /// Share of the compared pixels that the camera sees through.
    pub ahead: f64,
    /// Share of the pixels along the inside of the silhouette that the camera sees through.
    pub rim_ahead: f64,
    /// Share of the pixels along the outside of the silhouette at which the surface continues.
    pub rim_open: f64,
    /// Share of the parts of an 8 × 8 division of the region in which most pixels disagree.
    pub weak: f64,
    /// Share of the measured pixels of the mask that no rendered pixel explains, even coarsely.
    pub unexplained: f64,
}

impl Misfit {
    /// Measures the misfit at a pose, or returns `None` if the problem has no model or no image.
    ///
    /// Cost: one render (shared with other components that use this pose) and about 30 µs.
    /// Allocates nothing.
    #[must_use]
    pub fn at(context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> Option<Self> {
        let (model, observation) = context.problem.sides()?;
        let view = context.view(camera_from_object)?;
        let mut grid = Grid::new(model.diameter());
        grid.compare(observation, view);
        Some(Self::of(&grid))
    }

    pub(crate) fn of(grid: &Grid) -> Self {
        let sigma = grid.noise_in_mask.get() / ROUGHNESS_PER_SIGMA;
        let diameter = f64::from(grid.diameter);
        #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
        let limit = |(share, sigmas): (f64, f64)| ((share + sigmas * sigma) * diameter) as f32;
        let [fine, rim, near, coarse] = [FINE, RIM, NEAR, COARSE].map(limit);
        // The gap of a pixel that is not compared is NaN, which is below no limit.
        let fits = |index: usize| grid.masked[index] & (grid.gap[index].abs() < near);

        let mut ahead = Share::default();
        let mut explained = 0_usize;
        let (mut sum, mut count) = (0.0, 0_usize);
        let (mut products, mut pairs) = (0.0, 0_usize);
        let mut parts = [[(0_u32, 0_u32); PARTS]; PARTS];
        let (of_row, of_column) = (part_of(grid.height), part_of(grid.width));
        for index in grid.rendered.iter() {
            let (gap, masked) = (grid.gap[index], grid.masked[index]);
            if gap.is_nan() {
                continue;
            }
            if gap <= fine || masked {
                ahead.add(gap < -fine);
            }
            explained += usize::from(masked & (gap.abs() < coarse));
            let fitting = fits(index);
            if masked || gap < near {
                let (row, column) = Grid::place(index);
                let part = &mut parts[of_row[row]][of_column[column]];
                *part = (part.0 + 1, part.1 + u32::from(fitting));
            }
            if fitting {
                let gap = f64::from(gap);
                sum += gap;
                count += 1;
                for side in [Grid::SIDES[0], Grid::SIDES[2]] {
                    let other = Grid::offset(index, LAG * side);
                    if fits(other) {
                        products += gap * f64::from(grid.gap[other]);
                        pairs += 1;
                    }
                }
            }
        }
        let around = Rim::of(grid, rim);
        let compared = parts
            .iter()
            .flatten()
            .filter(|(all, _)| *all >= LEAST_CELLS);
        let mut weak = Share::default();
        compared.for_each(|(all, agree)| weak.add(2 * agree < *all));
        let area = (grid.step * grid.step) as f64;
        let all = grid.n_measured.max(1.0);
        Self {
            sigma,
            systematic: (products / pairs.max(1) as f64).max(0.0).sqrt() / diameter,
            bias: -sum / count.max(1) as f64 / diameter,
            ahead: ahead.get(),
            rim_ahead: around.ahead.get(),
            rim_open: around.open.get(),
            weak: weak.get(),
            unexplained: (1.0 - explained as f64 * area / all).clamp(0.0, 1.0),
        }
    }
}

/// A share of a count.
#[derive(Clone, Copy, Default)]
struct Share {
    of: u32,
    count: u32,
}

impl Share {
    fn add(&mut self, counts: bool) {
        self.of += 1;
        self.count += u32::from(counts);
    }

    /// Returns the share; 0 without a count.
    fn get(self) -> f64 {
        f64::from(self.count) / f64::from(self.of.max(1))
    }
}

/// The pixels along both sides of the silhouette.
#[derive(Default)]
struct Rim {
    ahead: Share,
    open: Share,
}

impl Rim {
    /// Compares the pixels around the silhouette with a tolerance in meters.
    fn of(grid: &Grid, tolerance: f32) -> Self {
        let mut rim = Self::default();
        for index in grid.rim.iter().filter(|index| !grid.gap[*index].is_nan()) {
            let rendered = grid.measured[index] + grid.gap[index];
            for side in Grid::SIDES {
                if grid.cells[Grid::offset(index, side)] != Cell::Empty {
                    continue;
                }
                for inner in [0, -1].map(|steps| Grid::offset(index, steps * side)) {
                    let gap = grid.gap[inner];
                    if grid.cells[inner].is_rendered() && gap <= tolerance {
                        rim.ahead.add(gap < -tolerance);
                    }
                }
                for outer in [2, 3].map(|steps| Grid::offset(index, steps * side)) {
                    let measured = grid.measured[outer];
                    let step = measured - rendered;
                    if grid.cells[outer] == Cell::Empty && measured > 0.0 && step >= -tolerance {
                        rim.open.add(step <= tolerance);
                    }
                }
            }
        }
        rim
    }
}

/// Returns the part of each row or column of a grid of `size` cells.
fn part_of(size: usize) -> [usize; SIDE] {
    std::array::from_fn(|place| (place * PARTS / size.max(1)).min(PARTS - 1))
}

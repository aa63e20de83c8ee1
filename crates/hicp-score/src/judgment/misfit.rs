//! The disagreement of a pose with the image beyond the noise of the sensor.

use hicp_core::{Context, Isometry3, Observation, RenderedView};

use crate::judgment::evidence::Median;
use crate::judgment::grid::{Cell, Grid};

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

/// The disagreement of a pose with the image, as far as the noise does not explain it.
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
    /// Root mean square of the distance between the surfaces that nearby pixels have in common.
    pub systematic: f64,
    /// Mean distance between the surfaces; positive if the measured one is farther.
    pub bias: f64,
    /// Share of the compared pixels that the camera sees through.
    pub ahead: f64,
    /// Share of the pixels along the inside of the silhouette that the camera sees through.
    pub rim_ahead: f64,
    /// Share of the pixels along the outside of the silhouette at which the surface continues.
    pub rim_open: f64,
    /// Share of 64 parts of the rendered region in which less than half of the pixels agree.
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
        Some(Self::of(observation, view, model.diameter()))
    }

    fn of(observation: &Observation, view: &RenderedView, diameter: f64) -> Self {
        #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
        let grid = Grid::new(observation, view, (NEAR.0 * diameter) as f32);
        let mut noise = Median::default();
        for (index, cell) in grid.rendered() {
            if grid.masked(index)
                && cell != Cell::Unmeasured
                && let Some(roughness) = grid.roughness(observation, index)
            {
                #[allow(clippy::cast_possible_truncation)]
                noise.add(roughness / diameter as f32);
            }
        }
        let sigma = noise.get() / ROUGHNESS_PER_SIGMA;
        let limit = |(share, sigmas): (f64, f64)| share + sigmas * sigma;
        let [fine, rim, near, coarse] = [FINE, RIM, NEAR, COARSE].map(limit);
        let behind = |index: usize| f64::from(grid.gap(index)) / diameter;

        let (mut ahead, mut rim_ahead, mut rim_open) = <[Share; 3]>::default().into();
        let mut explained = 0_usize;
        let (mut sum, mut count) = (0.0, 0_usize);
        let (mut products, mut pairs) = (0.0, 0_usize);
        let mut parts = [(0_u32, 0_u32); PARTS * PARTS];
        for (index, cell) in grid.rendered() {
            if cell == Cell::Unmeasured {
                continue;
            }
            let (gap, masked) = (behind(index), grid.masked(index));
            if gap <= fine || masked {
                ahead.add(gap < -fine);
            }
            explained += usize::from(masked && gap.abs() < coarse);
            let fits = masked && gap.abs() < near;
            if masked || gap < near {
                let part = &mut parts[grid.part(index, PARTS)];
                *part = (part.0 + 1, part.1 + u32::from(fits));
            }
            if fits {
                sum += gap;
                count += 1;
                for (right, down) in [(LAG, 0), (0, LAG)] {
                    let other = grid.offset(index, right, down).filter(|other| {
                        grid.is_compared(*other)
                            && grid.masked(*other)
                            && behind(*other).abs() < near
                    });
                    if let Some(other) = other {
                        products += gap * behind(other);
                        pairs += 1;
                    }
                }
            }
            for (right, down) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
                let outside = |steps: isize| {
                    let other = grid.offset(index, right * steps, down * steps)?;
                    (!grid.is_rendered(other)).then_some(other)
                };
                if outside(1).is_none() {
                    continue;
                }
                let inside = [0, 1].map(|steps| grid.offset(index, -right * steps, -down * steps));
                for inner in inside.into_iter().flatten() {
                    if grid.is_compared(inner) && behind(inner) <= rim {
                        rim_ahead.add(behind(inner) < -rim);
                    }
                }
                for outer in [2, 3].into_iter().filter_map(outside) {
                    let step = f64::from(grid.measured(outer)) / diameter
                        - f64::from(grid.measured(index)) / diameter
                        - gap;
                    if grid.measured(outer) > 0.0 && step >= -rim {
                        rim_open.add(step <= rim);
                    }
                }
            }
        }
        let compared = parts.iter().filter(|(all, _)| *all >= LEAST_CELLS);
        let mut weak = Share::default();
        compared.for_each(|(all, agree)| weak.add(2 * agree < *all));
        let area = (grid.step() * grid.step()) as f64;
        let all = (observation.n_measured() as f64).max(1.0);
        Self {
            sigma,
            systematic: (products / pairs.max(1) as f64).max(0.0).sqrt(),
            bias: -sum / count.max(1) as f64,
            ahead: ahead.get(),
            rim_ahead: rim_ahead.get(),
            rim_open: rim_open.get(),
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

//! A mask and the depth around it, on a coarse grid.

use std::ops::Range;

use hicp_core::{Observation, PixelRegion};

/// Number of cells along the longer side of the grid.
const SIDE: usize = 128;

/// Share of the border of a cut mask outside of which the depth is missing, at least.
const LEAST_OUTSIDE: f32 = 0.5;
/// The same inside of it, relative to the share outside, at most.
const MOST_INSIDE: f32 = 0.3;

/// The cells of a mask and its surroundings, row by row.
pub(crate) struct Cells {
    /// Number of columns, at least 1.
    pub(crate) width: usize,
    /// The distance between cells, pixels.
    pub(crate) step: usize,
    pub(crate) masked: Vec<bool>,
    /// Measured depth, meters.
    pub(crate) depths: Vec<f32>,
}

impl Cells {
    /// Returns the cells of a region.
    ///
    /// A coarse grid bounds the cost, which the first score of an observation pays.
    pub(crate) fn of(observation: &Observation, region: &PixelRegion) -> Self {
        let step = region.width().max(region.height()).div_ceil(SIDE).max(1);
        let width = region.width().div_ceil(step).max(1);
        let (depth, mask) = (observation.depth(), observation.mask());
        let count = width * region.height().div_ceil(step);
        let mut masked = Vec::with_capacity(count);
        let mut depths = Vec::with_capacity(count);
        for columns in rows(region, depth.width()).step_by(step) {
            masked.extend(mask.pixels()[columns.clone()].iter().step_by(step));
            depths.extend(depth.pixels()[columns].iter().step_by(step));
        }
        Self {
            width,
            step,
            masked,
            depths,
        }
    }

    /// Counts the pairs of neighbors along the border of the mask.
    ///
    /// A step in depth is larger than `step_meters`.
    pub(crate) fn border(&self, step_meters: f64) -> Border {
        let count = |condition: bool| f32::from(u8::from(condition));
        let mut border = Border::default();
        self.for_pairs(|a, b| {
            if self.masked[a] != self.masked[b] {
                let (inside, outside) = if self.masked[a] { (a, b) } else { (b, a) };
                let (inside, outside) = (self.depths[inside], self.depths[outside]);
                let missing = [inside <= 0.0, outside <= 0.0];
                let step = f64::from((inside - outside).abs()) > step_meters;
                border.length += 1.0;
                border.ends += count(missing[0] || missing[1] || step);
                border.missing_inside += count(missing[0]);
                border.missing_outside += count(missing[1]);
            }
        });
        border
    }

    /// Returns whether the mask is a rectangle.
    pub(crate) fn mask_is_box(&self) -> bool {
        let rows = self.masked.chunks(self.width);
        let mut rows = rows.filter(|row| row.contains(&true));
        let Some(first) = rows.next() else {
            return false;
        };
        let mut after = first.iter().skip_while(|on| !**on).skip_while(|on| **on);
        after.all(|on| !on) && rows.all(|row| row == first)
    }

    /// Calls a function with the pairs of neighbors, each once.
    #[inline(always)]
    pub(crate) fn for_pairs(&self, mut call: impl FnMut(usize, usize)) {
        let (width, cells) = (self.width, self.masked.len());
        for first in (0..cells).step_by(width) {
            for cell in first..first + width - 1 {
                call(cell, cell + 1);
            }
        }
        for cell in width..cells {
            call(cell - width, cell);
        }
    }
}

/// Returns the places of the pixels of each row of a region in an image of some width.
pub(crate) fn rows(
    region: &PixelRegion,
    image_width: u32,
) -> impl Iterator<Item = Range<usize>> + use<> {
    let PixelRegion { u_min, u_max, .. } = *region;
    (region.v_min..region.v_max).map(move |v| {
        let start = v as usize * image_width as usize;
        start + u_min as usize..start + u_max as usize
    })
}

/// The numbers of pairs of neighbors along the border of a mask.
#[derive(Default)]
pub(crate) struct Border {
    length: f32,
    /// Pairs with a step in depth, or without a depth.
    ends: f32,
    /// Pairs without a depth inside and outside of the mask.
    missing_inside: f32,
    missing_outside: f32,
}

impl Border {
    /// Returns the certainty that the border of the mask is that of the object, 0 to 1.
    ///
    /// It is 1 if the depth has a step, or is missing, at half of the border or more. A border that
    /// is too far outside crosses smooth background.
    pub(crate) fn certainty(&self) -> f32 {
        if self.length > 0.0 {
            (4.0 * self.ends / self.length - 1.0).clamp(0.0, 1.0)
        } else {
            1.0
        }
    }

    /// Returns whether the mask seems to be cut to the pixels with a depth.
    ///
    /// Most pixels along its border have no depth outside of it, and most have one inside.
    pub(crate) fn is_cut(&self) -> bool {
        self.missing_outside > LEAST_OUTSIDE * self.length
            && self.missing_inside < MOST_INSIDE * self.missing_outside
    }
}

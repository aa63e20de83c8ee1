//! The pixels that a judgment compares, on a grid over the rendered region.

use hicp_core::{Observation, RenderedView};

use crate::judgment::median::{Median, Scale};

/// Largest number of cells along each side of the grid.
pub(crate) const SIDE: usize = 64;
/// Cells around the grid, so that neighbors need no test for its border.
const MARGIN: usize = 3;
const STRIDE: usize = SIDE + 2 * MARGIN;
pub(crate) const CELLS: usize = STRIDE * STRIDE;
/// Share of the diameter within which the measured and the rendered surface agree.
const AGREES: f32 = 0.1;

/// The relation of the measured to the rendered surface at a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cell {
    Agrees,
    SeenThrough,
    Inside,
    Hidden,
    Unmeasured,
    /// The model is not rendered.
    Empty,
    /// Not in the rendered region.
    Beyond,
}

impl Cell {
    /// Number of kinds; rendered cells have the first ones.
    pub(crate) const KINDS: usize = 7;

    /// Returns whether the model is rendered.
    pub(crate) fn is_rendered(self) -> bool {
        (self as usize) < Self::Empty as usize
    }
}

/// The compared pixels.
pub(crate) struct Grid {
    /// The relation of the surfaces at each cell.
    pub(crate) cells: [Cell; CELLS],
    /// Measured depth, meters; 0 if it is missing.
    pub(crate) measured: [f32; CELLS],
    /// Rendered minus measured depth, meters; NaN if one is missing.
    pub(crate) gap: [f32; CELLS],
    pub(crate) masked: [bool; CELLS],
    pub(crate) rendered: Indices,
    /// The rendered cells with a neighbor that is not rendered.
    pub(crate) rim: Indices,
    /// Distances of measured pixels from the mean of their neighbors in the row, in diameters: of
    /// agreeing pixels, and of the rendered pixels of the mask.
    pub(crate) noise: Median,
    pub(crate) noise_in_mask: Median,
    /// `true` if a cell is behind a measured surface.
    pub(crate) has_hidden: bool,
    /// Number of measured pixels of the mask.
    pub(crate) n_measured: f64,
    /// Numbers of columns and rows.
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// The distance between cells, pixels.
    pub(crate) step: usize,
    /// The diameter of the model, meters.
    pub(crate) diameter: f32,
    /// Width of a cell per meter of distance.
    pub(crate) spread: f32,
}

impl Grid {
    /// The steps to the neighbors of a cell: right, left, down, up.
    pub(crate) const SIDES: [isize; 4] = [1, -1, STRIDE.cast_signed(), -STRIDE.cast_signed()];

    /// Creates a grid without cells, for a diameter in meters.
    pub(crate) fn new(diameter: f64) -> Self {
        #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
        let diameter = diameter as f32;
        // A literal is written in place; a returned variable would be copied.
        Self {
            cells: [Cell::Beyond; CELLS],
            measured: [0.0; CELLS],
            gap: [0.0; CELLS],
            masked: [false; CELLS],
            rendered: Indices::NONE,
            rim: Indices::NONE,
            noise: Median::new(),
            noise_in_mask: Median::new(),
            has_hidden: false,
            n_measured: 0.0,
            width: 0,
            height: 0,
            step: 1,
            diameter,
            spread: 0.0,
        }
    }

    /// Compares a render with an observation.
    ///
    /// Cells behind a measured surface are hidden until `insides` separates them.
    pub(crate) fn compare(&mut self, observation: &Observation, view: &RenderedView) {
        let region = view.region();
        let camera = observation.camera();
        let step = region.width().max(region.height()).div_ceil(SIDE).max(1);
        let image_width = camera.width() as usize;
        let (depth, mask) = (observation.depth().pixels(), observation.mask().pixels());
        self.n_measured = observation.n_measured() as f64;
        self.width = region.width().div_ceil(step);
        self.height = region.height().div_ceil(step);
        self.step = step;
        #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
        let focal_length = camera.fx().min(camera.fy()) as f32;
        self.spread = step as f32 / focal_length;
        let (tolerance, scale) = (self.tolerance(), Scale::new(self.diameter));
        for row in 0..self.height {
            let rendered = &view.depth()[row * step * region.width()..][..region.width()];
            let start = (region.v_min as usize + row * step) * image_width;
            let (depth, mask) = (
                &depth[start..][..image_width],
                &mask[start..][..image_width],
            );
            let first = (row + MARGIN) * STRIDE + MARGIN;
            let columns = (region.u_min as usize..).step_by(step);
            for ((index, u), z) in (first..).zip(columns).zip(rendered.iter().step_by(step)) {
                let measured = depth[u];
                self.measured[index] = measured;
                self.masked[index] = mask[u];
                if *z <= 0.0 {
                    (self.cells[index], self.gap[index]) = (Cell::Empty, f32::NAN);
                    continue;
                }
                self.rendered.push(index);
                if measured <= 0.0 {
                    (self.cells[index], self.gap[index]) = (Cell::Unmeasured, f32::NAN);
                    continue;
                }
                let gap = z - measured;
                self.gap[index] = gap;
                self.cells[index] = if gap > tolerance {
                    self.has_hidden = true;
                    Cell::Hidden
                } else if gap < -tolerance {
                    Cell::SeenThrough
                } else {
                    Cell::Agrees
                };
                // The first and the last column have no neighbors on both sides.
                if let Some([left, _, right]) = depth.get(u.wrapping_sub(1)..u + 2)
                    && *left > 0.0
                    && *right > 0.0
                {
                    let roughness = scale.bin(measured - 0.5 * (left + right));
                    if self.cells[index] == Cell::Agrees {
                        self.noise.add(roughness);
                    }
                    if mask[u] {
                        self.noise_in_mask.add(roughness);
                    }
                }
            }
        }
        let (cells, rim) = (&self.cells, &mut self.rim);
        for index in self.rendered.iter() {
            let inside = |other: usize| cells[other].is_rendered();
            if !Self::neighbors(index).into_iter().all(inside) {
                rim.push(index);
            }
        }
    }

    /// Iterates over the rendered cells of a kind, row by row.
    pub(crate) fn of_kind(&self, kind: Cell) -> impl Iterator<Item = usize> {
        let rendered = self.rendered.iter();
        rendered.filter(move |index| self.cells[*index] == kind)
    }

    /// Returns the mean depth of the agreeing cells, meters; 0 if there are none.
    pub(crate) fn distance(&self) -> f64 {
        let agreeing = self.of_kind(Cell::Agrees);
        let (sum, count) = agreeing.fold((0.0, 0.0), |(sum, count), index| {
            (sum + f64::from(self.measured[index]), count + 1.0)
        });
        sum / f64::max(count, 1.0)
    }

    /// Returns the distance within which surfaces agree, meters.
    pub(crate) fn tolerance(&self) -> f32 {
        AGREES * self.diameter
    }

    /// Returns the cell that is some steps away, at most 3 beyond the grid.
    pub(crate) fn offset(index: usize, steps: isize) -> usize {
        index.wrapping_add_signed(steps)
    }

    /// Iterates over the four neighbors of a cell.
    pub(crate) fn neighbors(index: usize) -> [usize; 4] {
        Self::SIDES.map(|side| Self::offset(index, side))
    }

    /// Returns the row and the column of a cell.
    pub(crate) fn place(index: usize) -> (usize, usize) {
        (index / STRIDE - MARGIN, index % STRIDE - MARGIN)
    }
}

/// The indices of some cells, row by row.
pub(crate) struct Indices {
    cells: [u16; SIDE * SIDE],
    count: usize,
}

impl Indices {
    pub(crate) const NONE: Self = Self {
        cells: [0; SIDE * SIDE],
        count: 0,
    };

    pub(crate) fn push(&mut self, index: usize) {
        #[allow(clippy::cast_possible_truncation)] // Fewer than 2¹⁶ cells.
        let cell = index as u16;
        self.cells[self.count] = cell;
        self.count += 1;
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        let cells = &self.cells[..self.count];
        cells.iter().map(|cell| usize::from(*cell))
    }
}

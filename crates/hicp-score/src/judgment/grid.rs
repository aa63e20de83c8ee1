//! The pixels that the evidence compares, on a grid over the rendered region.

use hicp_core::{Observation, RenderedView};

/// Number of cells along each side of the grid.
const SIDE: usize = 64;
const CELLS: usize = SIDE * SIDE;
/// Steepest slope of a continuous surface against the image plane, depth per width.
const STEEPEST: f32 = 3.0;

/// The relation of the measured to the rendered surface at a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Cell {
    Agrees,
    SeenThrough,
    Inside,
    Hidden,
    Unmeasured,
    /// The model is not rendered.
    #[default]
    Empty,
}

impl Cell {
    /// Number of kinds of rendered cells.
    pub(crate) const KINDS: usize = 5;
}

/// The compared pixels.
pub(crate) struct Grid {
    cells: [Cell; CELLS],
    /// Measured depth, meters.
    measured: [f32; CELLS],
    /// Rendered minus measured depth, meters.
    gap: [f32; CELLS],
    masked: [bool; CELLS],
    width: usize,
    height: usize,
    step: usize,
    /// Pixel of the first cell.
    corner: (usize, usize),
    tolerance: f32,
    /// Width of a cell per meter of distance.
    spread: f32,
}

impl Grid {
    /// Compares a render with an observation; surfaces within `tolerance` meters agree.
    pub(crate) fn new(observation: &Observation, view: &RenderedView, tolerance: f32) -> Self {
        let region = view.region();
        let camera = observation.camera();
        let step = region.width().max(region.height()).div_ceil(SIDE).max(1);
        let image_width = camera.width() as usize;
        let (depth, mask) = (observation.depth().pixels(), observation.mask().pixels());
        let mut grid = Self {
            cells: [Cell::Empty; CELLS],
            measured: [0.0; CELLS],
            gap: [0.0; CELLS],
            masked: [false; CELLS],
            width: region.width().div_ceil(step),
            height: region.height().div_ceil(step),
            step,
            corner: (region.u_min as usize, region.v_min as usize),
            tolerance,
            #[allow(clippy::cast_possible_truncation)]
            spread: step as f32 / camera.fx().min(camera.fy()) as f32,
        };
        for row in 0..grid.height {
            let v = grid.corner.1 + row * step;
            let rendered = &view.depth()[row * step * region.width()..][..region.width()];
            let start = v * image_width + grid.corner.0;
            for column in 0..grid.width {
                let (index, at) = (row * SIDE + column, column * step);
                let (z, measured) = (rendered[at], depth[start + at]);
                grid.measured[index] = measured;
                grid.masked[index] = mask[start + at];
                if z <= 0.0 {
                    continue;
                }
                let gap = z - measured;
                grid.gap[index] = gap;
                grid.cells[index] = if measured <= 0.0 {
                    Cell::Unmeasured
                } else if gap > tolerance {
                    Cell::Hidden
                } else if gap < -tolerance {
                    Cell::SeenThrough
                } else {
                    Cell::Agrees
                };
            }
        }
        grid
    }

    /// Returns the distance between cells, pixels.
    pub(crate) fn step(&self) -> usize {
        self.step
    }

    /// Iterates over the cells at which the model is rendered.
    pub(crate) fn rendered(&self) -> impl Iterator<Item = (usize, Cell)> + '_ {
        self.indices()
            .map(|index| (index, self.cells[index]))
            .filter(|(_, cell)| *cell != Cell::Empty)
    }

    /// Returns whether the pixel of a cell is masked.
    pub(crate) fn masked(&self, index: usize) -> bool {
        self.masked[index]
    }

    /// Returns the measured depth at a cell, meters; 0 if it is missing.
    pub(crate) fn measured(&self, index: usize) -> f32 {
        self.measured[index]
    }

    /// Returns whether the model is rendered at a cell.
    pub(crate) fn is_rendered(&self, index: usize) -> bool {
        self.cells[index] != Cell::Empty
    }

    /// Returns whether a cell shows both surfaces.
    pub(crate) fn is_compared(&self, index: usize) -> bool {
        self.is_rendered(index) && self.cells[index] != Cell::Unmeasured
    }

    /// Returns the cell that is some steps to the right and down, if it is in the grid.
    pub(crate) fn offset(&self, index: usize, right: isize, down: isize) -> Option<usize> {
        let column = (index % SIDE).checked_add_signed(right)?;
        let row = (index / SIDE).checked_add_signed(down)?;
        (column < self.width && row < self.height).then_some(row * SIDE + column)
    }

    /// Returns the part of a cell if the grid is divided into `parts` × `parts`.
    pub(crate) fn part(&self, index: usize, parts: usize) -> usize {
        let (column, row) = (index % SIDE, index / SIDE);
        row * parts / self.height * parts + column * parts / self.width
    }

    /// Returns the rendered minus the measured depth, meters.
    pub(crate) fn gap(&self, index: usize) -> f32 {
        self.gap[index]
    }

    /// Returns the distance of a measured pixel from the mean of its neighbors in the row, meters.
    pub(crate) fn roughness(&self, observation: &Observation, index: usize) -> Option<f32> {
        let image_width = observation.camera().width() as usize;
        let u = self.corner.0 + index % SIDE * self.step;
        let v = self.corner.1 + index / SIDE * self.step;
        if u == 0 || u + 1 >= image_width {
            return None;
        }
        let at = v * image_width + u;
        let depth = observation.depth().pixels();
        let (left, right) = (depth[at - 1], depth[at + 1]);
        let mean = 0.5 * (left + right);
        (left > 0.0 && right > 0.0).then(|| (depth[at] - mean).abs())
    }

    /// Counts the sides of a rendered cell at the silhouette, those at which the measured surface
    /// ends, and those with a measurement outside.
    pub(crate) fn contour(&self, index: usize) -> (usize, usize, usize) {
        let (mut sides, mut ends, mut compared) = (4, 0, 0);
        let rendered = self.gap[index] + self.measured[index];
        for other in self.neighbors(index) {
            if self.cells[other] != Cell::Empty {
                sides -= 1;
            } else if self.measured[other] > 0.0 {
                compared += 1;
                ends += usize::from((self.measured[other] - rendered).abs() > self.tolerance);
            }
        }
        (sides, ends, compared)
    }

    /// Separates the cells inside a measured surface from those hidden by one that stands in front.
    ///
    /// A nearer surface that hides the object ends in a step of depth. If it instead continues the
    /// surface at agreeing neighbors, the object reaches into it. The border of each connected part
    /// decides by majority.
    pub(crate) fn find_insides(&mut self) {
        let mut parts = Parts::new();
        for index in self.indices() {
            if self.cells[index] != Cell::Hidden {
                continue;
            }
            // The neighbors to the right and below: each pair once.
            for other in self.neighbors(index).filter(|other| *other > index) {
                if self.cells[other] == Cell::Hidden && self.continues(index, other) {
                    parts.join(index, other);
                }
            }
        }
        // Agreeing neighbors over which the surface continues, minus those with a step.
        let mut votes = [0_i16; CELLS];
        for index in self.indices() {
            if self.cells[index] == Cell::Hidden {
                let agreeing = |other: &usize| self.cells[*other] == Cell::Agrees;
                for other in self.neighbors(index).filter(agreeing) {
                    let continues = self.continues(index, other);
                    votes[parts.find(index)] += if continues { 1 } else { -1 };
                }
            }
        }
        for index in self.indices() {
            if self.cells[index] == Cell::Hidden && votes[parts.find(index)] > 0 {
                self.cells[index] = Cell::Inside;
            }
        }
    }

    /// Returns whether the measured surface continues between neighbors without a step.
    fn continues(&self, index: usize, other: usize) -> bool {
        let (a, b) = (self.measured[index], self.measured[other]);
        (a - b).abs() < (0.5 * self.tolerance).max(STEEPEST * self.spread * a.min(b))
    }

    fn indices(&self) -> impl Iterator<Item = usize> + use<> {
        let width = self.width;
        (0..self.height).flat_map(move |row| (0..width).map(move |column| row * SIDE + column))
    }

    /// Iterates over the neighbors within the grid.
    fn neighbors(&self, index: usize) -> impl Iterator<Item = usize> + use<> {
        let (column, row) = (index % SIDE, index / SIDE);
        [
            (column > 0, index.wrapping_sub(1)),
            (column + 1 < self.width, index + 1),
            (row > 0, index.wrapping_sub(SIDE)),
            (row + 1 < self.height, index + SIDE),
        ]
        .into_iter()
        .filter_map(|(exists, other)| exists.then_some(other))
    }
}

/// Connected parts of the grid (union-find).
struct Parts([u16; CELLS]);

impl Parts {
    fn new() -> Self {
        #[allow(clippy::cast_possible_truncation)] // At most 4,096.
        Self(std::array::from_fn(|index| index as u16))
    }

    fn find(&mut self, mut index: usize) -> usize {
        while usize::from(self.0[index]) != index {
            self.0[index] = self.0[usize::from(self.0[index])];
            index = usize::from(self.0[index]);
        }
        index
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.find(a), self.find(b));
        #[allow(clippy::cast_possible_truncation)] // At most 4,096.
        let low = a.min(b) as u16;
        self.0[a.max(b)] = low;
    }
}

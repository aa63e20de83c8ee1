//! Colors of the model and of the image, averaged over cells, and their correlation.

use hicp_core::nalgebra::{Matrix4, SMatrix, Vector4};
use hicp_core::{Isometry3, Model, PinholeCamera, Vector3};

/// Number of cells along each side of the object's bounding square.
const SIDE: usize = 24;
/// Cells with fewer pixels or samples than this share of the average do not count.
const LEAST_FILLED: f32 = 0.25;
/// Number of cells on each side whose mean color is removed.
const AROUND: usize = 2;
/// Smallest number of cells that are evidence.
const LEAST_CELLS: usize = 12;
/// Smallest variance of a channel of the image that is not a rounding error, gray levels squared.
const LEAST_VARIANCE: f64 = 1e-6;
/// Smallest contrast of the model's colors that is evidence, gray levels.
pub(crate) const LEAST_CONTRAST: f64 = 6.0;

/// The effects of light that are removed from the colors of model and image before they are
/// compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shading {
    /// Light from everywhere: nothing but a gain and an offset per channel is removed.
    Even,
    /// Light that falls off with the direction of the normal, such as that of a lamp.
    Directional,
    /// Such light with highlights and shadows: the mean color around each place is removed, too.
    #[default]
    Local,
}

/// The agreement of the colors of a model at a pose with the image, and whether that means
/// anything.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct ColorEvidence {
    /// The correlation of the colors of model and image, −1 to 1. An image of one color has 0.
    ///
    /// A gain and an offset per channel do not change it.
    pub correlation: f64,
    /// The contrast of the visible part of the model, in gray levels (0 to 255): the standard
    /// deviation of what remains of its colors without shading.
    pub contrast: f64,
    /// Number of compared cells.
    pub cells: usize,
}

impl ColorEvidence {
    /// Returns whether the colors can tell poses apart: the model has a contrast, and enough of it
    /// is seen and not overexposed.
    #[must_use]
    pub fn is_telling(&self) -> bool {
        self.cells >= LEAST_CELLS && self.contrast >= LEAST_CONTRAST
    }

    /// Returns 0 for a correlation of 1 and 1 for that of −1; 0.5 without evidence.
    pub(crate) fn score(&self) -> f64 {
        if self.is_telling() {
            0.5 - 0.5 * self.correlation
        } else {
            0.5
        }
    }
}

/// The sums of a cell: weight, colors of the model and of the image, and normals.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Cell {
    weight: f32,
    model: [f32; 3],
    image: [f32; 3],
    normal: [f32; 3],
}

/// The cells of an image region around an object.
///
/// It allocates when they are placed for the first time.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Cells {
    cells: Vec<Cell>,
    origin: [f64; 2],
    per_pixel: [f64; 2],
}

impl Cells {
    /// Empties the cells and places them around the model at a pose.
    ///
    /// Returns `None` if the model's center is behind the camera.
    pub(crate) fn place(
        &mut self,
        model: &Model,
        camera: &PinholeCamera,
        pose: &Isometry3<f64>,
    ) -> Option<()> {
        let center = pose * model.center();
        let pixel = camera.project(&center)?;
        let reach = model.radius() / center.z;
        let half = [camera.fx() * reach, camera.fy() * reach];
        self.origin = [pixel.x - half[0], pixel.y - half[1]];
        self.per_pixel = half.map(|half| SIDE as f64 / (2.0 * half));
        self.cells.clear();
        self.cells.resize(SIDE * SIDE, Cell::default());
        Some(())
    }

    /// Adds the colors of the model and of the image at pixel (u, v).
    #[inline]
    pub(crate) fn add(
        &mut self,
        (u, v): (u32, u32),
        normal: &Vector3<f64>,
        [model, image]: [[f32; 3]; 2],
    ) {
        let place = |axis: usize, at: u32| {
            let cell = (f64::from(at) - self.origin[axis]) * self.per_pixel[axis];
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // Saturates.
            let cell = cell as usize;
            cell.min(SIDE - 1)
        };
        let cell = &mut self.cells[place(1, v) * SIDE + place(0, u)];
        cell.weight += 1.0;
        for channel in 0..3 {
            cell.model[channel] += model[channel];
            cell.image[channel] += image[channel];
            #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
            let along = normal[channel] as f32;
            cell.normal[channel] += along;
        }
    }

    /// Returns the correlation of both sides over the filled cells.
    pub(crate) fn evidence(&self, shading: Shading) -> ColorEvidence {
        let filled = self.cells.iter().filter(|cell| cell.weight > 0.0);
        let (n, total) = filled.fold((0, 0.0), |(n, total), cell| (n + 1, total + cell.weight));
        let least = LEAST_FILLED * total / n.max(1) as f32;
        let counts = |cell: &Cell| cell.weight > 0.0 && cell.weight >= least;
        let mut rest = self.without_shading(shading, counts);
        if shading == Shading::Local {
            without_surroundings(&mut rest);
        }
        let mut squares = [[0.0; 3]; 3];
        let mut sum = 0.0;
        for Rest { weight, values, .. } in &rest {
            for channel in 0..3 {
                let (model, image) = (values[channel], values[channel + 3]);
                squares[channel][0] += weight * model * model;
                squares[channel][1] += weight * image * image;
                squares[channel][2] += weight * model * image;
            }
            sum += weight;
        }
        let contrast = squares.iter().map(|[model, ..]| model).sum::<f64>();
        let mut correlation = 0.0;
        for [model, image, both] in squares {
            let norm = (model * image).sqrt();
            // An image of one color agrees with nothing.
            if norm > 0.0 && image > LEAST_VARIANCE * sum {
                correlation += model * (both / norm);
            }
        }
        ColorEvidence {
            correlation: if contrast > 0.0 {
                correlation / contrast
            } else {
                0.0
            },
            contrast: (contrast / (3.0 * f64::max(sum, 1.0))).sqrt(),
            cells: rest.len(),
        }
    }

    /// Returns weights and colors of cells, without the effects of light.
    fn without_shading(&self, shading: Shading, counts: impl Fn(&Cell) -> bool) -> Vec<Rest> {
        let cells = || self.cells.iter().filter(|cell| counts(cell));
        let total: f32 = cells().map(|cell| cell.weight).sum();
        // The least squares fit of both sides by the shading.
        let mut normal_matrix = Matrix4::from_diagonal(&Vector4::new(0.0, 1e-3, 1e-3, 1e-3));
        normal_matrix *= f64::from(total);
        let mut right = SMatrix::<f64, 4, 6>::zeros();
        for cell in cells() {
            let weight = f64::from(cell.weight);
            let basis = cell.basis(shading);
            normal_matrix += basis * basis.transpose() * weight;
            for (column, value) in cell.values().iter().enumerate() {
                let mut column = right.column_mut(column);
                column += basis * (*value * weight);
            }
        }
        let Some(solved) = normal_matrix.cholesky() else {
            return Vec::new();
        };
        let fit = solved.solve(&right);
        let cells = self
            .cells
            .iter()
            .enumerate()
            .filter(|(_, cell)| counts(cell));
        cells
            .map(|(index, cell)| {
                let basis = cell.basis(shading);
                let mut values = cell.values();
                for (column, value) in values.iter_mut().enumerate() {
                    *value -= fit.column(column).dot(&basis);
                }
                Rest {
                    place: index,
                    weight: f64::from(cell.weight),
                    values,
                }
            })
            .collect()
    }
}

/// The rest of the colors of a cell: three channels of the model, three of the image.
struct Rest {
    place: usize,
    weight: f64,
    values: [f64; 6],
}

/// Subtracts the mean color around each cell.
fn without_surroundings(rest: &mut [Rest]) {
    const STRIDE: usize = SIDE + 1;
    // Sums over the cells above and to the left.
    let mut sums = [[0.0; 7]; STRIDE * STRIDE];
    let mut cells = rest.iter().peekable();
    for row in 0..SIDE {
        let mut in_row = [0.0; 7];
        for column in 0..SIDE {
            if let Some(cell) = cells.next_if(|cell| cell.place == row * SIDE + column) {
                for (sum, value) in in_row.iter_mut().zip(cell.values) {
                    *sum += cell.weight * value;
                }
                in_row[6] += cell.weight;
            }
            let above = sums[row * STRIDE + column + 1];
            sums[(row + 1) * STRIDE + column + 1] =
                std::array::from_fn(|index| above[index] + in_row[index]);
        }
    }
    for cell in rest {
        let (row, column) = (cell.place / SIDE, cell.place % SIDE);
        let (top, bottom) = (row.saturating_sub(AROUND), (row + AROUND + 1).min(SIDE));
        let (left, right) = (
            column.saturating_sub(AROUND),
            (column + AROUND + 1).min(SIDE),
        );
        let at = |row: usize, column: usize| &sums[row * STRIDE + column];
        let around = |index: usize| {
            at(bottom, right)[index] + at(top, left)[index]
                - at(top, right)[index]
                - at(bottom, left)[index]
        };
        for (index, value) in cell.values.iter_mut().enumerate() {
            *value -= around(index) / around(6);
        }
    }
}

impl Cell {
    /// Returns the mean colors of the model and of the image.
    fn values(&self) -> [f64; 6] {
        let [a, b, c] = self.model;
        let [d, e, f] = self.image;
        [a, b, c, d, e, f].map(|sum| f64::from(sum / self.weight))
    }

    /// Returns the terms of the shading.
    fn basis(&self, shading: Shading) -> Vector4<f64> {
        match shading {
            Shading::Even => Vector4::new(1.0, 0.0, 0.0, 0.0),
            Shading::Directional | Shading::Local => {
                let [x, y, z] = self.normal.map(|sum| f64::from(sum / self.weight));
                Vector4::new(1.0, x, y, z)
            }
        }
    }
}

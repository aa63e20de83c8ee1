//! The surface that is seen from each side of an object.

use std::sync::{Arc, OnceLock};

use nalgebra::{Isometry3, Point3, UnitQuaternion, UnitVector3, Vector3};

use crate::internal::{bounds, centroid};
use crate::object::model::Model;
use crate::object::sampling::sample_surface;
use crate::surfel::Surfel;

/// Number of surface samples per surfel of a side, from which the surfels are chosen.
const DENSITY: usize = 16;
/// Largest number of surfels of a side.
const MAX_SURFELS: usize = 100_000;
/// Number of cells along the longer axis of a view, to measure its area.
const COARSE: f32 = 24.0;
/// Largest number of cells per surfel. Two specks far apart would need more.
const MAX_CELLS: f32 = 64.0;
/// Length of a view that is too short for cells, meters.
const SPECK: f32 = 1e-9;
/// Depth behind the foremost sample of a cell up to which a sample may be chosen, as a share of the
/// diameter.
const FRONT: f32 = 0.05;

/// The surfels of a model that are visible from each of [`Sides::COUNT`] directions.
///
/// They replace a render if thousands of poses are tried. A square grid covers the view of the
/// object from far away, and each cell has one surfel. The surfels are therefore even in the
/// *image* and not on the surface, and fewer of them are needed to cover every pixel. Hidden
/// surfels are left out, such as those of the inside of a mug.
///
/// ```
/// use hicp_core::{Isometry3, Model, Point3, Sides, TriMesh};
/// # fn main() -> Result<(), hicp_core::MeshError> {
/// let corners = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]].map(Point3::from);
/// let model = Model::new(TriMesh::new(corners.to_vec(), vec![[0, 1, 2]])?);
/// let side = Sides::of(&model, 200).facing(&Isometry3::translation(0.0, 0.0, 1.0)).surfels.len();
/// assert!((150..250).contains(&side));
/// # Ok(()) }
/// ```
#[derive(Debug)]
pub struct Sides {
    samples: Vec<Surfel>,
    center: Point3<f64>,
    diameter: f32,
    /// `true` if normals are certain to point out of the object.
    oriented: bool,
    count: usize,
    /// The directions to the sides, object frame, and the sides once they are asked for.
    sides: [(UnitVector3<f32>, OnceLock<Side>); Self::COUNT],
}

/// The surface of a model that is seen from one of its sides.
#[derive(Clone, Debug, PartialEq)]
pub struct Side {
    /// The number of the side, below [`Sides::COUNT`].
    pub index: usize,
    /// The visible surfels, object frame.
    pub surfels: Vec<Surfel>,
    /// The mean of their points; the center of the model if there is none.
    pub centroid: Point3<f64>,
}

impl Sides {
    /// Number of sides. Neighbors are some 30° apart.
    pub const COUNT: usize = 48;

    /// Returns the sides of a model with about `count` surfels each, at most 100,000.
    ///
    /// They are built once per model and count, and shared. Cost: sampling the surface once, and
    /// some 0.1 ms for each side that is requested.
    #[must_use]
    pub fn of(model: &Model, count: usize) -> Arc<Self> {
        let count = count.min(MAX_SURFELS);
        #[allow(clippy::cast_possible_truncation)] // f32 is the precision of samples.
        model.derived().get_or_build(count as u64, || Self {
            samples: sample_surface(model.mesh(), DENSITY * count),
            center: model.center(),
            diameter: model.diameter() as f32,
            oriented: model.mesh().is_closed(),
            count,
            sides: std::array::from_fn(|side| (direction(side), OnceLock::new())),
        })
    }

    /// Returns the side that faces the camera at a pose.
    #[must_use]
    pub fn facing(&self, camera_from_object: &Isometry3<f64>) -> &Side {
        let eye = camera_from_object.inverse().translation.vector;
        self.toward(&(eye - self.center.coords))
    }

    /// Returns the side in a direction from the center, object frame, of any length.
    #[must_use]
    pub fn toward(&self, direction: &Vector3<f64>) -> &Side {
        let direction = direction.cast::<f32>();
        let (mut nearest, mut most) = (0, f32::NEG_INFINITY);
        for (index, (side, _)) in self.sides.iter().enumerate() {
            let along = side.dot(&direction);
            if along > most {
                (nearest, most) = (index, along);
            }
        }
        let (direction, side) = &self.sides[nearest];
        side.get_or_init(|| {
            let surfels = self.seen_from(direction);
            Side {
                index: nearest,
                centroid: centroid(&surfels).unwrap_or(self.center),
                surfels,
            }
        })
    }

    /// Returns surfels that are seen from a direction.
    fn seen_from(&self, direction: &UnitVector3<f32>) -> Vec<Surfel> {
        let turn = UnitQuaternion::rotation_between_axis(direction, &Vector3::z_axis())
            .unwrap_or_else(|| {
                UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f32::consts::PI)
            })
            .to_rotation_matrix();
        let faces = |s: &&Surfel| !self.oriented || s.normal.dot(direction) > 0.0;
        let facing = self.samples.iter().filter(faces);
        let seen: Vec<(Point3<f32>, &Surfel)> =
            facing.map(|sample| (turn * sample.point, sample)).collect();
        let Some([low, high]) = bounds(seen.iter().map(|(place, _)| *place)) else {
            return Vec::new();
        };
        let low = [low.x, low.y];
        let extent = [high.x - low[0], high.y - low[1]];
        let longer = extent[0].max(extent[1]);
        if longer <= SPECK {
            return vec![*seen[0].1];
        }
        let coarse = Grid::new(low, extent, longer / COARSE);
        let mut occupied = vec![0_u8; coarse.cells()];
        for (place, _) in &seen {
            occupied[coarse.cell(place).0] = 1;
        }
        let occupied: usize = occupied.iter().map(|cell| usize::from(*cell)).sum();
        let area = occupied as f32 * coarse.cell.powi(2);
        let count = self.count as f32;
        let smallest = longer / (MAX_CELLS * count).sqrt();
        let fine = Grid::new(low, extent, (area / count).sqrt().max(smallest));
        fine.choose(&seen, FRONT * self.diameter)
    }
}

/// Returns the direction to a side. They are even on a sphere: a Fibonacci lattice.
fn direction(side: usize) -> UnitVector3<f32> {
    let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let z = 1.0 - (2 * side + 1) as f64 / Sides::COUNT as f64;
    let (sin, cos) = (golden_angle * side as f64).sin_cos();
    let radius = (1.0 - z * z).sqrt();
    UnitVector3::new_normalize(Vector3::new(radius * cos, radius * sin, z).cast())
}

/// A grid of square cells over a view.
struct Grid {
    low: [f32; 2],
    cell: f32,
    columns: usize,
    rows: usize,
}

impl Grid {
    fn new(low: [f32; 2], extent: [f32; 2], cell: f32) -> Self {
        let [columns, rows] = extent.map(|length| whole(length / cell) + 1);
        Self {
            low,
            cell,
            columns,
            rows,
        }
    }

    fn cells(&self) -> usize {
        self.columns * self.rows
    }

    /// Returns the cell of a place, and the square of its distance from the middle, in cells.
    fn cell(&self, place: &Point3<f32>) -> (usize, f32) {
        let [x, y] = [0, 1].map(|axis| (place[axis] - self.low[axis]) / self.cell);
        let (column, row) = (whole(x).min(self.columns - 1), whole(y).min(self.rows - 1));
        let off = (x - column as f32 - 0.5).powi(2) + (y - row as f32 - 0.5).powi(2);
        (row * self.columns + column, off)
    }

    /// Returns one surfel per occupied cell: of those at most `front` behind the foremost one, the
    /// nearest to the middle.
    fn choose(&self, seen: &[(Point3<f32>, &Surfel)], front: f32) -> Vec<Surfel> {
        let mut foremost = vec![f32::NEG_INFINITY; self.cells()];
        for (place, _) in seen {
            let foremost = &mut foremost[self.cell(place).0];
            *foremost = foremost.max(place.z);
        }
        let mut chosen = vec![(f32::INFINITY, None); self.cells()];
        for (place, surfel) in seen {
            let (cell, off) = self.cell(place);
            if place.z >= foremost[cell] - front && off < chosen[cell].0 {
                chosen[cell] = (off, Some(**surfel));
            }
        }
        chosen
            .into_iter()
            .filter_map(|(_, surfel)| surfel)
            .collect()
    }
}

/// Returns the whole part of a number that is not negative.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // A cell of a grid.
fn whole(number: f32) -> usize {
    number as usize
}

//! One point per cell of a grid.

use hicp_core::internal::Scratch;
use hicp_core::{Context, Isometry3, Problem, Surfel};

use crate::length::Length;
use crate::selection::all_samples::AllSamples;
use crate::selection::keep::keep_positions;
use crate::selection::point_selection::PointSelection;

/// Keeps in every cell of a cubic grid the point of another selection closest to the center.
///
/// Only dense regions become sparser. A rendered surface therefore keeps its slanted parts, which a
/// pixel grid samples sparsely per area. Unlike averages, kept points are points of the surface
/// with their own normals.
///
/// The grid starts at the object's origin. The order of the inner selection does not change, and of
/// equally central points the first is kept. A cell size that is not positive keeps every point.
/// Cost: the inner selection, and O(n log n).
#[derive(Clone, Debug, PartialEq)]
pub struct VoxelGrid<P> {
    /// The selection to select from.
    pub selection: P,
    /// Edge of a cell.
    pub cell: Length,
    scratch: Scratch<Vec<Entry>>,
}

/// A point's cell, its squared distance from the cell's center in units of cells, and its position.
#[derive(Clone, Copy, Debug)]
struct Entry {
    cell: [i64; 3],
    off_center: f32,
    position: usize,
}

impl<P> VoxelGrid<P> {
    /// Creates the selection.
    #[must_use]
    pub fn new(selection: P, cell: Length) -> Self {
        Self {
            selection,
            cell,
            scratch: Scratch::default(),
        }
    }
}

impl Default for VoxelGrid<AllSamples> {
    /// Cells of 5 % of the diameter: about 500 to 1,000 on the surface of a compact object.
    fn default() -> Self {
        Self::new(AllSamples, Length::Diameters(0.05))
    }
}

impl<P: PointSelection> PointSelection for VoxelGrid<P> {
    fn select(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
        source: &mut Vec<Surfel>,
    ) {
        self.selection.select(context, camera_from_object, source);
        let edge = self.cell.meters(&context.problem);
        if edge.is_nan() || edge <= 0.0 {
            return;
        }
        let entries = &mut self.scratch.0;
        entries.clear();
        entries.extend(source.iter().enumerate().map(|(position, surfel)| {
            let scaled = surfel.point / edge;
            let corner = scaled.map(f32::floor);
            #[allow(clippy::cast_possible_truncation)]
            // Casts saturate, which is harmless: points do not share cells in so fine a grid.
            let cell = corner.coords.map(|x| x as i64).into();
            Entry {
                cell,
                off_center: (scaled - corner).add_scalar(-0.5).norm_squared(),
                position,
            }
        }));
        entries.sort_unstable_by(|a, b| {
            (a.cell.cmp(&b.cell))
                .then_with(|| a.off_center.total_cmp(&b.off_center))
                .then_with(|| a.position.cmp(&b.position))
        });
        entries.dedup_by_key(|entry| entry.cell);
        entries.sort_unstable_by_key(|entry| entry.position);
        keep_positions(source, entries.iter().map(|entry| entry.position));
    }

    fn name(&self) -> &'static str {
        "voxel-grid"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        self.selection.unsupported(problem)
    }
}

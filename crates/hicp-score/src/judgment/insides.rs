//! The separation of cells inside a measured surface from those that it hides.

use hicp_core::internal::DisjointSets;

use crate::judgment::grid::{CELLS, Cell, Grid, Indices};

/// Steepest slope of a continuous surface against the image plane, depth per width.
const STEEPEST: f32 = 3.0;

/// Finds the hidden cells that lie inside a measured surface.
///
/// A nearer surface that hides the object ends in a step of depth. If it instead continues the
/// surface at agreeing neighbors, the object reaches into it. The border of each connected part
/// decides by majority.
pub(crate) fn find_insides(grid: &mut Grid) {
    if !grid.has_hidden {
        return;
    }
    let mut hidden = Indices::NONE;
    for index in grid.of_kind(Cell::Hidden) {
        hidden.push(index);
    }
    let mut parts = DisjointSets::new([0; CELLS]);
    for index in hidden.iter() {
        // The neighbors to the right and below: each pair once.
        for other in [Grid::SIDES[0], Grid::SIDES[2]].map(|side| Grid::offset(index, side)) {
            if grid.cells[other] == Cell::Hidden && continues(grid, index, other) {
                parts.join(index, other);
            }
        }
    }
    // Agreeing neighbors over which the surface continues, minus those with a step.
    let mut votes = [0_i16; CELLS];
    for index in hidden.iter() {
        for other in Grid::neighbors(index) {
            if grid.cells[other] == Cell::Agrees {
                votes[parts.find(index)] += if continues(grid, index, other) { 1 } else { -1 };
            }
        }
    }
    for index in hidden.iter() {
        if votes[parts.find(index)] > 0 {
            grid.cells[index] = Cell::Inside;
        }
    }
}

/// Returns the share of the nearer measured surfaces that contain the object; 0 without any.
pub(crate) fn inside_share(grid: &mut Grid) -> f64 {
    find_insides(grid);
    let count = |kind| grid.of_kind(kind).count();
    let (inside, hidden) = (count(Cell::Inside), count(Cell::Hidden));
    inside as f64 / (inside + hidden).max(1) as f64
}

/// Returns whether the measured surface continues between neighbors without a step.
fn continues(grid: &Grid, index: usize, other: usize) -> bool {
    let (a, b) = (grid.measured[index], grid.measured[other]);
    (a - b).abs() < (0.5 * grid.tolerance()).max(STEEPEST * grid.spread * a.min(b))
}

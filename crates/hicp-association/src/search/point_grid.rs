//! Observed points in the order of the image, searched by window.

use std::sync::Arc;

use hicp_core::Observation;
use hicp_core::internal::{VectorLoop, Work, vectorized};

use crate::search::wide_tree::Nearest;
use crate::stride::Stride;

/// Points of a block: one vector.
const WIDTH: usize = 8;
const WIDTH_U32: u32 = 8;

/// Eight neighbours along a row of the grid: `[axis][lane]`. Where there is no surfel the point lies at infinity.
type Block = [[f32; WIDTH]; 3];

/// Rows of a tile, which is one block wide.
const TILE_ROWS: usize = 8;

/// The boxes about the points of eight neighbouring tiles: `min[axis][lane]`. A tile without points has a box at infinity.
#[derive(Clone, Copy, Debug)]
struct Tiles {
    min: [[f32; WIDTH]; 3],
    max: [[f32; WIDTH]; 3],
}

/// Rounding may put the computed distance of a box a few units in the last place beyond that of a point inside it.
const PRUNING_SLACK: f32 = 1.0 - 1.0e-6;

/// The observed surfels of a stride, row by row.
///
/// A *slot* names a cell of the grid, its rows filled up to whole blocks; slots ascend as pixels do.
#[derive(Debug)]
pub(crate) struct PointGrid {
    blocks: Vec<Block>,
    /// Of each block the index in the observation of its first surfel.
    first: Vec<u32>,
    blocks_per_row: usize,
    /// Of the blocks of every eight rows, eight tiles at a time.
    tiles: Vec<Tiles>,
    tiles_per_row: usize,
    columns: usize,
    rows: usize,
    /// The pixel of the first cell, and the pixels from one cell to the next.
    corner: [u32; 2],
    stride: u32,
}

/// Some cells: columns and rows, the last ones included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Window {
    pub(crate) columns: [usize; 2],
    pub(crate) rows: [usize; 2],
}

impl PointGrid {
    /// Built once per observation and stride, shared by all threads and hypotheses.
    pub(crate) fn of(observation: &Observation, targets: Stride) -> Arc<Self> {
        let stride = targets.pixels(observation.n_surfels());
        observation
            .derived()
            .get_or_build(u64::from(stride), || Self::new(observation, stride))
    }

    fn new(observation: &Observation, stride: u32) -> Self {
        let region = observation.region();
        let corner = [region.u_min, region.v_min].map(|first| first.next_multiple_of(stride));
        let cells = |from: u32, to: u32| to.saturating_sub(from).div_ceil(stride) as usize;
        let columns = cells(corner[0], region.u_max);
        let rows = cells(corner[1], region.v_max);
        let blocks_per_row = columns.div_ceil(WIDTH);
        let tiles_per_row = blocks_per_row.div_ceil(WIDTH);
        let none = Tiles {
            min: [[f32::INFINITY; WIDTH]; 3],
            max: [[f32::NEG_INFINITY; WIDTH]; 3],
        };
        let mut grid = Self {
            blocks: vec![[[f32::INFINITY; WIDTH]; 3]; blocks_per_row * rows],
            first: Vec::with_capacity(blocks_per_row * rows),
            blocks_per_row,
            tiles: vec![none; tiles_per_row * rows.div_ceil(TILE_ROWS)],
            tiles_per_row,
            columns,
            rows,
            corner,
            stride,
        };
        let step = stride as usize;
        for row in 0..rows {
            let first = (corner[1] - region.v_min) as usize + row * step;
            let first = first * region.width() + (corner[0] - region.u_min) as usize;
            for column in 0..columns {
                // At most 2³⁰ pixels in any accepted image.
                let index = u32::try_from(first + column * step).unwrap_or(u32::MAX);
                if column % WIDTH == 0 {
                    grid.first.push(index);
                }
                if let Some(surfel) = observation.surfel(index) {
                    let (block, tile) = (column / WIDTH, row / TILE_ROWS);
                    let tiles = &mut grid.tiles[tile * tiles_per_row + block / WIDTH];
                    let points = &mut grid.blocks[row * blocks_per_row + block];
                    for (axis, value) in surfel.point.iter().enumerate() {
                        points[axis][column % WIDTH] = *value;
                        let (min, max) = (&mut tiles.min[axis], &mut tiles.max[axis]);
                        min[block % WIDTH] = min[block % WIDTH].min(*value);
                        max[block % WIDTH] = max[block % WIDTH].max(*value);
                    }
                }
            }
        }
        grid
    }

    /// Pixels from one cell to the next.
    #[inline]
    pub(crate) fn stride(&self) -> u32 {
        self.stride
    }

    /// The pixel (u, v) of the first cell.
    #[inline]
    pub(crate) fn corner(&self) -> [u32; 2] {
        self.corner
    }

    /// Numbers of columns and rows.
    #[inline]
    pub(crate) fn size(&self) -> [usize; 2] {
        [self.columns, self.rows]
    }

    /// How many blocks a search of a window looks at.
    #[inline(always)]
    pub(crate) fn blocks_in(window: &Window) -> usize {
        let [first, last] = window.columns;
        (last / WIDTH - first / WIDTH + 1) * (window.rows[1] - window.rows[0] + 1)
    }

    /// The index in the observation of a slot's surfel.
    #[inline(always)]
    pub(crate) fn index(&self, slot: u32) -> u32 {
        let (block, lane) = (slot as usize / WIDTH, slot % WIDTH_U32);
        self.first
            .get(block)
            .map_or(u32::MAX, |first| first + lane * self.stride)
    }

    /// The slot of the cell nearest to a position.
    #[inline(always)]
    pub(crate) fn slot_near(&self, [u, v]: [f32; 2]) -> u32 {
        // A cast saturates, and makes 0 of NaN.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let (column, row) = ((u + 0.5) as usize, (v + 0.5) as usize);
        let column = column.min(self.columns.saturating_sub(1));
        let row = row.min(self.rows.saturating_sub(1));
        // Not more than pixels, but for the filling.
        u32::try_from(row * self.blocks_per_row * WIDTH + column).unwrap_or(u32::MAX)
    }

    /// The squared distance of the point of a slot; infinity where there is none.
    #[inline(always)]
    pub(crate) fn distance_squared(&self, query: &[f32; 3], slot: u32) -> f32 {
        let (block, lane) = (slot as usize / WIDTH, slot as usize % WIDTH);
        let Some([xs, ys, zs]) = self.blocks.get(block) else {
            return f32::INFINITY;
        };
        let (x, y, z) = (
            query[0] - xs[lane],
            query[1] - ys[lane],
            query[2] - zs[lane],
        );
        x * x + y * y + z * z
    }

    /// Returns the nearest point of a window, of equally near ones the first; its element is its slot. Points beside the window may be found.
    #[inline(always)]
    pub(crate) fn nearest(&self, query: &[f32; 3], window: &Window) -> Option<Nearest> {
        Work::NodesVisited.count(Self::blocks_in(window));
        let mut best = LaneBest::new();
        let [first, last] = window.columns.map(|column| column / WIDTH);
        for row in window.rows[0]..=window.rows[1] {
            let start = row * self.blocks_per_row;
            let blocks = &self.blocks[start + first..=start + last];
            for (number, block) in (start + first..).zip(blocks) {
                // Numbers ascend: of equally near points the first stays.
                best.look::<false>(block, number, query);
            }
        }
        best.nearest()
    }

    /// Returns what [`PointGrid::nearest`] does where it is at most `limit` (squared) away, by way of the tiles: for large windows.
    pub(crate) fn nearest_by_tiles(
        &self,
        query: &[f32; 3],
        window: &Window,
        limit: f32,
    ) -> Option<Nearest> {
        vectorized(TileSearch {
            grid: self,
            query,
            window,
            limit,
        })
    }

    /// All cells, of which there must be some.
    #[inline]
    pub(crate) fn everywhere(&self) -> Window {
        Window {
            columns: [0, self.columns - 1],
            rows: [0, self.rows - 1],
        }
    }
}

struct TileSearch<'a> {
    grid: &'a PointGrid,
    query: &'a [f32; 3],
    window: &'a Window,
    limit: f32,
}

impl VectorLoop for TileSearch<'_> {
    type Output = Option<Nearest>;

    #[inline(always)]
    fn run(self) -> Option<Nearest> {
        let (grid, query) = (self.grid, self.query);
        let [first, last] = self.window.columns.map(|column| column / (WIDTH * WIDTH));
        let [top, bottom] = self.window.rows.map(|row| row / TILE_ROWS);
        Work::NodesVisited.count(2 * (last - first + 1) * (bottom - top + 1));
        let tiles = |row: usize| row * grid.tiles_per_row + first..=row * grid.tiles_per_row + last;

        // What the tile with the nearest box holds bounds what is worth a look.
        let mut limit = self.limit;
        let mut best = LaneBest::new();
        let (mut nearest, mut found) = (f32::INFINITY, None);
        for row in top..=bottom {
            for number in tiles(row) {
                let distances = box_distances(&grid.tiles[number], query);
                for (lane, distance) in distances.into_iter().enumerate() {
                    if distance < nearest {
                        (nearest, found) = (distance, Some((number, lane)));
                    }
                }
            }
        }
        if let Some((number, lane)) = found {
            grid.look_into(number, lane, query, &mut best);
            limit = limit.min(best.distance_squared());
        }
        for row in top..=bottom {
            for number in tiles(row) {
                let distances = box_distances(&grid.tiles[number], query);
                for (lane, distance) in distances.iter().enumerate() {
                    if *distance * PRUNING_SLACK <= limit && *distance < f32::INFINITY {
                        grid.look_into(number, lane, query, &mut best);
                        limit = limit.min(best.distance_squared());
                    }
                }
            }
        }
        best.nearest()
    }
}

impl PointGrid {
    /// Looks at the points of a tile.
    #[inline(always)]
    fn look_into(&self, number: usize, lane: usize, query: &[f32; 3], best: &mut LaneBest) {
        let (row, column) = (number / self.tiles_per_row, number % self.tiles_per_row);
        let column = column * WIDTH + lane;
        Work::NodesVisited.count(TILE_ROWS);
        for row in (row * TILE_ROWS..self.rows).take(TILE_ROWS) {
            let number = row * self.blocks_per_row + column;
            best.look::<true>(&self.blocks[number], number, query);
        }
    }
}

/// The nearest point of each lane, and the block that it is in.
struct LaneBest {
    nearest: LaneDistances,
    block: [u32; WIDTH],
}

/// Squared distances by their bits: those of numbers that are not negative ascend as they do, and integers have vector instructions
/// for what numbers have branches for.
type LaneDistances = [i32; WIDTH];

/// The bits of infinity.
const FAR: i32 = f32::INFINITY.to_bits().cast_signed();

impl LaneBest {
    #[inline(always)]
    fn new() -> Self {
        Self {
            nearest: [FAR; WIDTH],
            block: [u32::MAX; WIDTH],
        }
    }

    /// Takes, lane by lane, what is nearer; of equally near points, with `TIES`, the one of the lower block.
    #[inline(always)]
    #[allow(clippy::needless_range_loop)] // Several arrays at one index.
    fn look<const TIES: bool>(&mut self, block: &Block, number: usize, query: &[f32; 3]) {
        #[allow(clippy::cast_possible_truncation)] // Fewer than pixels.
        let number = number as u32;
        let distances = distances(block, query);
        // All bits or none: what reads like a choice becomes a branch per lane.
        let mut taken = [0_u32; WIDTH];
        for lane in 0..WIDTH {
            let (new, old) = (distances[lane].to_bits().cast_signed(), self.nearest[lane]);
            let nearer = (new < old) | (TIES & (new == old) & (number < self.block[lane]));
            taken[lane] = u32::from(nearer).wrapping_neg();
        }
        for lane in 0..WIDTH {
            let new = distances[lane].to_bits().cast_signed();
            self.nearest[lane] = new.min(self.nearest[lane]);
        }
        for lane in 0..WIDTH {
            self.block[lane] = (number & taken[lane]) | (self.block[lane] & !taken[lane]);
        }
    }

    #[inline(always)]
    fn distance_squared(&self) -> f32 {
        f32::from_bits(least(&self.nearest).cast_unsigned())
    }

    #[inline(always)]
    fn nearest(&self) -> Option<Nearest> {
        let distance = least(&self.nearest);
        // Of the lanes that are as near the slot, of the others none.
        let mut slots = [0_u32; WIDTH];
        for (lane, slot) in (0_u32..).zip(&mut slots) {
            let block = self.block[lane as usize];
            let other = u32::from(self.nearest[lane as usize] != distance).wrapping_neg();
            *slot = (block.wrapping_mul(WIDTH_U32).wrapping_add(lane)) | other;
        }
        let element = slots.into_iter().fold(u32::MAX, u32::min);
        (distance < FAR).then_some(Nearest {
            distance_squared: f32::from_bits(distance.cast_unsigned()),
            element,
        })
    }
}

#[inline(always)]
fn least(distances: &LaneDistances) -> i32 {
    distances.iter().fold(FAR, |least, d| least.min(*d))
}

/// Squared distances of the boxes of tiles.
#[inline(always)]
fn box_distances(tiles: &Tiles, query: &[f32; 3]) -> [f32; WIDTH] {
    let mut distances = [0.0; WIDTH];
    for ((min, max), query) in tiles.min.iter().zip(&tiles.max).zip(query) {
        for ((distance, min), max) in distances.iter_mut().zip(min).zip(max) {
            let (below, above) = (min - query, query - max);
            let gap = if below > above { below } else { above };
            let gap = if gap > 0.0 { gap } else { 0.0 };
            *distance += gap * gap;
        }
    }
    distances
}

#[inline(always)]
fn distances(block: &Block, query: &[f32; 3]) -> [f32; WIDTH] {
    let mut distances = [0.0; WIDTH];
    for lane in 0..WIDTH {
        let (x, y, z) = (
            query[0] - block[0][lane],
            query[1] - block[1][lane],
            query[2] - block[2][lane],
        );
        distances[lane] = x * x + y * y + z * z;
    }
    distances
}

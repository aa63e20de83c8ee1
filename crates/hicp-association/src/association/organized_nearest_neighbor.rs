//! Nearest neighbours found in the image.

use hicp_core::internal::{VectorLoop, vectorized};
use hicp_core::{
    Context, Correspondences, Isometry3, Observation, Pair, Point3, RigidTransform, Surfel,
    UnitVector3, Vector3,
};

use crate::association::data_association::DataAssociation;
use crate::association::pixel_projection::{PixelProjection, whole};
use crate::scratch::Scratch;
use crate::search::point_grid::{PointGrid, Window};
use crate::search::wide_tree::Nearest;
use crate::stride::Stride;

/// Pairs every model point with the closest observed point, as `NearestNeighbor` does (§III-A.1; Besl & McKay 1992), by looking
/// where in the image it can be.
///
/// A depth image is sorted already. The last match of a point, or what lies about the pixel that it projects to, is at some distance
/// d; anything nearer is inside a ball of radius d, and the ball is seen inside a window of pixels (its size is f d / z). Near an aligned
/// surface that is a few pixels, faster to look at than a tree is to descend. Where the window is large, tiles of 8 × 8 pixels
/// are asked first, each a box about its points. There is no tree to build.
///
/// The pairs are exact, those of [`crate::WarmNearestNeighbor`] to the bit: of equally near points the first in the image is taken. Use it with a
/// selection of visible points, and without a stride: for points on the far side of the object, whose windows are large, a tree is faster.
///
/// Cost: O(pixels of the box) once per observation, then O((f d / z)²) per point, d its distance from the observed surface; the tiles divide
/// that by some fifty.
#[derive(Clone, Debug, PartialEq)]
pub struct OrganizedNearestNeighbor {
    /// Which observed pixels are searched.
    pub targets: Stride,
    /// Per point of the source, the slot of the grid that it was paired with last.
    last: Scratch<Vec<u32>>,
}

impl OrganizedNearestNeighbor {
    /// Makes the association.
    #[must_use]
    pub fn new(targets: Stride) -> Self {
        Self {
            targets,
            last: Scratch::default(),
        }
    }
}

impl Default for OrganizedNearestNeighbor {
    /// Every observed point, as §III-A.1 has it.
    fn default() -> Self {
        Self::new(Stride::Pixels(1))
    }
}

impl DataAssociation for OrganizedNearestNeighbor {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        camera_from_object: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        let Some(observation) = context.problem.observation() else {
            return;
        };
        let grid = PointGrid::of(observation, self.targets);
        if grid.size().contains(&0) {
            return;
        }
        let last = &mut self.last.0;
        // Any slot is a valid start, so what another run left behind costs time at worst.
        last.resize(source.len(), u32::MAX);
        pairs.reserve(source.len());
        vectorized(Search {
            observation,
            view: View::new(observation, &grid),
            grid: &grid,
            mover: RigidTransform::new(camera_from_object),
            source,
            last,
            pairs,
        });
    }

    fn name(&self) -> &'static str {
        // The same pairs have the same name in a trace.
        "nearest-neighbor"
    }
}

/// Points that are moved and projected at a time.
const LANES: usize = 16;

/// One number per point.
type Lanes = [f32; LANES];

/// Blocks of eight cells up to which a window is searched whole; beyond it by its tiles.
const MOST_BLOCKS: usize = 24;

/// Half the side of the window, cells, in which a first neighbour is looked for about the pixel that a point projects to.
const FIRST_WINDOW: f32 = 4.0;

/// How far rounding may move a projection, cells: a position in an accepted image is right to 1e-3 of a pixel.
const MARGIN: f32 = 0.02;

struct Search<'a> {
    observation: &'a Observation,
    view: View,
    grid: &'a PointGrid,
    mover: RigidTransform,
    source: &'a [Surfel],
    last: &'a mut [u32],
    pairs: &'a mut Correspondences,
}

impl VectorLoop for Search<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let blocks = self.source.chunks(LANES).zip(self.last.chunks_mut(LANES));
        for ((block, last), first) in blocks.zip((0_u32..).step_by(LANES)) {
            // Lanes beyond the last point lie in the camera plane, and are not searched.
            let (mut points, mut normals) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
            for (lane, surfel) in block.iter().enumerate() {
                for axis in 0..3 {
                    points[axis][lane] = surfel.point[axis];
                    normals[axis][lane] = surfel.normal[axis];
                }
            }
            let points = self.mover.points(&points);
            let normals = self.mover.vectors(&normals);
            let seen = self.view.see(&points);
            let mut limits = [f32::INFINITY; LANES];
            for (lane, last) in last.iter_mut().enumerate() {
                if *last == u32::MAX {
                    *last = self.grid.slot_near([seen[0][lane], seen[1][lane]]);
                }
                limits[lane] = self.grid.distance_squared(&query(&points, lane), *last);
            }
            let windows = self.view.windows(&seen, &points[2], &limits);
            for (lane, last) in last.iter_mut().enumerate() {
                let query = query(&points, lane);
                let window = windows.get(lane);
                let found = match window {
                    Some(window) => search(self.grid, &query, &window, limits[lane]),
                    None => vectorized(FromNothing {
                        grid: self.grid,
                        view: &self.view,
                        query: &query,
                        cell: [seen[0][lane], seen[1][lane]],
                    }),
                };
                let Some(found) = found else { continue };
                *last = found.element;
                let target_index = self.grid.index(found.element);
                let Some(target) = self.observation.surfel(target_index) else {
                    continue;
                };
                #[allow(clippy::cast_possible_truncation)] // Below LANES.
                let source_index = first + lane as u32;
                let source = Surfel {
                    point: Point3::from(query),
                    normal: UnitVector3::new_unchecked(Vector3::new(
                        normals[0][lane],
                        normals[1][lane],
                        normals[2][lane],
                    )),
                };
                self.pairs
                    .push(Pair::new(source_index, source, target_index, *target));
            }
        }
    }
}

#[inline(always)]
fn query(points: &[Lanes; 3], lane: usize) -> [f32; 3] {
    [points[0][lane], points[1][lane], points[2][lane]]
}

/// The nearest neighbour of a point that has none to begin with, or that is close to the camera or behind it.
struct FromNothing<'a> {
    grid: &'a PointGrid,
    view: &'a View,
    query: &'a [f32; 3],
    cell: [f32; 2],
}

impl VectorLoop for FromNothing<'_> {
    type Output = Option<Nearest>;

    #[inline(always)]
    fn run(self) -> Option<Nearest> {
        let Self {
            grid,
            view,
            query,
            cell: [u, v],
        } = self;
        if !query.iter().all(|x| x.is_finite()) {
            return None;
        }
        // What is found about its pixel bounds the search: a wrong pixel costs time.
        let (from, to) = (
            [[u - FIRST_WINDOW], [v - FIRST_WINDOW]],
            [[u + FIRST_WINDOW], [v + FIRST_WINDOW]],
        );
        let near = view
            .between(&from, &to)
            .get(0)
            .and_then(|window| grid.nearest(query, &window));
        let limit = near.map_or(f32::INFINITY, |near| near.distance_squared);
        let window = view
            .windows(&[[u], [v]], &[query[2]], &[limit])
            .get(0)
            .unwrap_or(grid.everywhere());
        search(grid, query, &window, limit)
    }
}

/// Returns the nearest point of a window, which is at most `limit` (squared) away.
#[inline(always)]
fn search(grid: &PointGrid, query: &[f32; 3], window: &Window, limit: f32) -> Option<Nearest> {
    if PointGrid::blocks_in(window) <= MOST_BLOCKS {
        grid.nearest(query, window)
    } else {
        grid.nearest_by_tiles(query, window, limit)
    }
}

/// Where in the grid points are seen.
struct View {
    projection: PixelProjection,
    /// Cells of the grid per slope x/z or y/z.
    focal: [f32; 2],
    /// Pixel of the first cell, and that of the optical axis.
    corner: [f32; 2],
    center: [f32; 2],
    cells_per_pixel: f32,
    /// Columns and rows.
    size: [f32; 2],
}

/// The first and last column and row for each of some points; none where the first is beyond the last.
struct Windows<const N: usize> {
    first: [[u32; N]; 2],
    last: [[u32; N]; 2],
}

impl<const N: usize> Windows<N> {
    #[inline(always)]
    fn get(&self, lane: usize) -> Option<Window> {
        let [columns, rows] =
            [0, 1].map(|axis| [self.first[axis][lane], self.last[axis][lane]].map(|x| x as usize));
        (columns[0] <= columns[1] && rows[0] <= rows[1]).then_some(Window { columns, rows })
    }
}

impl View {
    #[allow(clippy::cast_possible_truncation)] // Single precision is that of buffers.
    fn new(observation: &Observation, grid: &PointGrid) -> Self {
        let camera = observation.camera();
        let cells_per_pixel = 1.0 / grid.stride() as f32;
        Self {
            projection: PixelProjection::new(camera),
            focal: [camera.fx(), camera.fy()].map(|focal| focal as f32 * cells_per_pixel),
            corner: grid.corner().map(|pixel| pixel as f32),
            center: [camera.cx(), camera.cy()].map(|center| center as f32),
            cells_per_pixel,
            size: grid.size().map(|count| count as f32),
        }
    }

    /// The cells that points are seen in, of no meaning where z is not positive and finite.
    #[inline(always)]
    fn see(&self, points: &[Lanes; 3]) -> [Lanes; 2] {
        let (us, vs) = self.projection.project_all(points);
        let mut cells = [us, vs];
        for (cells, corner) in cells.iter_mut().zip(self.corner) {
            for cell in cells {
                *cell = (*cell - corner) * self.cells_per_pixel;
            }
        }
        cells
    }

    /// Returns the windows outside of which nothing is seen that is nearer to a point than a (squared) distance; none where a ball of that radius
    /// comes close to the camera.
    ///
    /// With q the point and p one at most d from it, |pₓ/p_z − qₓ/q_z| = |(pₓ − qₓ) − (p_z − q_z) qₓ/q_z| / p_z ≤ d √(1 + (qₓ/q_z)²) / (q_z − d).
    #[inline(always)]
    fn windows<const N: usize>(
        &self,
        seen: &[[f32; N]; 2],
        z: &[f32; N],
        limits: &[f32; N],
    ) -> Windows<N> {
        let mut slopes = [0.0; N];
        for ((slope, limit), z) in slopes.iter_mut().zip(limits).zip(z) {
            let distance = limit.sqrt() * (1.0 + 1e-6);
            let nearest = z - distance;
            // Adds nothing, or what no window is made of: a NaN. False for one.
            let clear = nearest > 0.1 * z;
            *slope = distance / nearest + f32::from_bits(u32::from(clear).wrapping_sub(1) & NAN);
        }
        let (mut from, mut to) = ([[0.0; N]; 2], [[0.0; N]; 2]);
        for axis in 0..2 {
            for lane in 0..N {
                let cell = seen[axis][lane];
                // The slope x/z or y/z of the pixel, times the focal length.
                let off = cell * self.per_cell() + (self.corner[axis] - self.center[axis]);
                let off = off * self.cells_per_pixel;
                let focal = self.focal[axis];
                let half = slopes[lane] * (focal * focal + off * off).sqrt() + MARGIN;
                from[axis][lane] = cell - half;
                to[axis][lane] = cell + half;
            }
        }
        self.between(&from, &to)
    }

    /// Pixels per cell.
    #[inline(always)]
    fn per_cell(&self) -> f32 {
        1.0 / self.cells_per_pixel
    }

    /// Returns the cells from `from` to `to` as far as there are any; none for NaN.
    #[inline(always)]
    fn between<const N: usize>(&self, from: &[[f32; N]; 2], to: &[[f32; N]; 2]) -> Windows<N> {
        let mut windows = Windows {
            first: [[0; N]; 2],
            last: [[0; N]; 2],
        };
        for axis in 0..2 {
            // Beyond the last cell there is none.
            let (count, most) = (self.size[axis], self.size[axis] - 1.0);
            for lane in 0..N {
                let (from, to) = (from[axis][lane], to[axis][lane]);
                let from = if from > 0.0 { from } else { 0.0 };
                // `count` too for NaN.
                let from = if from < count { from } else { count };
                let nothing = u32::from(to >= 0.0).wrapping_sub(1);
                let to = if to < most { to } else { most };
                windows.first[axis][lane] = whole(from.ceil()) | nothing;
                windows.last[axis][lane] = whole(to.floor()) & !nothing;
            }
        }
        windows
    }
}

/// The bits of a number that is none.
const NAN: u32 = f32::NAN.to_bits();

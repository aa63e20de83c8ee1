//! Points of a model, drawn into a coarse depth buffer.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use hicp_core::internal::{VectorLoop, whole};
use hicp_core::{Isometry3, Model, PinholeCamera, Sides, Surfel};

use crate::mve::coarse_grid::PADDING;

/// Number of points projected at once.
const LANES: usize = PADDING;

/// Points by coordinate, object frame. The last ones are padded with points that are not numbers.
pub(crate) struct Block {
    points: [[f32; LANES]; 3],
}

impl Block {
    fn new(surfels: &[Surfel]) -> Self {
        let mut block = Self {
            points: [[f32::NAN; LANES]; 3],
        };
        for (lane, surfel) in surfels.iter().enumerate() {
            for axis in 0..3 {
                block.points[axis][lane] = surfel.point[axis];
            }
        }
        block
    }
}

/// The points of the sides of a model, in blocks.
pub(crate) struct Blocks {
    sides: Arc<Sides>,
    blocks: [OnceLock<Vec<Block>>; Sides::COUNT],
}

impl Blocks {
    /// Returns the blocks of a model with about `count` points per side. They are shared.
    pub(crate) fn of(model: &Model, count: usize) -> Arc<Self> {
        model.derived().get_or_build(count as u64, || Self {
            sides: Sides::of(model, count),
            blocks: [const { OnceLock::new() }; Sides::COUNT],
        })
    }

    /// Returns the points of the side that faces the camera at a pose.
    pub(crate) fn facing(&self, camera_from_object: &Isometry3<f64>) -> &[Block] {
        let side = self.sides.facing(camera_from_object);
        self.blocks[side.index].get_or_init(|| side.surfels.chunks(LANES).map(Block::new).collect())
    }
}

/// The pixels of a block of points, and the inverse depths there.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Drawn {
    pixels: [u32; LANES],
    inverses: [f32; LANES],
}

/// The least and the greatest number of each lane.
struct Extent {
    least: [f32; LANES],
    greatest: [f32; LANES],
}

impl Extent {
    const EMPTY: Self = Self {
        least: [f32::INFINITY; LANES],
        greatest: [0.0; LANES],
    };

    /// Includes numbers from 0 on. In lanes without one, `low` is at least the image's side and
    /// `high` is 0.
    #[inline(always)]
    fn include(&mut self, low: &[f32; LANES], high: &[f32; LANES]) {
        for lane in 0..LANES {
            let (least, greatest) = (self.least[lane], self.greatest[lane]);
            self.least[lane] = if low[lane] < least { low[lane] } else { least };
            self.greatest[lane] = if high[lane] > greatest {
                high[lane]
            } else {
                greatest
            };
        }
    }

    /// Returns the whole parts of the numbers of all lanes, empty if there is no number.
    #[inline(never)] // Otherwise the compiler mixes the lanes of several extents.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // Pixels of an image.
    fn range(&self) -> Range<usize> {
        let least = self.least.iter().fold(f32::INFINITY, |a, b| a.min(*b));
        let greatest = self.greatest.iter().fold(0.0, |a: f32, b| a.max(*b));
        least as usize..greatest as usize + 1
    }
}

/// The loop that writes the nearest point of every pixel.
///
/// It returns the columns and rows of a rectangle that contains the written pixels.
///
/// It has no branches: whether a point is the nearest of its pixel is as good as random. Points
/// outside the image write zeros below its last row, where no write waits for another.
pub(crate) struct Splat<'a> {
    pub(crate) blocks: &'a [Block],
    pub(crate) camera: &'a PinholeCamera,
    /// Number of pixels from one row of the buffer to the next.
    pub(crate) stride: usize,
    pub(crate) pose: &'a Isometry3<f64>,
    /// The rows of the image, and [`PADDING`] more pixels.
    pub(crate) buffer: &'a mut [f32],
    /// Scratch memory.
    pub(crate) drawn: &'a mut Vec<Drawn>,
}

impl VectorLoop for Splat<'_> {
    type Output = [Range<usize>; 2];

    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
    fn run(self) -> [Range<usize>; 2] {
        let camera = self.camera;
        let [fx, fy, cx, cy] =
            [camera.fx(), camera.fy(), camera.cx(), camera.cy()].map(|value| value as f32);
        let (width, height) = (camera.width() as f32, camera.height() as f32);
        let stride = self.stride as u32;
        let (mut columns, mut rows) = (Extent::EMPTY, Extent::EMPTY);
        let pose: Isometry3<f32> = self.pose.cast();
        let rotation = pose.rotation.to_rotation_matrix();
        let shift = pose.translation.vector;
        self.drawn.clear();
        self.drawn.reserve(self.blocks.len());
        for block in self.blocks {
            let [x, y, z] = &block.points;
            let mut drawn = Drawn {
                pixels: [0; LANES],
                inverses: [0.0; LANES],
            };
            let (mut left, mut right) = ([0.0; LANES], [0.0; LANES]);
            let (mut top, mut bottom) = ([0.0; LANES], [0.0; LANES]);
            for lane in 0..LANES {
                let moved = |row: usize| {
                    rotation[(row, 0)] * x[lane]
                        + rotation[(row, 1)] * y[lane]
                        + rotation[(row, 2)] * z[lane]
                        + shift[row]
                };
                let depth = moved(2);
                let inverse = 1.0 / depth;
                let u = fx * moved(0) * inverse + cx + 0.5;
                let v = fy * moved(1) * inverse + cy + 0.5;
                // False for NaN.
                let inside =
                    (depth > f32::EPSILON) & (u >= 0.0) & (v >= 0.0) & (u < width) & (v < height);
                let choose = |one: f32, other: f32| if inside { one } else { other };
                drawn.inverses[lane] = choose(inverse, 0.0);
                (left[lane], right[lane]) = (choose(u, f32::INFINITY), choose(u, 0.0));
                (top[lane], bottom[lane]) = (choose(v, height), choose(v, 0.0));
                // Below the last row, each lane has a pixel of its own.
                let column = choose(u, lane as f32);
                drawn.pixels[lane] = whole(top[lane])
                    .wrapping_mul(stride)
                    .wrapping_add(whole(column));
            }
            columns.include(&left, &right);
            rows.include(&top, &bottom);
            self.drawn.push(drawn);
        }
        for Drawn { pixels, inverses } in self.drawn.iter() {
            for (pixel, inverse) in pixels.iter().zip(inverses) {
                let nearest = &mut self.buffer[*pixel as usize];
                *nearest = if *inverse > *nearest {
                    *inverse
                } else {
                    *nearest
                };
            }
        }
        [columns.range(), rows.range()]
    }
}

//! Samples of a model, drawn into a coarse depth buffer.

use std::ops::Range;
use std::sync::Arc;

use hicp_core::internal::{VectorLoop, whole};
use hicp_core::{Isometry3, Model, PinholeCamera, Surfel, sample_surface};

use crate::mve::coarse_grid::PADDING;

/// Number of samples projected at once.
const LANES: usize = PADDING;

/// Points and normals of some samples, by coordinate.
///
/// The last ones are padded with points that are not numbers. Neighbors have similar normals, so
/// that many blocks face away with all their samples.
struct Block {
    points: [[f32; LANES]; 3],
    normals: [[f32; LANES]; 3],
}

/// The samples of a model.
pub(crate) struct Samples {
    blocks: Vec<Block>,
    /// `true` if normals are certain to point out of the object.
    oriented: bool,
}

impl Samples {
    /// Returns the samples of a model. They are computed once and shared.
    pub(crate) fn of(model: &Model, samples: usize) -> Arc<Self> {
        model.derived().get_or_build(samples as u64, || {
            let mut surfels = sample_surface(model.mesh(), samples);
            surfels.sort_by_key(direction);
            Self {
                blocks: surfels.chunks(LANES).map(Block::new).collect(),
                oriented: model.mesh().is_closed(),
            }
        })
    }
}

/// Returns a number that is similar for similar normals: a cell on a cube around the origin.
fn direction(surfel: &Surfel) -> (usize, bool, [i32; 2]) {
    let normal = surfel.normal;
    let axis = normal.iamax();
    #[allow(clippy::cast_possible_truncation)] // From −2 to 2.
    let cell = |step: usize| (2.9 * normal[(axis + step) % 3] / normal[axis].abs()) as i32;
    (axis, normal[axis] > 0.0, [cell(1), cell(2)])
}

impl Block {
    fn new(surfels: &[Surfel]) -> Self {
        let mut block = Self {
            points: [[f32::NAN; LANES]; 3],
            normals: [[0.0; LANES]; 3],
        };
        for (lane, surfel) in surfels.iter().enumerate() {
            for axis in 0..3 {
                block.points[axis][lane] = surfel.point[axis];
                block.normals[axis][lane] = surfel.normal[axis];
            }
        }
        block
    }
}

/// The pixels of a block of samples, and the inverse depths there.
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

/// The loop that writes the nearest sample of every pixel.
///
/// It returns the columns and rows of a rectangle that contains the written pixels.
///
/// It has no branches: whether a sample is the nearest of its pixel is as good as random. Samples
/// outside the image write zeros below its last row, where no write waits for another.
pub(crate) struct Splat<'a> {
    pub(crate) samples: &'a Samples,
    pub(crate) camera: &'a PinholeCamera,
    pub(crate) pose: &'a Isometry3<f64>,
    /// The pixels of the image, and [`PADDING`] more.
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
        let stride = camera.width();
        let (mut columns, mut rows) = (Extent::EMPTY, Extent::EMPTY);
        let eye = self.pose.inverse().translation.vector.cast::<f32>();
        let pose: Isometry3<f32> = self.pose.cast();
        let rotation = pose.rotation.to_rotation_matrix();
        let shift = pose.translation.vector;
        // No number is at or above NaN.
        let limit = if self.samples.oriented { 0.0 } else { f32::NAN };
        self.drawn.clear();
        self.drawn.reserve(self.samples.blocks.len());
        for block in &self.samples.blocks {
            let ([x, y, z], [a, b, c]) = (&block.points, &block.normals);
            let mut away = [0.0; LANES];
            for lane in 0..LANES {
                away[lane] = a[lane] * (x[lane] - eye.x)
                    + b[lane] * (y[lane] - eye.y)
                    + c[lane] * (z[lane] - eye.z);
            }
            if away.iter().all(|away| *away >= limit) {
                continue;
            }
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
                let faces_away = away[lane] >= limit;
                // False for NaN.
                let inside = (depth > f32::EPSILON)
                    & (u >= 0.0)
                    & (v >= 0.0)
                    & (u < width)
                    & (v < height)
                    & !faces_away;
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

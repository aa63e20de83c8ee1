//! The mean VSD estimate from samples of the model instead of a render.

use std::sync::Arc;

use hicp_core::internal::{VectorLoop, vectorized, whole};
use hicp_core::{
    Context, Isometry3, Model, Observation, PinholeCamera, Problem, Surfel, sample_surface,
};

use crate::mve::coarse_grid::CoarseGrid;
use crate::mve::mask_trust::MaskTrust;
use crate::mve::occlusion::Occlusion;
use crate::score::Score;
use crate::tolerances::N_TOLERANCES;

/// An estimate of the MVE at low resolution, for ranking many poses.
///
/// It splats points of the model's surface into a coarse depth buffer and compares the buffer with
/// the observation, as [`MeanVsd`](crate::MeanVsd) compares a render. It costs about 3 µs for
/// every mesh. It does not replace the MVE for accepting or reporting a pose: pixels without a
/// sample count as not rendered, and thin parts may be missed. Samples of a closed mesh that face
/// away from the camera are skipped.
///
/// Cost: O(samples) per pose. The samples are computed once per model and shared, and so is the
/// coarse observation.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledMve {
    /// Number of points on the model; 0 scores every pose 1.
    pub samples: usize,
    /// Approximate number of compared pixels of the mask.
    pub pixels: usize,
    /// The splatted pixels outside the mask that count against the pose.
    pub occlusion: Occlusion,
    /// The trust in the mask, as in [`MeanVsd`](crate::MeanVsd).
    pub mask: MaskTrust,
    /// The inverse depth of the coarse image's pixels, and of one beyond it; all 0 between two
    /// poses.
    buffer: Vec<f32>,
    /// The pixels of the buffer that were written, and then anything.
    touched: Vec<u32>,
}

impl SampledMve {
    /// Creates the score with the default occlusion.
    #[must_use]
    pub fn new(samples: usize, pixels: usize) -> Self {
        Self {
            samples,
            pixels,
            occlusion: Occlusion::default(),
            mask: MaskTrust::Exact,
            buffer: Vec::new(),
            touched: Vec::new(),
        }
    }

    /// Creates the default score for masks that miss a part of the object, like
    /// [`MeanVsd::lenient`](crate::MeanVsd::lenient).
    #[must_use]
    pub fn lenient() -> Self {
        Self {
            occlusion: Occlusion::LENIENT,
            ..Self::default()
        }
    }

    /// Creates the default score for the masks of detectors, like
    /// [`MeanVsd::imperfect_mask`](crate::MeanVsd::imperfect_mask).
    #[must_use]
    pub fn imperfect_mask() -> Self {
        Self {
            mask: MaskTrust::Imperfect,
            ..Self::default()
        }
    }

    /// Returns the factor between the resolutions of the image and the buffer.
    fn factor(&self, observation: &Observation) -> u32 {
        let ratio = observation.n_measured() as f64 / self.pixels.max(1) as f64;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // At most √(2³⁰), not negative.
        let factor = ratio.sqrt().round() as u32;
        factor.max(1)
    }

    /// Fills the buffer at a pose, and returns the number of touched pixels.
    fn splat(&mut self, camera: &PinholeCamera, surface: &Surface, pose: &Isometry3<f64>) -> usize {
        let pixels = camera.width() as usize * camera.height() as usize;
        if self.buffer.len() <= pixels {
            self.buffer.resize(pixels + 1, 0.0);
        }
        // Every pixel once, and one write more that does not count.
        if self.touched.len() <= pixels {
            self.touched.resize(pixels + 1, 0);
        }
        vectorized(Splat {
            surface,
            camera,
            pose,
            buffer: &mut self.buffer[..=pixels],
            touched: &mut self.touched,
        })
    }

    /// Compares the first `n_touched` touched pixels with the observation, and clears them.
    fn compare(&mut self, n_touched: usize, grid: &CoarseGrid, diameter: f64) -> f64 {
        let hidden_beyond = match grid.seen_through_meters {
            Some(meters) => -meters,
            None => self.occlusion.least_distance_behind(),
        };
        // The tolerances are multiples of a twentieth of the diameter.
        #[allow(clippy::cast_possible_truncation)] // f32 is the precision of depth.
        let (per_meter, hidden_beyond) = ((20.0 / diameter) as f32, hidden_beyond as f32);
        let most = N_TOLERANCES as f32;
        // The weights of pixels that agree, summed over the tolerances.
        let (mut agreement, mut outside) = (0, 0);
        for &index in &self.touched[..n_touched] {
            let pixel = &grid.pixels[index as usize];
            let inverse = std::mem::take(&mut self.buffer[index as usize]);
            let behind = (1.0 / inverse - pixel.measured) * pixel.distance_per_depth;
            let known = pixel.measured > 0.0;
            // A pixel agrees within a tolerance if it differs by less.
            let beyond = whole((behind.abs() * per_meter).min(most));
            let agrees = u64::from(known) * (N_TOLERANCES as u64 - u64::from(beyond));
            agreement += agrees * pixel.weight;
            let hidden = known & (behind > hidden_beyond);
            outside += u64::from(!hidden) * (grid.one - pixel.weight);
        }
        if grid.total == 0 {
            return 1.0;
        }
        let most = N_TOLERANCES as u64 * (grid.total + outside);
        (most - agreement) as f64 / most as f64
    }
}

impl Default for SampledMve {
    /// 1500 points and about 200 pixels.
    fn default() -> Self {
        Self::new(1500, 200)
    }
}

impl Score for SampledMve {
    fn score(&mut self, context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> f64 {
        let Some((model, observation)) = context.problem.sides() else {
            return 1.0;
        };
        let coarse = observation.decimated(self.factor(observation));
        let diameter = model.diameter();
        let grid = match self.mask {
            MaskTrust::Exact => CoarseGrid::exact(observation, &coarse),
            MaskTrust::Imperfect => CoarseGrid::imperfect(observation, &coarse, diameter),
        };
        let surface = Surface::of(model, self.samples);
        let n_touched = self.splat(coarse.camera(), &surface, camera_from_object);
        self.compare(n_touched, &grid, diameter)
    }

    fn name(&self) -> &'static str {
        "sampled-mve"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        problem.without_mesh_or_image(self.name())
    }
}

/// Number of samples projected at once.
const LANES: usize = 16;

/// Points and normals of some samples, by coordinate.
///
/// The last ones are padded with points that are not numbers. Neighbors have similar normals, so
/// that many blocks face away with all their samples.
struct Block {
    points: [[f32; LANES]; 3],
    normals: [[f32; LANES]; 3],
}

/// The samples of a model.
struct Surface {
    blocks: Vec<Block>,
    /// `true` if normals are certain to point out of the object.
    oriented: bool,
}

impl Surface {
    fn of(model: &Model, samples: usize) -> Arc<Self> {
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

/// The loop that writes the nearest sample of every pixel.
///
/// It has no branches: whether a sample is the first of its pixel, or the nearest, is as good as
/// random. Samples outside the image write nothing into the buffer's last pixel.
struct Splat<'a> {
    surface: &'a Surface,
    camera: &'a PinholeCamera,
    pose: &'a Isometry3<f64>,
    /// The pixels of the image, and one more.
    buffer: &'a mut [f32],
    touched: &'a mut [u32],
}

impl VectorLoop for Splat<'_> {
    /// The number of touched pixels.
    type Output = usize;

    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
    fn run(self) -> usize {
        let camera = self.camera;
        let [fx, fy, cx, cy] =
            [camera.fx(), camera.fy(), camera.cx(), camera.cy()].map(|value| value as f32);
        let (width, height) = (camera.width() as f32, camera.height() as f32);
        let stride = camera.width();
        let outside = stride * camera.height();
        let mut n_touched = 0;
        let eye = self.pose.inverse().translation.vector.cast::<f32>();
        let pose: Isometry3<f32> = self.pose.cast();
        let rotation = pose.rotation.to_rotation_matrix();
        let shift = pose.translation.vector;
        for block in &self.surface.blocks {
            let ([x, y, z], [a, b, c]) = (&block.points, &block.normals);
            let mut away = [0.0; LANES];
            for lane in 0..LANES {
                away[lane] = a[lane] * (x[lane] - eye.x)
                    + b[lane] * (y[lane] - eye.y)
                    + c[lane] * (z[lane] - eye.z);
            }
            if self.surface.oriented && away.iter().all(|away| *away >= 0.0) {
                continue;
            }
            let (mut pixels, mut inverses) = ([outside; LANES], [0.0; LANES]);
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
                let inside = (depth > f32::EPSILON)
                    & (u >= 0.0)
                    & (v >= 0.0)
                    & (u < width)
                    & (v < height)
                    & !(self.surface.oriented & (away[lane] >= 0.0));
                let pixel = whole(v).wrapping_mul(stride).wrapping_add(whole(u));
                pixels[lane] = if inside { pixel } else { outside };
                inverses[lane] = if inside { inverse } else { 0.0 };
            }
            for (pixel, inverse) in pixels.into_iter().zip(inverses) {
                let nearest = &mut self.buffer[pixel as usize];
                self.touched[n_touched] = pixel;
                n_touched += usize::from((*nearest <= 0.0) & (inverse > 0.0));
                *nearest = if inverse > *nearest {
                    inverse
                } else {
                    *nearest
                };
            }
        }
        n_touched
    }
}

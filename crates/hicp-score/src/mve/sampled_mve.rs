//! The mean VSD estimate from samples of the model instead of a render.

use std::sync::Arc;

use hicp_core::internal::{VectorLoop, vectorized, whole};
use hicp_core::{
    Context, Isometry3, Model, Observation, PinholeCamera, PixelRegion, Problem, Surfel,
    sample_surface,
};

use crate::mve::coarse_grid::CoarseGrid;
use crate::mve::mask_trust::MaskTrust;
use crate::mve::occlusion::Occlusion;
use crate::score::Score;
use crate::tolerances::N_TOLERANCES;

/// An estimate of the MVE at low resolution, for ranking many poses.
///
/// It splats points of the model's surface into a coarse depth buffer and compares the buffer with
/// the observation, as [`MeanVsd`](crate::MeanVsd) compares a render. It costs about 2 µs for every
/// mesh. It does not replace the MVE for accepting or reporting a pose: pixels without a
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
    /// The depth buffer of the coarse image; all infinite between two poses.
    ///
    /// After its pixels come entries for those that do not exist: [`LANES`] beyond the last row,
    /// and one for samples outside of the image per lane.
    buffer: Vec<f32>,
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

    /// Fills the depth buffer at a pose, and returns the region that was written.
    fn splat(
        &mut self,
        camera: &PinholeCamera,
        surface: &Surface,
        pose: &Isometry3<f64>,
    ) -> PixelRegion {
        let size = camera.width() as usize * camera.height() as usize + 2 * LANES;
        if self.buffer.len() != size {
            self.buffer.clear();
            self.buffer.resize(size, f32::INFINITY);
        }
        vectorized(Splat {
            surface,
            camera,
            pose,
            buffer: &mut self.buffer,
        })
    }

    /// Compares a region of the depth buffer with the observation, and clears it.
    fn compare(&mut self, grid: &CoarseGrid, region: PixelRegion, diameter: f64) -> f64 {
        let hidden_beyond = match grid.seen_through_meters {
            Some(meters) => -meters,
            None => self.occlusion.least_distance_behind(),
        };
        let (agreement, outside) = vectorized(Compare {
            grid,
            region,
            buffer: &mut self.buffer,
            diameter,
            hidden_beyond,
        });
        let union = grid.total + outside;
        if grid.total == 0 {
            return 1.0;
        }
        1.0 - agreement as f64 / (N_TOLERANCES as f64 * union as f64)
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
        let region = self.splat(coarse.camera(), &surface, camera_from_object);
        self.compare(&grid, region, diameter)
    }

    fn name(&self) -> &'static str {
        "sampled-mve"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        problem.without_mesh_or_image(self.name())
    }
}

/// Number of samples projected at once, and of pixels compared at once.
pub(crate) const LANES: usize = 16;

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
            surfels.sort_by_key(|surfel| direction(surfel));
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
    #[allow(clippy::cast_possible_truncation)] // From −3 to 3.
    let cell = |step: usize| (3.0 * normal[(axis + step) % 3] / normal[axis].abs()) as i32;
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
struct Splat<'a> {
    surface: &'a Surface,
    camera: &'a PinholeCamera,
    pose: &'a Isometry3<f64>,
    buffer: &'a mut [f32],
}

impl VectorLoop for Splat<'_> {
    type Output = PixelRegion;

    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
    fn run(self) -> PixelRegion {
        let camera = self.camera;
        let [fx, fy, cx, cy] =
            [camera.fx(), camera.fy(), camera.cx(), camera.cy()].map(|value| value as f32);
        let (width, height) = (camera.width() as f32, camera.height() as f32);
        let stride = camera.width();
        let eye = self.pose.inverse().translation.vector.cast::<f32>();
        let pose: Isometry3<f32> = self.pose.cast();
        let rotation = pose.rotation.to_rotation_matrix();
        let shift = pose.translation.vector;
        let unused = self.buffer.len() - LANES;
        // The least and greatest place in the image per lane.
        let (mut low, mut high) = ([[f32::MAX; LANES]; 2], [[-1.0_f32; LANES]; 2]);
        for block in &self.surface.blocks {
            let ([x, y, z], [a, b, c]) = (&block.points, &block.normals);
            let mut away = [0.0; LANES];
            for lane in 0..LANES {
                away[lane] = a[lane] * (x[lane] - eye.x)
                    + b[lane] * (y[lane] - eye.y)
                    + c[lane] * (z[lane] - eye.z);
            }
            if self.surface.oriented && away.iter().fold(true, |all, away| all & (*away >= 0.0)) {
                continue;
            }
            let (mut pixels, mut depths) = ([0; LANES], [0.0; LANES]);
            for lane in 0..LANES {
                let moved = |row: usize| {
                    rotation[(row, 0)] * x[lane]
                        + rotation[(row, 1)] * y[lane]
                        + rotation[(row, 2)] * z[lane]
                        + shift[row]
                };
                let depth = moved(2);
                let u = fx * moved(0) / depth + cx + 0.5;
                let v = fy * moved(1) / depth + cy + 0.5;
                // False for NaN.
                let inside = (depth > f32::EPSILON)
                    & (u >= 0.0)
                    & (v >= 0.0)
                    & (u < width)
                    & (v < height)
                    & !(self.surface.oriented & (away[lane] >= 0.0));
                for (axis, at) in [u, v].into_iter().enumerate() {
                    let (low, high) = (&mut low[axis][lane], &mut high[axis][lane]);
                    *low = if inside & (at < *low) { at } else { *low };
                    *high = if inside & (at > *high) { at } else { *high };
                }
                let pixel = whole(v).wrapping_mul(stride).wrapping_add(whole(u));
                pixels[lane] = if inside {
                    pixel as usize
                } else {
                    unused + lane
                };
                depths[lane] = depth;
            }
            for lane in 0..LANES {
                let nearest = &mut self.buffer[pixels[lane]];
                *nearest = if depths[lane] < *nearest {
                    depths[lane]
                } else {
                    *nearest
                };
            }
        }
        let low = low.map(|lanes| whole(lanes.into_iter().fold(f32::MAX, f32::min)));
        let high = high.map(|lanes| whole(lanes.into_iter().fold(-1.0, f32::max) + 1.0));
        PixelRegion {
            u_min: low[0].min(high[0]),
            v_min: low[1].min(high[1]),
            u_max: high[0],
            v_max: high[1],
        }
    }
}

/// The loop that compares a region with the observation.
struct Compare<'a> {
    grid: &'a CoarseGrid,
    region: PixelRegion,
    buffer: &'a mut [f32],
    diameter: f64,
    hidden_beyond: f64,
}

impl VectorLoop for Compare<'_> {
    /// The weights of the pixels that agree, summed over the tolerances, and of those that count
    /// against the pose.
    type Output = (u64, u64);

    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
    fn run(self) -> (u64, u64) {
        let (grid, region) = (self.grid, self.region);
        // The tolerances are multiples of a twentieth of the diameter.
        let per_meter = (20.0 / self.diameter) as f32;
        let hidden_beyond = self.hidden_beyond as f32;
        let (mut agreement, mut outside) = (0_u64, 0_u64);
        for v in region.v_min as usize..region.v_max as usize {
            let row = v * grid.width;
            // The last pixels may be of the next row. They are then compared here.
            for u in (region.u_min as usize..region.u_max as usize).step_by(LANES) {
                let at = row + u..row + u + LANES;
                let (Some(depth), Some(measured), Some(distance), Some(weights)) = (
                    self.buffer[at.clone()].first_chunk_mut::<LANES>(),
                    grid.measured[at.clone()].first_chunk::<LANES>(),
                    grid.distance_per_depth[at.clone()].first_chunk::<LANES>(),
                    grid.weights[at].first_chunk::<LANES>(),
                ) else {
                    unreachable!("buffer and grid are padded")
                };
                let (mut agrees, mut against) = ([0_u32; LANES], [0_u32; LANES]);
                for lane in 0..LANES {
                    let behind = (depth[lane] - measured[lane]) * distance[lane];
                    let (seen, known) = (depth[lane] < f32::INFINITY, measured[lane] > 0.0);
                    // A pixel agrees within a tolerance if it differs by less.
                    let beyond = behind.abs() * per_meter;
                    let beyond = whole(if beyond < N_TOLERANCES as f32 {
                        beyond
                    } else {
                        N_TOLERANCES as f32
                    });
                    let tolerances = N_TOLERANCES as u32 - beyond;
                    agrees[lane] = if seen & known {
                        weights[lane] * tolerances
                    } else {
                        0
                    };
                    let counts = seen & !(known & (behind > hidden_beyond));
                    against[lane] = if counts { grid.one - weights[lane] } else { 0 };
                }
                *depth = [f32::INFINITY; LANES];
                agreement += u64::from(agrees.iter().sum::<u32>());
                outside += u64::from(against.iter().sum::<u32>());
            }
        }
        (agreement, outside)
    }
}

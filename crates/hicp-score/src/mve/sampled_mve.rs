//! The mean VSD estimate from samples of the model instead of a render.

use hicp_core::internal::vectorized;
use hicp_core::{Context, Isometry3, Observation, Problem};

use crate::mve::coarse_grid::{CoarseGrid, CompareCoarse, PADDING};
use crate::mve::mask_trust::MaskTrust;
use crate::mve::occlusion::Occlusion;
use crate::mve::splat::{Block, Blocks, Drawn, Splat};
use crate::score::Score;
use crate::tolerances::N_TOLERANCES;

/// An estimate of the MVE at low resolution, for ranking many poses.
///
/// It splats the points of the side that faces the camera ([`Sides`](hicp_core::Sides)) into a
/// coarse depth buffer, and compares the buffer with the observation, as
/// [`MeanVsd`](crate::MeanVsd) compares a render. It costs about 2 µs for every mesh. It does not
/// replace the MVE for accepting or reporting a pose: pixels without a point count as not rendered,
/// and thin parts may be missed.
///
/// Cost: O(samples) per pose. The points of a side are chosen once per model, in some 0.1 ms, and
/// shared, and so is the coarse image.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledMve {
    /// Approximate number of points of a side of the model; 0 scores every pose 1.
    ///
    /// Use at least twice the number of coarse pixels that the whole object covers, so that few
    /// pixels stay empty. If a part of the object is hidden, that number is larger than `pixels`.
    pub samples: usize,
    /// Approximate number of compared pixels of the mask.
    pub pixels: usize,
    /// The splatted pixels outside the mask that count against the pose.
    pub occlusion: Occlusion,
    /// The trust in the mask, as in [`MeanVsd`](crate::MeanVsd).
    pub mask: MaskTrust,
    /// The inverse depth of the coarse image's pixels, and zeros after them; all 0 between two
    /// poses.
    buffer: Vec<f32>,
    /// Scratch memory.
    drawn: Vec<Drawn>,
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
            drawn: Vec::new(),
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

    /// Compares points at a pose with the observation.
    fn compare(
        &mut self,
        blocks: &[Block],
        grid: &CoarseGrid,
        pose: &Isometry3<f64>,
        diameter: f64,
    ) -> f64 {
        let length = grid.stride() * grid.camera.height() as usize + PADDING;
        if self.buffer.len() < length {
            self.buffer.resize(length, 0.0);
        }
        let touched = vectorized(Splat {
            blocks,
            camera: &grid.camera,
            stride: grid.stride(),
            pose,
            buffer: &mut self.buffer,
            drawn: &mut self.drawn,
        });
        let hidden_beyond = match grid.seen_through_meters {
            Some(meters) => -meters,
            None => self.occlusion.least_distance_behind(),
        };
        // The tolerances are multiples of a twentieth of the diameter.
        #[allow(clippy::cast_possible_truncation)] // f32 is the precision of depth.
        let (per_meter, hidden_beyond) = ((20.0 / diameter) as f32, hidden_beyond as f32);
        let uncovered = grid.uncovered(&self.buffer);
        let [agreement, outside] = vectorized(CompareCoarse {
            touched,
            buffer: &mut self.buffer,
            grid,
            per_meter,
            hidden_beyond,
        });
        if grid.total == 0 {
            return 1.0;
        }
        let union = grid.total + outside + uncovered;
        let most = N_TOLERANCES as u64 * union;
        (most - agreement) as f64 / most as f64
    }
}

impl Default for SampledMve {
    /// About 600 points and 150 pixels.
    fn default() -> Self {
        Self::new(600, 150)
    }
}

impl Score for SampledMve {
    fn score(&mut self, context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> f64 {
        let Some((model, observation)) = context.problem.sides() else {
            return 1.0;
        };
        let diameter = model.diameter();
        let imperfect = (self.mask == MaskTrust::Imperfect).then_some(diameter);
        let grid = CoarseGrid::of(observation, self.factor(observation), imperfect);
        let blocks = Blocks::of(model, self.samples);
        self.compare(
            blocks.facing(camera_from_object),
            &grid,
            camera_from_object,
            diameter,
        )
    }

    fn name(&self) -> &'static str {
        "sampled-mve"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        problem.without_mesh_or_image(self.name())
    }
}

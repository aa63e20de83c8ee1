//! The mean VSD estimate from samples of the model instead of a render.

use std::sync::Arc;

use hicp_core::{Context, Isometry3, Model, Observation, Surfel, sample_surface};

use crate::mve::mask_trust::MaskTrust;
use crate::mve::occlusion::Occlusion;
use crate::mve::trust_map::{CERTAIN, TrustMap};
use crate::score::Score;
use crate::tolerances::{AgreementCounts, mean};

/// An estimate of the MVE at low resolution, for ranking many poses.
///
/// It splats points of the model's surface into a coarse depth buffer and compares the buffer with
/// the observation, as [`MeanVsd`](crate::MeanVsd) compares a render. It costs about 10 µs for
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
    /// The depth buffer of the coarse image; all 0 between two poses.
    buffer: Vec<f32>,
    /// The pixels of the buffer that were written.
    touched: Vec<usize>,
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

    /// Fills the depth buffer at a pose.
    fn splat(&mut self, coarse: &Observation, surface: &Surface, pose: &Isometry3<f64>) {
        let camera = coarse.camera();
        let (width, height) = (camera.width() as usize, camera.height() as usize);
        if self.buffer.len() < width * height {
            self.buffer.resize(width * height, 0.0);
            self.touched.reserve(width * height);
        }
        #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
        let (fx, fy, cx, cy) = (
            camera.fx() as f32,
            camera.fy() as f32,
            camera.cx() as f32,
            camera.cy() as f32,
        );
        let eye = pose.inverse().translation.vector.cast::<f32>();
        let pose: Isometry3<f32> = pose.cast();
        let rotation = pose.rotation.to_rotation_matrix();
        for surfel in &surface.surfels {
            if surface.oriented && surfel.normal.dot(&(surfel.point.coords - eye)) >= 0.0 {
                continue;
            }
            let p = rotation * surfel.point.coords + pose.translation.vector;
            if p.z <= f32::EPSILON {
                continue;
            }
            let (u, v) = (fx * p.x / p.z + cx + 0.5, fy * p.y / p.z + cy + 0.5);
            // False for NaN.
            if !(u >= 0.0 && v >= 0.0 && u < width as f32 && v < height as f32) {
                continue;
            }
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            // Within the image.
            let index = v as usize * width + u as usize;
            let nearest = &mut self.buffer[index];
            if *nearest <= 0.0 {
                self.touched.push(index);
                *nearest = p.z;
            } else if p.z < *nearest {
                *nearest = p.z;
            }
        }
    }

    /// Compares the depth buffer with the observation, and clears it.
    fn compare(&mut self, fine: &Observation, coarse: &Observation, diameter: f64) -> f64 {
        let camera = coarse.camera();
        let width = camera.width() as usize;
        let (depth, mask) = (coarse.depth().pixels(), coarse.mask().pixels());
        let mut correct = AgreementCounts::new(diameter);
        let mut outside = 0;
        let factor = self.factor(fine);
        let trust = (self.mask == MaskTrust::Imperfect).then(|| TrustMap::of(fine, diameter));
        let (one, total, hidden_beyond) = match &trust {
            Some(trust) => (
                u64::from(CERTAIN),
                trust.total_at(fine, diameter, factor),
                -trust.seen_through_meters(),
            ),
            None => {
                let hidden_beyond = self.occlusion.least_distance_behind();
                (1, coarse.n_measured() as u64, hidden_beyond)
            }
        };
        for index in self.touched.drain(..) {
            let z = f64::from(std::mem::take(&mut self.buffer[index]));
            let measured = f64::from(depth[index]);
            let x = ((index % width) as f64 - camera.cx()) / camera.fx();
            let y = ((index / width) as f64 - camera.cy()) / camera.fy();
            let behind = (z - measured) * (x * x + y * y + 1.0).sqrt();
            let known = measured > 0.0;
            let weight = match &trust {
                Some(trust) => {
                    #[allow(clippy::cast_possible_truncation)] // A pixel of an image.
                    let (u, v) = ((index % width) as u32, (index / width) as u32);
                    u64::from(trust.weight(u * factor, v * factor))
                }
                None => u64::from(mask[index]),
            };
            if weight > 0 && known {
                correct.add(behind.abs(), weight);
            }
            if !(known && behind > hidden_beyond) {
                outside += one - weight;
            }
        }
        if total == 0 {
            return 1.0;
        }
        mean(&correct.errors(total + outside))
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
        let surface = Surface::of(model, self.samples);
        self.splat(&coarse, &surface, camera_from_object);
        self.compare(observation, &coarse, model.diameter())
    }

    fn name(&self) -> &'static str {
        "sampled-mve"
    }
}

/// The samples of a model.
struct Surface {
    surfels: Vec<Surfel>,
    /// `true` if normals are certain to point out of the object.
    oriented: bool,
}

impl Surface {
    fn of(model: &Model, samples: usize) -> Arc<Self> {
        model.derived().get_or_build(samples as u64, || Self {
            surfels: sample_surface(model.mesh(), samples),
            oriented: model.mesh().is_closed(),
        })
    }
}

//! The agreement of a model's colors with an image, from samples of the model instead of a render.

use std::sync::Arc;

use hicp_core::{Context, Isometry3, Model, Point3, Problem, Surfel, sample_colored_surface};

use crate::color::cells::{Cells, ColorEvidence, LEAST_CONTRAST, Shading, faces_camera};
use crate::score::Score;

/// An estimate of [`ColorAgreement`](crate::ColorAgreement) without a render, for ranking many
/// poses.
///
/// Samples of the surface that face the camera are projected into the image. A sample that another
/// surface hides does not count, because the measured depth there is not its own.
///
/// Cost: O(samples) per pose, some 30 ns each. The samples are computed once per model.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledColor {
    /// Number of points on the model.
    pub samples: usize,
    /// The effects of light to remove.
    pub shading: Shading,
    cells: Cells,
}

impl Default for SampledColor {
    /// 2000 points.
    fn default() -> Self {
        Self::new(2000)
    }
}

/// The colored samples of a model.
struct Samples {
    points: Vec<(Surfel, [f32; 3])>,
    /// Standard deviation of the colors, gray levels.
    contrast: f64,
    /// `true` if normals are certain to point out of the object.
    oriented: bool,
}

impl Samples {
    fn of(model: &Model, count: usize) -> Arc<Self> {
        model.derived().get_or_build(count as u64, || {
            let points = sample_colored_surface(model.mesh(), count);
            Self {
                contrast: contrast(&points),
                oriented: model.mesh().is_closed(),
                points,
            }
        })
    }
}

/// Returns the standard deviation of colors over all channels.
fn contrast(points: &[(Surfel, [f32; 3])]) -> f64 {
    let n = points.len().max(1) as f64;
    let mean = |channel: usize, value: fn(f64) -> f64| {
        let colors = points.iter().map(|(_, color)| f64::from(color[channel]));
        colors.map(value).sum::<f64>() / n
    };
    let variance = |channel| mean(channel, |x| x * x) - mean(channel, |x| x).powi(2);
    ((0..3).map(variance).sum::<f64>() / 3.0).max(0.0).sqrt()
}

impl SampledColor {
    /// Creates the score with a number of points.
    #[must_use]
    pub fn new(samples: usize) -> Self {
        Self {
            samples,
            shading: Shading::default(),
            cells: Cells::default(),
        }
    }

    /// Returns whether the model has colors, and enough contrast to be evidence from some side.
    #[must_use]
    pub fn can_tell(&self, model: &Model) -> bool {
        model.mesh().color().is_some()
            && Samples::of(model, self.samples).contrast >= LEAST_CONTRAST
    }

    /// Returns the agreement at a pose `camera_from_object`, and whether it is evidence.
    pub fn measure(
        &mut self,
        problem: &Problem<'_>,
        camera_from_object: &Isometry3<f64>,
    ) -> ColorEvidence {
        let nothing = ColorEvidence::default();
        let Some((model, observation)) = problem.sides() else {
            return nothing;
        };
        if model.mesh().color().is_none() || observation.color().is_none() {
            return nothing;
        }
        if self
            .cells
            .place(model, observation, camera_from_object)
            .is_none()
        {
            return nothing;
        }
        let samples = Samples::of(model, self.samples);
        let camera = observation.camera();
        let (width, height) = (f64::from(camera.width()), f64::from(camera.height()));
        let rotation = camera_from_object.rotation.to_rotation_matrix();
        let eye = Point3::from(
            camera_from_object
                .inverse()
                .translation
                .vector
                .cast::<f32>(),
        );
        for (surfel, color) in &samples.points {
            // The far side of a closed mesh is skipped before anything is computed.
            if samples.oriented && surfel.normal.dot(&(surfel.point - eye)) >= 0.0 {
                continue;
            }
            let mut normal = rotation * surfel.normal.cast::<f64>().into_inner();
            let point =
                rotation * surfel.point.cast::<f64>() + camera_from_object.translation.vector;
            if normal.dot(&point.coords) > 0.0 {
                normal = -normal;
            }
            if !faces_camera(&point, &normal) {
                continue;
            }
            let Some(pixel) = camera.project(&point) else {
                continue;
            };
            let (u, v) = (pixel.x + 0.5, pixel.y + 0.5);
            if u >= 0.0 && v >= 0.0 && u < width && v < height {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                // Inside the image.
                let pixel = (u as u32, v as u32);
                self.cells
                    .add(observation, pixel, point.z, (&normal, *color));
            }
        }
        self.cells.evidence(self.shading)
    }
}

impl Score for SampledColor {
    fn score(&mut self, context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> f64 {
        self.measure(&context.problem, camera_from_object).score()
    }

    fn name(&self) -> &'static str {
        "sampled-color"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        problem.without_mesh_or_image(self.name())
    }
}

/// A score of the depth, plus the disagreement of the colors times a weight.
///
/// Along directions that the depth leaves free, the colors decide.
#[derive(Clone, Debug, PartialEq)]
pub struct WithColor<C> {
    /// The score of the depth.
    pub depth: C,
    /// The score of the colors.
    pub color: SampledColor,
    /// The weight of the second.
    pub weight: f64,
}

impl<C: Score> Score for WithColor<C> {
    fn score(&mut self, context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> f64 {
        let depth = self.depth.score(context, camera_from_object);
        depth + self.weight * self.color.score(context, camera_from_object)
    }

    fn name(&self) -> &'static str {
        "with-color"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        self.depth.unsupported(problem)
    }
}

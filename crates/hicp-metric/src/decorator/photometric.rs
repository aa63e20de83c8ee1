//! A metric with the colors of the image.

use hicp_core::internal::{ColorSamples, FacingSample, SeenColors};
use hicp_core::{Correspondences, Isometry3, Iteration, Model, Observation, Vector3};
use nalgebra::{SMatrix, SVector};

use crate::metric::error_metric::Step;
use crate::metric::minimize::Minimize;
use crate::system::normal_equations::NormalEquations;

/// Smallest number of compared samples.
const LEAST_SAMPLES: f64 = 50.0;
/// Smallest contrast of the model's colors, gray levels.
const LEAST_CONTRAST: f64 = 6.0;
/// Smallest variance of the image along a channel that is not noise, gray levels squared.
const LEAST_VARIANCE: f64 = 4.0;
/// Stiffness against shading, relative to the number of samples. A plane has one normal.
const STIFFNESS: f64 = 1e-3;

/// Adds the colors of the image to a metric, to determine motions that depth leaves free.
///
/// It minimizes E = Σ w e / Σ w + λ² (1 − ρ²). The first term is the mean loss of the inner metric.
/// 1 − ρ² is the share of the contrast of the model's colors that the image does not explain. λ is
/// a length, [`Photometric::weight_diameters`] times the diameter. In each channel, samples of the
/// model that the camera sees are compared with the image at their projections: r = m − α a − β −
/// γᵀn, with the color m of the model, a of the image, and the normal n. The gain α, the offset β
/// and the shading γ are those of the least squares fit, so exposure, white balance and a lamp do
/// not matter. If the colors contradict the model, α is 0 and nothing is pulled. The rows of the
/// system are −α ∇a · ∂(u, v)/∂p. At the minimum over α, β and γ, they give the exact gradient. The
/// covariance of the system is for the variance of the pairs alone.
///
/// Source: the direct form of Park, Zhou & Koltun, "Colored Point Cloud Registration Revisited",
/// 2017. The fit of gain, offset and shading is added here. For point clouds, they use the gradient
/// of the colors in the tangent plane of the target. It differs from the gradient in the image only
/// along the normal, the direction that point-to-plane determines, so one form suffices.
///
/// It is a [`Minimize`] and not an [`ErrorMetric`](crate::ErrorMetric), because the colors are not
/// in the pairs: the pose is that of the pairs. Without a color image, a model with colors, enough
/// contrast, or enough samples in the image, it is the inner metric, bit for bit.
///
/// Put it around the metric of the pairs, inside of policies and solvers:
///
/// ```
/// use hicp_metric::{Conditioned, Photometric, PointToPlane};
///
/// let metric = Conditioned { metric: Photometric::new(PointToPlane), ..Conditioned::default() };
/// # let _ = metric;
/// ```
///
/// Cost: two passes over the samples that face the camera, 0.1 ms per step, without allocation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photometric<M> {
    /// The metric of the pairs.
    pub metric: M,
    /// λ as a share of the model's diameter.
    ///
    /// Colors that do not agree at all count as much as an RMS residual of λ.
    pub weight_diameters: f64,
    /// Number of points on the model whose colors are compared.
    pub samples: usize,
}

impl<M: Default> Default for Photometric<M> {
    fn default() -> Self {
        Self::new(M::default())
    }
}

impl<M> Photometric<M> {
    /// Adds the colors of 2000 samples to a metric, with λ = 1 % of the diameter.
    #[must_use]
    pub fn new(metric: M) -> Self {
        Self {
            metric,
            weight_diameters: 0.01,
            samples: 2000,
        }
    }

    /// Compares the colors at the pose of the pairs. Returns `None` without evidence.
    fn term<'a>(&self, iteration: &Iteration<'a>, pairs: &Correspondences) -> Option<Term<'a>> {
        let (model, observation) = iteration.problem.sides()?;
        let seen = SeenColors::of(model, observation)?;
        let lambda = self.weight_diameters * model.diameter();
        let colors = Colors {
            model,
            observation,
            seen,
            samples: self.samples,
            pose: *pairs.camera_from_object(),
        };
        let term = Term::fit(colors, lambda * lambda)?;
        (term.factor > 0.0 && term.loss.is_finite()).then_some(term)
    }
}

/// The terms of the light: an offset, and a slope with the normal.
type Light = SVector<f64, 4>;

fn light(sample: &FacingSample) -> Light {
    let normal = &sample.normal;
    Light::new(1.0, normal.x, normal.y, normal.z)
}

/// The two sides of a comparison.
struct Colors<'a> {
    model: &'a Model,
    observation: &'a Observation,
    seen: SeenColors<'a>,
    samples: usize,
    pose: Isometry3<f64>,
}

impl Colors<'_> {
    /// Visits the samples that the image shows, with the colors of the image and their gradients
    /// along u and v.
    fn visit(&self, mut visit: impl FnMut(&FacingSample, &[Smooth; 3])) {
        let samples = ColorSamples::of(self.model, self.samples);
        samples.visit(self.observation.camera(), &self.pose, |sample| {
            let (pixel, z) = (sample.nearest(), sample.point.z);
            if self.seen.at(pixel, z).is_some()
                && let Some(smooth) = smooth(self.observation, sample)
            {
                visit(sample, &smooth);
            }
        });
    }
}

/// The value of a channel of the image, and its gradient per pixel.
#[derive(Clone, Copy, Default)]
struct Smooth {
    value: f64,
    gradient: [f64; 2],
}

/// Fits a parabola B-spline to the image around a sample, which is smooth in the pose.
///
/// Returns `None` at the border of the image.
fn smooth(observation: &Observation, sample: &FacingSample) -> Option<[Smooth; 3]> {
    let image = observation.color()?;
    let (u, v) = sample.nearest();
    let inside = u > 0 && v > 0 && u + 1 < image.width() && v + 1 < image.height();
    if !inside {
        return None;
    }
    // Weights of three neighbors, and their derivatives.
    let spline = |offset: f64| {
        let (a, b) = (0.5 - offset, 0.5 + offset);
        ([0.5 * a * a, 0.5 + a * b, 0.5 * b * b], [-a, a - b, b])
    };
    let (x, dx) = spline(sample.pixel.x - f64::from(u));
    let (y, dy) = spline(sample.pixel.y - f64::from(v));
    let mut channels = [Smooth::default(); 3];
    let width = image.width() as usize;
    let first = (v as usize - 1) * width + u as usize - 1;
    for (row, (y, dy)) in y.iter().zip(dy).enumerate() {
        let pixels = &image.pixels()[first + row * width..][..3];
        for (pixel, (x, dx)) in pixels.iter().zip(x.iter().zip(dx)) {
            for (channel, value) in channels.iter_mut().zip(pixel) {
                let value = f64::from(*value);
                channel.value += x * y * value;
                channel.gradient[0] += dx * y * value;
                channel.gradient[1] += x * dy * value;
            }
        }
    }
    Some(channels)
}

/// The fit of a model's colors by those of the image and by light.
struct Term<'a> {
    colors: Colors<'a>,
    /// Per channel α, and β and γ.
    fits: [(f64, Light); 3],
    /// The factor from squared gray levels to the mean loss.
    factor: f64,
    /// λ² (1 − ρ²).
    loss: f64,
}

impl<'a> Term<'a> {
    fn fit(colors: Colors<'a>, lambda_squared: f64) -> Option<Self> {
        // Sums of products of the light with itself, with the image and the model.
        let mut lights = SMatrix::<f64, 4, 4>::zeros();
        let mut sides = SMatrix::<f64, 4, 6>::zeros();
        // And per channel, those of the image and the model with themselves and each other.
        let mut squares = [[0.0; 3]; 3];
        colors.visit(|sample, smooth| {
            let light = light(sample);
            lights += light * light.transpose();
            for channel in 0..3 {
                let (a, m) = (smooth[channel].value, f64::from(sample.color[channel]));
                let mut column = sides.column_mut(channel);
                column += light * a;
                let mut column = sides.column_mut(channel + 3);
                column += light * m;
                for (sum, product) in squares[channel].iter_mut().zip([a * a, m * m, a * m]) {
                    *sum += product;
                }
            }
        });
        let n = lights[(0, 0)];
        let mut stiff = Light::repeat(STIFFNESS * n);
        stiff[0] = 0.0;
        let solved = (lights + SMatrix::from_diagonal(&stiff)).cholesky()?;
        let by_light = solved.solve(&sides);
        let (mut contrast, mut rest) = (0.0, 0.0);
        let fits = std::array::from_fn(|channel| {
            let (a, m) = (by_light.column(channel), by_light.column(channel + 3));
            // The rest without the light.
            let [aa, mm, am] = squares[channel];
            let aa = aa - a.dot(&sides.column(channel));
            let mm = mm - m.dot(&sides.column(channel + 3));
            let am = am - a.dot(&sides.column(channel + 3));
            let telling = aa > n * LEAST_VARIANCE && am > 0.0;
            let gain = if telling { am / aa } else { 0.0 };
            contrast += mm;
            rest += mm - gain * am;
            (gain, m - a * gain)
        });
        let enough = n >= LEAST_SAMPLES && contrast >= 3.0 * n * LEAST_CONTRAST.powi(2);
        enough.then(|| Self {
            colors,
            fits,
            factor: lambda_squared / contrast,
            loss: lambda_squared * rest / contrast,
        })
    }

    /// Adds the rows to a system of pairs whose weights sum up to `weight`.
    fn add_to(&self, system: &mut NormalEquations, weight: f64) {
        // The weights of these rows say nothing about the noise of the pairs. If the pairs do not
        // determine it, there is no covariance.
        system.variance = Some(system.row_variance().unwrap_or(f64::NAN));
        let camera = self.colors.observation.camera();
        self.colors.visit(|sample, smooth| {
            let (point, light) = (&sample.point, light(sample));
            let (fx, fy) = (camera.fx() / point.z, camera.fy() / point.z);
            let along_u = Vector3::new(fx, 0.0, -fx * point.x / point.z);
            let along_v = Vector3::new(0.0, fy, -fy * point.y / point.z);
            for (channel, (gain, shade)) in self.fits.iter().enumerate() {
                let Smooth { value, gradient } = smooth[channel];
                let model = f64::from(sample.color[channel]);
                let residual = gain * value + shade.dot(&light) - model;
                let direction = (along_u * gradient[0] + along_v * gradient[1]) * *gain;
                system.add_row(point, &direction, residual, weight * self.factor);
            }
        });
    }
}

impl<M: Minimize> Photometric<M> {
    /// Returns the system and the mean loss of the metric with a term, which is fitted only once.
    fn with(
        &mut self,
        term: &Term<'_>,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
    ) -> Option<(NormalEquations, f64)> {
        let mut system = self.metric.system(iteration, pairs)?;
        term.add_to(&mut system, total_weight(pairs));
        let mean_loss = self.metric.mean_loss(iteration, pairs)? + term.loss;
        Some((system, mean_loss))
    }
}

impl<M: Minimize> Minimize for Photometric<M> {
    fn inner(&mut self, _: &Iteration<'_>) -> Option<&mut dyn Minimize> {
        Some(&mut self.metric)
    }

    fn mean_loss(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<f64> {
        let mean = self.metric.mean_loss(iteration, pairs)?;
        Some(mean + self.term(iteration, pairs).map_or(0.0, |term| term.loss))
    }

    fn system(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
    ) -> Option<NormalEquations> {
        let mut system = self.metric.system(iteration, pairs)?;
        if let Some(term) = self.term(iteration, pairs) {
            term.add_to(&mut system, total_weight(pairs));
        }
        Some(system)
    }

    fn system_and_loss(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
    ) -> Option<(NormalEquations, f64)> {
        match self.term(iteration, pairs) {
            Some(term) => self.with(&term, iteration, pairs),
            None => self.metric.system_and_loss(iteration, pairs),
        }
    }

    fn minimize(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<Step> {
        let Some(term) = self.term(iteration, pairs) else {
            return self.metric.minimize(iteration, pairs);
        };
        let (system, mean_loss) = self.with(&term, iteration, pairs)?;
        Some(Step {
            increment: system.solve()?,
            mean_loss,
        })
    }

    fn label(&self) -> &'static str {
        "photometric"
    }
}

fn total_weight(pairs: &Correspondences) -> f64 {
    pairs.as_slice().iter().map(|p| f64::from(p.weight)).sum()
}

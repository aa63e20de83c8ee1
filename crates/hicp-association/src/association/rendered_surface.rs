//! Association of the rendered surface with the depth measured along the same rays.

use hicp_core::internal::{Surroundings, index};
use hicp_core::{Context, Correspondences, Isometry3, Pair, Problem, Surfel};

use crate::association::data_association::DataAssociation;
use crate::length::Length;
use crate::stride::Stride;

/// Pairs every rendered point with the point that the camera measured along the same ray.
///
/// Use it with the metric `PointToPlane` and the selection `()`. The target of a pair has the
/// normal of the *model*. Its weight is b / cos² θ, where θ is the angle between the ray and that
/// normal. A row is then the error along the ray, whose Jacobian has no noise.
/// [`Projective`](crate::Projective) with point-to-plane uses the normals of the image instead,
/// which are smoothed or noisy.
///
/// The factor b = (1 − (d/limit)²)² of the difference d of the two depths is Tukey's biweight: it
/// falls from 1 to 0 at the limit. The model is rendered at every iteration, so hidden parts never
/// pair. Pixels outside of the mask pair, too: masks of detectors often miss a part of the object,
/// and other surfaces are usually farther away than the limit. If fewer than three pixels are
/// measured inside the mask, there are no pairs.
///
/// `source` is ignored. `source_index` is the index of the pixel in the rendered region, and
/// `target_index` is [`Pair::UNLISTED`]. So the normals of the image, which cost time, are not
/// estimated. All rendered points of the stride are candidates. Cost: one render, and O(rendered
/// pixels).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderedSurface {
    /// Spacing of the rendered pixels to pair.
    pub stride: Stride,
    /// Largest difference of the two depths. At least three standard deviations of the noise are
    /// allowed.
    pub limit: Length,
}

impl Default for RenderedSurface {
    /// About 2,000 points, and at most 0.12 diameters.
    ///
    /// With twice as much, a surface next to the object can pull a good pose away.
    fn default() -> Self {
        Self {
            stride: Stride::AboutPoints(2000),
            limit: Length::Diameters(0.12),
        }
    }
}

/// Smallest cosine between the ray and the normal. Steeper surfaces have no pair.
const LEAST_COSINE: f64 = 0.15;
/// The limit, in standard deviations of the noise, below which no difference is rejected.
const LIMIT_SIGMAS: f64 = 3.0;

impl DataAssociation for RenderedSurface {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        _source: &[Surfel],
        camera_from_object: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        pairs.set_candidates(0);
        let problem = context.problem;
        let (Some(mesh), Some(observation), Some(view)) = (
            problem.drawn(),
            problem.observation(),
            context.view(camera_from_object),
        ) else {
            return;
        };
        if !observation.has_surface() {
            return;
        }
        let noise = Surroundings::of(observation).noise;
        let limit = f64::from(self.limit.meters(&problem)).max(LIMIT_SIGMAS * noise);
        let (camera, depth, region) = (observation.camera(), observation.depth(), view.region());
        let stride = self.stride.pixels(view.n_rendered());
        let mut candidates = 0;
        for v in (region.v_min.next_multiple_of(stride)..region.v_max).step_by(stride as usize) {
            for u in (region.u_min.next_multiple_of(stride)..region.u_max).step_by(stride as usize)
            {
                let Some(source) = view.surfel_at(u, v, mesh, camera, camera_from_object) else {
                    continue;
                };
                candidates += 1;
                let measured = f64::from(depth.get(u, v).unwrap_or(0.0));
                let behind = measured - f64::from(source.point.z);
                let near = measured > 0.0 && behind.abs() < limit;
                let ray = source.point.coords.cast::<f64>();
                let cosine = -source.normal.cast::<f64>().dot(&ray) / ray.norm();
                if !near || cosine < LEAST_COSINE {
                    continue;
                }
                let point = camera.unproject(f64::from(u), f64::from(v), measured);
                let inside = 1.0 - (behind / limit).powi(2);
                #[allow(clippy::cast_possible_truncation)] // At most 1 / LEAST_COSINE².
                let weight = (inside / cosine).powi(2) as f32;
                let target = Surfel {
                    point: point.cast::<f32>(),
                    normal: source.normal,
                };
                let rendered = region.index(u, v).map_or(Pair::UNLISTED, index);
                pairs.push(Pair {
                    weight,
                    ..Pair::new(rendered, source, Pair::UNLISTED, target)
                });
            }
        }
        pairs.set_candidates(candidates);
    }

    fn name(&self) -> &'static str {
        "rendered-surface"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        problem.without_mesh_or_image(self.name())
    }
}

//! Association of the rendered silhouette with the border of the object in the image.

mod evidence;
mod line;
mod mask_border;
mod silhouette;
mod split;

use hicp_core::internal::{Scratch, Surroundings, index};
use hicp_core::{Context, Correspondences, Isometry3, Pair, Problem, Surfel, UnitVector3, Vector3};

use crate::association::data_association::DataAssociation;

use evidence::Evidence;
use line::Line;
use mask_border::MaskBorder;
use silhouette::Silhouette;
use split::Split;

/// Pairs points of the rendered silhouette with the border of the object in the image.
///
/// A line of pixels crosses the silhouette at each point, perpendicular to it (correspondence
/// lines: RAPID, Harris & Stennett 1990; ICG, Stoiber et al. 2022). Along the line, the border is
/// the split that best separates pixels of the object from pixels of the background. The evidence
/// of a pixel is the sum of two terms. The first is the log-likelihood ratio of its depth, between
/// the rendered surface and the background: the plane around the mask, or any other surface. The
/// second is positive inside the mask and negative outside.
///
/// The mask is not taken for granted. Its border is compared with the borders that depth alone
/// shows: the median offset is removed, and the spread decides the mask's influence. A mask that is
/// dilated by a constant width is therefore as good as an exact one, and a box has no influence.
/// Pixels that something hides are no evidence, so a border that is hidden has no pair. A pixel
/// without depth is weak evidence of background outside of the mask, and none inside of it. If the
/// observation has fewer than three measured pixels, there are no pairs.
///
/// Use it with [`RenderedSurface`](crate::RenderedSurface) as a tuple, point-to-plane and the
/// selection `()`. The two normals of a pair are equal and perpendicular to the ray. A weight is
/// the variance of a depth divided by that of the border, so rows of both associations can be
/// summed.
///
/// `source` is ignored. `source_index` is the index of the pixel in the rendered region.
/// `target_index` is [`Pair::UNLISTED`]. The lines are the candidates.
///
/// Cost: one render, shared with other components that use this pose, O(rendered pixels), and 21
/// pixels per line.
#[derive(Clone, Debug, PartialEq)]
pub struct Contour {
    /// Approximate number of lines.
    pub lines: usize,
    /// Distance from the silhouette at which a line ends, as a fraction of the diameter, but at
    /// least 10 pixels.
    pub reach_diameters: f64,
    /// Factor on all weights: 1 if the lines are independent, less if they are correlated.
    pub weight: f64,
    scratch: Scratch<(Silhouette, Vec<Line>, MaskBorder)>,
}

impl Contour {
    /// Creates the association.
    #[must_use]
    pub fn new(lines: usize, reach_diameters: f64, weight: f64) -> Self {
        Self {
            lines,
            reach_diameters,
            weight,
            scratch: Scratch::default(),
        }
    }
}

impl Default for Contour {
    /// 150 lines that reach 5 % of the diameter to each side, with half of the weight.
    fn default() -> Self {
        Self::new(150, 0.05, 0.5)
    }
}

/// Standard deviation of a border, in steps along the line.
const BORDER_SIGMA: f64 = 1.5;
/// Smallest standard deviation of a depth, in diameters: errors of the mesh and the sensor.
const LEAST_SIGMA: f64 = 0.005;
/// Largest weight of a pair, so that a few lines do not outweigh the surface.
const MAX_WEIGHT: f64 = 20.0;

impl DataAssociation for Contour {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        _source: &[Surfel],
        camera_from_object: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        pairs.set_candidates(0);
        let Some((model, observation)) = context.problem.sides() else {
            return;
        };
        if !observation.has_surface() {
            return;
        }
        let Some(view) = context.view(camera_from_object) else {
            return;
        };
        let camera = observation.camera();
        let surroundings = Surroundings::of(observation);
        let (silhouette, lines, border) = &mut self.scratch.0;
        silhouette.find(view, camera);
        // The object's size in the image decides the step between the pixels of a line.
        let center = (camera_from_object * model.center()).z;
        let pixels = camera.fx() * model.diameter() / center.max(f64::MIN_POSITIVE);
        let step = (self.reach_diameters * pixels / line::SIDE as f64).clamp(1.0, 1e3);
        let evidence = Evidence {
            observation,
            view,
            surroundings: &surroundings,
            diameter: model.diameter(),
        };
        lines.clear();
        for (u, v) in silhouette.spread(self.lines) {
            let Some(line) = Line::across(view, camera, (u, v), step) else {
                continue;
            };
            lines.push(evidence.along(line));
        }
        pairs.set_candidates(lines.len());
        border.compare(lines);
        let sigma = surroundings.noise.max(LEAST_SIGMA * model.diameter());
        for line in lines.iter() {
            let Some(split) = Split::of(&border.add_to(line)) else {
                continue;
            };
            let weight = self.weight * (sigma / (BORDER_SIGMA * line.step_meters)).powi(2);
            let target = line.point + line.normal * (split.offset() * line.step_meters);
            #[allow(clippy::cast_possible_truncation)] // At most `MAX_WEIGHT`.
            let weight = (weight * split.certainty()).clamp(0.0, MAX_WEIGHT) as f32;
            let rendered = view.region().index(line.pixel.0, line.pixel.1);
            pairs.push(Pair {
                weight,
                ..Pair::new(
                    rendered.map_or(Pair::UNLISTED, index),
                    surfel(&line.point, &line.normal),
                    Pair::UNLISTED,
                    surfel(&target, &line.normal),
                )
            });
        }
    }

    fn name(&self) -> &'static str {
        "contour"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        problem.without_mesh_or_image(self.name())
    }
}

/// Returns a surfel with the precision of buffers.
fn surfel(point: &Vector3<f64>, normal: &Vector3<f64>) -> Surfel {
    Surfel {
        point: point.cast::<f32>().into(),
        normal: UnitVector3::new_unchecked(normal.cast::<f32>()),
    }
}

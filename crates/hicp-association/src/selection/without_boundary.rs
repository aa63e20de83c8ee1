//! Selection away from silhouettes and depth edges.

use hicp_core::{Context, Isometry3, Problem, Surfel};

use crate::boundary::BoundaryRule;
use crate::selection::point_selection::PointSelection;
use crate::selection::visible_surface::VisibleSurface;

/// Removes points of another selection next to the silhouette or a depth step of the rendered
/// model.
///
/// At such points a slight misalignment decides which surface a pixel shows, so projective pairs
/// are wrong most often. The model is rendered at the stage's initial pose (once, see
/// [`Context::view`]). Each point is judged at the pixel that it projects to. It is removed if one
/// of these conditions holds:
///
/// - It projects outside the image, or its pixel shows no surface.
/// - A pixel at a chessboard distance of r ≤ `width` shows no surface.
/// - The depth of such a pixel differs by more than r·tan(`max_tilt_degrees`)/f of the nearer
///   depth, with the smaller focal length f in pixels.
///
/// A hidden point is judged by the surface that hides it. The border of the image is not a
/// silhouette. Cost: the inner selection, one render, and O((2·width + 1)²) per point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WithoutBoundary<P> {
    /// The selection to select from.
    pub selection: P,
    /// Width of the boundary, pixels. Values above 64 count as 64.
    pub width: u32,
    /// Largest tilt of a surface against the image plane, degrees. A steeper step is a depth edge.
    ///
    /// With 90 or more, no step is a depth edge. With NaN or a negative value, every step is,
    /// unless `width` is 0.
    pub max_tilt_degrees: f64,
}

impl Default for WithoutBoundary<VisibleSurface> {
    /// The visible surface without one pixel along the silhouette and along steps steeper than 85°.
    fn default() -> Self {
        Self {
            selection: VisibleSurface::default(),
            width: 1,
            max_tilt_degrees: 85.0,
        }
    }
}

impl<P: PointSelection> PointSelection for WithoutBoundary<P> {
    fn select(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
        source: &mut Vec<Surfel>,
    ) {
        self.selection.select(context, camera_from_object, source);
        let problem = context.problem;
        let (Some(observation), Some(view)) =
            (problem.observation(), context.view(camera_from_object))
        else {
            source.clear();
            return;
        };
        let camera = observation.camera();
        let image = camera.region();
        let rule = BoundaryRule::new(self.width, self.max_tilt_degrees, camera);
        source.retain(|surfel| {
            let point = camera_from_object * surfel.point.cast::<f64>();
            let Some(pixel) = camera.project(&point) else {
                return false;
            };
            let (u, v) = (pixel.x.round(), pixel.y.round());
            let inside =
                u >= 0.0 && v >= 0.0 && u < f64::from(image.u_max) && v < f64::from(image.v_max);
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            // Whole numbers inside the image; the cast is not used otherwise.
            let (u, v) = (u as u32, v as u32);
            inside && !rule.holds(u, v, &image, |u, v| view.depth_at(u, v))
        });
    }

    fn name(&self) -> &'static str {
        "without-boundary"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        problem.without_mesh_or_image(self.name())
    }
}

//! Selection away from silhouettes and depth edges.

use hicp_core::{Context, Isometry3, Surfel};

use crate::boundary::BoundaryRule;
use crate::selection::point_selection::PointSelection;
use crate::selection::visible_surface::VisibleSurface;

/// Drops those points of another selection that lie next to the silhouette or to a depth step of the rendered model.
///
/// There a slight misalignment decides what a pixel shows, so projective pairs are wrong most often. The model is rendered
/// at the stage's initial estimate (once, see [`Context::view`]) and every point judged by the pixel that it projects to:
/// dropped when that pixel shows nothing, or when a pixel at a chessboard distance of r ≤ `width` shows nothing or surface
/// nearer or further by more than r·tan(`max_tilt_degrees`)/f of the nearer depth, f the smaller focal length in pixels. A point that is hidden is judged by what hides it. The
/// border of the image is no silhouette. Points that project outside the image are dropped. Cost: the inner selection, one
/// render, and O((2·width + 1)²) per point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WithoutBoundary<P> {
    /// The selection to choose from.
    pub inner: P,
    /// How many pixels wide the boundary is; above 64 counts as 64.
    pub width: u32,
    /// Largest tilt of a surface against the image plane, degrees: what is steeper is a depth step. From 90 on nothing is. NaN
    /// and negative values make everything a boundary, unless `width` is 0.
    pub max_tilt_degrees: f32,
}

impl Default for WithoutBoundary<VisibleSurface> {
    /// The visible surface but for one pixel along the silhouette and where it is steeper than 85°.
    fn default() -> Self {
        Self {
            inner: VisibleSurface::default(),
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
        self.inner.select(context, camera_from_object, source);
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
}

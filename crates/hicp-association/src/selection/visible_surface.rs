//! Selection of the visible points.

use hicp_core::{Context, Isometry3, Point3, Problem, Surfel, UnitVector3};

use crate::selection::point_selection::PointSelection;
use crate::stride::Stride;

/// The pose at which a stage selects the visible points.
///
/// The first stage of a cascade starts where the cascade starts, so for it both are the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SelectAt {
    /// The initial pose of the stage.
    ///
    /// In a cascade, a later stage selects the surface that is visible after the stage before it.
    #[default]
    Stage,
    /// The initial pose of the innermost cascade that runs the stage.
    ///
    /// All stages of the cascade then share one V_O and one render, which is one reading of
    /// §III-A.1 and §IV-B. Outside of a cascade, it is the initial pose of the stage.
    Cascade,
}

/// Selects the points of the model that are visible at an initial pose.
///
/// They are the vertex map V_O of §III-A.1. The model is rendered at the initial pose of the
/// stage or of its cascade ([`SelectAt`]); if the score has rendered it already, the render comes
/// from the cache. Every rendered pixel on a grid that starts at the image's corner becomes a
/// surfel, with the normal of its face toward the camera. If the object is behind the camera or
/// outside the image, nothing is selected. Cost: one render, and O(rendered pixels).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VisibleSurface {
    /// Spacing of the selected pixels.
    pub stride: Stride,
    /// The pose at which the points are selected.
    pub at: SelectAt,
}

impl VisibleSurface {
    /// Selects at the stage's initial pose, with this spacing.
    #[must_use]
    pub const fn with_stride(stride: Stride) -> Self {
        Self {
            stride,
            at: SelectAt::Stage,
        }
    }
}

impl Default for VisibleSurface {
    /// About 2,000 points.
    // Deviation: stride of V_O: §III-A.1 pairs every rendered pixel. Here V_O is a grid of about
    // 2,000 of them, because the accuracy is the same in a fifth of the time. `Stride::Pixels(1)`
    // keeps every pixel.
    fn default() -> Self {
        Self::with_stride(Stride::AboutPoints(2000))
    }
}

impl PointSelection for VisibleSurface {
    fn select(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
        source: &mut Vec<Surfel>,
    ) {
        let problem = context.problem;
        // Deviation: V_O per stage: §III-A.1 renders V_O once, at the initial pose of ICP. Here
        // every stage renders it at its own initial pose, so the second stage of a cascade pairs
        // the surface that is visible by then. The first stage after a switch shares the render of
        // the MVE. `SelectAt::Cascade` renders once per cascade.
        let camera_from_object = &match (self.at, context.cascade_init()) {
            (SelectAt::Cascade, Some(init)) => *init,
            _ => *camera_from_object,
        };
        let (Some(mesh), Some(observation), Some(view)) = (
            problem.drawn(),
            problem.observation(),
            context.view(camera_from_object),
        ) else {
            return;
        };
        let camera = observation.camera();
        let region = view.region();
        let rendered = view.n_rendered();
        if rendered == 0 {
            return;
        }
        let stride = self.stride.pixels(rendered);
        let object_from_camera = camera_from_object.inverse();
        let eye = Point3::from(object_from_camera.translation.vector);
        let width = region.width();
        for v in (region.v_min.next_multiple_of(stride)..region.v_max).step_by(stride as usize) {
            let first = (v - region.v_min) as usize * width;
            let depths = &view.depth()[first..first + width];
            let triangles = &view.triangles()[first..first + width];
            let start = region.u_min.next_multiple_of(stride) - region.u_min;
            for column in (start as usize..width).step_by(stride as usize) {
                let depth = depths[column];
                if depth <= 0.0 {
                    continue;
                }
                let Some(normal) = mesh.normal(triangles[column] as usize) else {
                    continue;
                };
                #[allow(clippy::cast_possible_truncation)] // A column of an image.
                let u = region.u_min + column as u32;
                let point = object_from_camera
                    * camera.unproject(f64::from(u), f64::from(v), f64::from(depth));
                let toward_camera = normal.cast::<f64>().dot(&(eye - point)) >= 0.0;
                let normal = normal.into_inner();
                source.push(Surfel {
                    point: point.cast::<f32>(),
                    normal: UnitVector3::new_unchecked(if toward_camera {
                        normal
                    } else {
                        -normal
                    }),
                });
            }
        }
    }

    fn name(&self) -> &'static str {
        "visible-surface"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        problem.without_mesh_or_image(self.name())
    }
}

//! The agreement of a render with a color image.

use hicp_core::internal::{SeenColors, faces_camera, index};
use hicp_core::{Context, Isometry3, Problem};

use crate::color::cells::{Cells, ColorEvidence, Shading};
use crate::score::Score;

/// Number of pixels in the box of the render from which the step is computed. The step is rounded
/// down, so up to three times as many are compared.
const PIXELS: usize = 2000;

/// Scores how well the colors of a model agree with the color image, from 0 to 1.
///
/// It is (1 − ρ)/2 for the correlation ρ of the colors: 0 if they agree, 0.5 if they are unrelated
/// or no evidence, and 1 if they are opposite.
///
/// The colors of the model and of the image are averaged over cells, a 24th of the object wide.
/// Effects of the light are removed from both sides: per channel a gain, an offset, and an increase
/// with the direction of the normal. The correlation of the rest is the agreement. So exposure,
/// white balance and smooth shading do not matter, and neither does an error of a pixel or two.
/// Overexposed pixels, such as highlights, do not count.
///
/// An object of one color, an overexposed image, and a problem without colors are no evidence, and
/// score 0.5 at every pose: see [`ColorAgreement::measure`].
///
/// Cost: one render (shared with other components that use this pose), and at most some
/// 6000 pixels of the box around it, about 100 ns each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ColorAgreement {
    /// The effects of light to remove.
    pub shading: Shading,
    cells: Cells,
}

impl ColorAgreement {
    /// Returns the agreement at a pose `camera_from_object`, and whether it is evidence.
    pub fn measure(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
    ) -> ColorEvidence {
        let nothing = ColorEvidence::default();
        let Some((model, observation)) = context.problem.sides() else {
            return nothing;
        };
        let Some(colors) = SeenColors::of(model, observation) else {
            return nothing;
        };
        let placed = self
            .cells
            .place(model, observation.camera(), camera_from_object);
        let (Some(()), Some(view)) = (placed, context.view(camera_from_object)) else {
            return nothing;
        };
        let (mesh, camera) = (model.mesh(), observation.camera());
        let region = view.region();
        // A grid that starts at the corner of the image shows equal pixels at near poses.
        let step = index(region.area().div_ceil(PIXELS).isqrt().max(1));
        let rows = region.v_min.next_multiple_of(step)..region.v_max;
        let columns = region.u_min.next_multiple_of(step)..region.u_max;
        for v in rows.step_by(step as usize) {
            for u in columns.clone().step_by(step as usize) {
                let surfel = view.surfel_at(u, v, mesh, camera, camera_from_object);
                let Some(surfel) = surfel else { continue };
                let point = surfel.point.cast::<f64>();
                let normal = surfel.normal.cast::<f64>().into_inner();
                if !faces_camera(&point, &normal) {
                    continue;
                }
                let Some(seen) = colors.at((u, v), point.z) else {
                    continue;
                };
                if let Some(color) = view.color_at(u, v, mesh, camera, camera_from_object) {
                    self.cells
                        .add((u, v), &normal, [color, seen.map(f32::from)]);
                }
            }
        }
        self.cells.evidence(self.shading)
    }
}

impl Score for ColorAgreement {
    fn score(&mut self, context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> f64 {
        self.measure(context, camera_from_object).score()
    }

    fn name(&self) -> &'static str {
        "color-agreement"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        problem.without_mesh_or_image(self.name())
    }
}

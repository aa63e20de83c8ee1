//! Checks of inputs and results, each of which is well-formed by itself.

mod boxes;
mod camera;
mod image;
mod model;
mod result;

use hicp_core::{Isometry3, Model, Observation, se3};

use crate::warning::Warning;

pub use boxes::{box_overlaps, warning_of_box};
pub use image::{median_depth, warning_of_distance, warnings_of_image};
pub use model::{warning_of_diameter, warning_of_symmetries, warnings_of_model};
pub use result::{ACCEPTED, EXPLAINS_NOTHING, warning_of_runner_up, warnings_of_result};

/// Returns warnings about the inputs of a refinement; `init` is camera from object, meters.
///
/// A warning refuses nothing. Cost: O(pixels of the mask's box + vertices).
///
/// ```
/// use hybrid_icp::core::{
///     DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, Point3, TriMesh,
/// };
/// use hybrid_icp::{Warning, warnings};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let corners = [[0., 0., 0.], [0.1, 0., 0.], [0., 0.1, 0.]].map(Point3::from);
/// let model = Model::new(TriMesh::new(corners.to_vec(), vec![[0, 1, 2]])?);
/// // The wall is 0.8 m away, but the depth was read at a tenth of its scale.
/// let depth = DepthImage::from_meters(64, 48, vec![0.08; 64 * 48])?;
/// let camera = PinholeCamera::new(60.0, 60.0, 31.5, 23.5, 64, 48)?;
/// let observation = Observation::new(depth, Mask::full(64, 48), camera)?;
/// let warnings = warnings(&model, &observation, &Isometry3::translation(0.0, 0.0, 0.8));
/// assert!(matches!(warnings[0], Warning::Depth { .. }));
/// # Ok(()) }
/// ```
#[must_use]
pub fn warnings(model: &Model, observation: &Observation, init: &Isometry3<f64>) -> Vec<Warning> {
    let rigid = se3::is_finite(init) && (init.rotation.norm() - 1.0).abs() < 1e-6;
    let distance = if rigid {
        (init * model.center()).z
    } else {
        f64::NAN
    };
    let mut warnings = warnings_of_model(model);
    let mut of_image = warnings_of_image(model, observation, distance);
    if !warnings.is_empty() {
        // One warning about the same numbers is enough.
        let size = |w: &Warning| matches!(w, Warning::Mask { .. } | Warning::Sliver { .. });
        of_image.retain(|warning| !size(warning));
    }
    warnings.append(&mut of_image);
    warnings
}

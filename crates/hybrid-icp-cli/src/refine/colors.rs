//! The model and the color image of a refinement.

use std::path::Path;

use anyhow::bail;
use hicp_bop::chain;
use hicp_io::{CameraFile, LengthUnit, MeshFile};
use hybrid_icp::core::{ColorImage, Model, ModelConfig, Symmetries};

use crate::limits::limits;

/// Reads the mesh of the model.
///
/// With a color image, also reads the colors of the mesh. Returns a message if it has none.
pub(super) fn read_model(
    path: &Path,
    unit: LengthUnit,
    symmetries: Symmetries,
    rgb: Option<&Path>,
) -> anyhow::Result<(Model, Option<String>)> {
    let config = ModelConfig {
        symmetries,
        ..ModelConfig::default()
    };
    let Some(rgb) = rgb else {
        let mesh = limits().read_mesh_geometry(path, unit)?;
        return Ok((Model::with_config(mesh, config), None));
    };
    let MeshFile { mesh, color_fault } = limits().read_mesh_file(path, unit)?;
    let warning = mesh.color().is_none().then(|| {
        let (model, rgb) = (path.display(), rgb.display());
        let fault = color_fault.map_or(String::new(), |fault| format!(" ({})", chain(&fault)));
        format!("{model} has no colors that can be used{fault}, so --rgb {rgb} is ignored")
    });
    Ok((Model::with_config(mesh, config), warning))
}

/// Reads the color image of a camera, and removes the distortion of its lens.
pub(super) fn read_image(
    path: &Path,
    camera: &CameraFile,
    camera_path: &Path,
) -> anyhow::Result<ColorImage> {
    let color = limits().read_color(path)?;
    let size = (camera.camera.width(), camera.camera.height());
    let (width, height) = (color.width(), color.height());
    if (width, height) != size {
        bail!(
            "{} is {width}x{height} pixels, but {} is for images of {}x{}, expected the same size: register the color image with the depth image, or state the camera of the color image with --camera and that of the depth image with --depth-camera and --camera-from-depth",
            path.display(),
            camera_path.display(),
            size.0,
            size.1,
        );
    }
    Ok(match &camera.distortion {
        Some(distortion) => distortion.undistort_color(&camera.camera, &color),
        None => color,
    })
}

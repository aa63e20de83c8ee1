//! The files that a refinement reads.

use std::path::PathBuf;

use anyhow::{Context as _, bail};
use clap::Args;
use hicp_io::{CameraFile, IoErrorKind, LengthUnit, PoseFile};
use hybrid_icp::core::{DepthImage, Mask, Model, Observation, PinholeCamera};

use crate::limits::limits;
use crate::options::positive;

/// The files that a refinement reads.
#[derive(Debug, Args)]
pub(crate) struct Inputs {
    /// The object's mesh: OBJ, OFF, PLY or STL.
    #[arg(long, value_name = "FILE")]
    pub(crate) model: PathBuf,
    /// Unit of the mesh's coordinates: m, mm or cm.
    #[arg(long, value_name = "UNIT")]
    pub(crate) model_unit: LengthUnit,
    /// The depth image: 16-bit gray PNG, 0 where nothing was measured.
    #[arg(long, value_name = "FILE")]
    pub(crate) depth: PathBuf,
    /// Millimeters per unit of the depth image, such as 1 or 0.1; the camera file's depth_scale if
    /// not given.
    #[arg(long, value_name = "MM_PER_UNIT", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) depth_scale: Option<f64>,
    /// The object's mask: a PNG of the depth image's size, nonzero on the object.
    #[arg(long, value_name = "FILE")]
    pub(crate) mask: PathBuf,
    /// The camera: JSON with cam_K (nine numbers, row-major), or with fx, fy, cx, cy, width and
    /// height. Pixel centers are at integers.
    #[arg(long, value_name = "FILE")]
    pub(crate) camera: PathBuf,
    /// The rough pose, model to camera: JSON with cam_R_m2c (nine numbers, row-major) and cam_t_m2c
    /// (three numbers in mm).
    #[arg(long, value_name = "FILE")]
    pub(crate) init: PathBuf,
}

/// The content of the files.
pub(crate) struct Read {
    pub(crate) model: Model,
    pub(crate) depth: DepthImage,
    pub(crate) mask: Mask,
    pub(crate) camera: PinholeCamera,
    pub(crate) init: PoseFile,
    pub(crate) depth_scale: f64,
}

impl Inputs {
    /// Reads all files.
    pub(crate) fn read(&self) -> anyhow::Result<Read> {
        let (camera_file, depth_scale) = self.read_camera()?;
        let limits = limits();
        Ok(Read {
            depth: limits.read_depth_png(&self.depth, depth_scale)?,
            mask: limits.read_mask_png(&self.mask)?,
            init: limits.read_pose_json(&self.init)?,
            model: Model::new(limits.read_mesh(&self.model, self.model_unit)?),
            camera: camera_file.camera,
            depth_scale,
        })
    }

    /// Creates the observation from the content of the files.
    pub(crate) fn observe(
        &self,
        depth: DepthImage,
        mask: Mask,
        camera: PinholeCamera,
    ) -> anyhow::Result<Observation> {
        let (depth_file, mask_file) = (self.depth.display(), self.mask.display());
        Observation::new(depth, mask, camera)
            .with_context(|| format!("{depth_file} and {mask_file} do not fit together"))
    }

    /// Returns the files with the options that name them.
    pub(crate) fn files(&self) -> [(&'static str, &PathBuf); 5] {
        [
            ("--model", &self.model),
            ("--depth", &self.depth),
            ("--mask", &self.mask),
            ("--camera", &self.camera),
            ("--init", &self.init),
        ]
    }

    /// Reads the camera and the depth scale.
    ///
    /// First checks that the depth image and the mask have the same size.
    fn read_camera(&self) -> anyhow::Result<(CameraFile, f64)> {
        let size = hicp_io::read_png_size(&self.depth)?;
        let (mask, camera) = (self.mask.display(), self.camera.display());
        let expected = format!(
            "but {} is {}x{}, expected the same size",
            self.depth.display(),
            size.0,
            size.1
        );
        let (width, height) = hicp_io::read_png_size(&self.mask)?;
        if (width, height) != size {
            bail!("{mask} is {width}x{height} pixels {expected}");
        }
        let camera_file = match limits().read_camera_json(&self.camera, size) {
            Err(error) if error.kind == IoErrorKind::CameraSize => {
                bail!("{camera}: found {}, {expected}", error.found)
            }
            read => read?,
        };
        match self.depth_scale.or(camera_file.depth_scale) {
            Some(depth_scale) => Ok((camera_file, depth_scale)),
            None => bail!(
                "{camera}: no depth_scale, expected this key or --depth-scale (millimeters per unit of the depth image)"
            ),
        }
    }
}

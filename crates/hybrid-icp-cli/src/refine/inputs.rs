//! The files that a refinement reads.

use std::path::PathBuf;

use anyhow::{Context as _, bail};
use clap::Args;
use hicp_io::{CameraFile, IoErrorKind, LengthUnit, PoseFile};
use hybrid_icp::core::{DepthImage, Mask, Model, Observation, PinholeCamera};
use hybrid_icp::mask_in_box;

use crate::limits::limits;
use crate::options::positive;

/// The files that describe the object and the image.
#[derive(Clone, Debug, Args)]
pub(crate) struct ImageFiles {
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
    /// The camera: JSON with cam_K (nine numbers, row-major), or with fx, fy, cx, cy, width and
    /// height. Pixel centers are at integers.
    #[arg(long, value_name = "FILE")]
    pub(crate) camera: PathBuf,
}

/// The part of the image that shows the object.
#[derive(Clone, Debug)]
pub(crate) enum Region {
    /// The file of a mask.
    Mask(PathBuf),
    /// A box: x, y, width and height, pixels.
    Box([f64; 4]),
}

/// The inputs of a refinement, or without an initial pose those of an estimate.
#[derive(Clone, Debug)]
pub(crate) struct Inputs {
    pub(crate) files: ImageFiles,
    pub(crate) region: Region,
    pub(crate) init: Option<PathBuf>,
}

/// The content of the files.
pub(crate) struct Read {
    pub(crate) model: Model,
    pub(crate) depth: DepthImage,
    pub(crate) mask: Mask,
    pub(crate) camera: PinholeCamera,
    pub(crate) init: Option<PoseFile>,
    pub(crate) depth_scale: f64,
}

impl Inputs {
    /// Reads all files.
    pub(crate) fn read(&self) -> anyhow::Result<Read> {
        let (CameraFile { camera, .. }, depth_scale) = self.read_camera()?;
        let limits = limits();
        let files = &self.files;
        let depth = limits.read_depth_png(&files.depth, depth_scale)?;
        Ok(Read {
            mask: match &self.region {
                Region::Mask(path) => limits.read_mask_png(path)?,
                Region::Box(bbox) => mask_in_box(&depth, &camera, *bbox),
            },
            init: match &self.init {
                Some(path) => Some(limits.read_pose_json(path)?),
                None => None,
            },
            model: Model::new(limits.read_mesh(&files.model, files.model_unit)?),
            depth,
            camera,
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
        let (depth_file, mask_name) = (self.files.depth.display(), self.mask_name());
        Observation::new(depth, mask, camera)
            .with_context(|| format!("{depth_file} and {mask_name} do not fit together"))
    }

    /// Returns the path of the mask, or the option of the box.
    pub(crate) fn mask_name(&self) -> String {
        match &self.region {
            Region::Mask(path) => path.display().to_string(),
            Region::Box(_) => "--bbox".to_owned(),
        }
    }

    /// Returns the files with the options that name them.
    pub(crate) fn files(&self) -> impl Iterator<Item = (&'static str, &PathBuf)> {
        let files = &self.files;
        let mask = match &self.region {
            Region::Mask(path) => Some(path),
            Region::Box(_) => None,
        };
        let given = [
            ("--model", Some(&files.model)),
            ("--depth", Some(&files.depth)),
            ("--mask", mask),
            ("--camera", Some(&files.camera)),
            ("--init", self.init.as_ref()),
        ];
        let given = given.into_iter();
        given.filter_map(|(option, path)| Some((option, path?)))
    }

    /// Reads the camera and the depth scale.
    ///
    /// First checks that the depth image and the mask have the same size.
    fn read_camera(&self) -> anyhow::Result<(CameraFile, f64)> {
        let files = &self.files;
        let size = hicp_io::read_png_size(&files.depth)?;
        let camera = files.camera.display();
        let expected = format!(
            "but {} is {}x{}, expected the same size",
            files.depth.display(),
            size.0,
            size.1
        );
        if let Region::Mask(mask) = &self.region {
            let (width, height) = hicp_io::read_png_size(mask)?;
            if (width, height) != size {
                bail!("{} is {width}x{height} pixels {expected}", mask.display());
            }
        }
        let camera_file = match limits().read_camera_json(&files.camera, size) {
            Err(error) if error.kind == IoErrorKind::CameraSize => {
                bail!("{camera}: found {}, {expected}", error.found)
            }
            read => read?,
        };
        match files.depth_scale.or(camera_file.depth_scale) {
            Some(depth_scale) => Ok((camera_file, depth_scale)),
            None => bail!(
                "{camera}: no depth_scale, expected this key or --depth-scale (millimeters per unit of the depth image)"
            ),
        }
    }
}

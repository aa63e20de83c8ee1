//! The files that a refinement reads.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use clap::{ArgGroup, Args};
use hicp_io::{
    CameraFile, IoErrorKind, LengthUnit, MaskFile, MaskRule, PoseFile, RawDepth, register_depth,
};
use hybrid_icp::checks::{box_overlaps, warning_of_box};
use hybrid_icp::core::{ColorImage, DepthImage, Mask, Model, Observation, PinholeCamera};
use serde::{Deserialize, Serialize};

use super::object::ObjectFiles;
use crate::limits::limits;
use crate::options::{finite, positive};

/// Distance of two cameras of one device above which a translation may be in another unit.
const FARTHEST_CAMERAS_METERS: f64 = 1.0;

/// The files that describe the object and the image.
#[derive(Clone, Debug, Args, Serialize, Deserialize)]
pub(crate) struct ImageFiles {
    #[command(flatten)]
    pub(crate) object: ObjectFiles,
    /// The depth image: PNG, TIFF, NPY, NPZ, EXR, PGM or PFM. 16-bit integers with a depth scale,
    /// or floating-point meters; 0 or NaN where nothing was measured.
    #[arg(long, value_name = "FILE")]
    pub(crate) depth: PathBuf,
    /// Millimeters per unit of the depth image, such as 1 or 0.1. If not given: the camera file's
    /// depth_scale for integers, meters for floating point.
    #[arg(long, value_name = "MM_PER_UNIT", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) depth_scale: Option<f64>,
    /// The color image of --camera, of the mask's size: PNG, JPEG or TIFF. It decides where depth
    /// alone is ambiguous, and needs a mesh with colors or textures.
    #[arg(long, value_name = "FILE")]
    pub(crate) rgb: Option<PathBuf>,
    /// The camera, as JSON, YAML, XML, text, NPY or NPZ. The file has cam_K (nine numbers,
    /// row-major), fx, fy, cx and cy, or a 3x3 matrix, or is of ROS, OpenCV, RealSense or Open3D.
    /// Pixel centers are at integers. If it has lens distortion, the images are undistorted.
    #[arg(long, value_name = "FILE")]
    pub(crate) camera: PathBuf,
    /// The camera of the depth image, if it is another one than that of the mask. The depth is then
    /// moved into the image of --camera, which the mask, --init and the result belong to.
    #[arg(
        long,
        value_name = "FILE",
        requires = "camera_from_depth",
        requires = "mask"
    )]
    pub(crate) depth_camera: Option<PathBuf>,
    /// The pose of the depth camera in the frame of --camera, in a form of --init.
    #[arg(long, value_name = "FILE", requires = "depth_camera")]
    pub(crate) camera_from_depth: Option<PathBuf>,
    /// Unit of the translation of --camera-from-depth: m, mm or cm. If not given: mm for cam_t_m2c,
    /// m for all other forms.
    #[arg(long, value_name = "UNIT", requires = "camera_from_depth")]
    pub(crate) camera_from_depth_unit: Option<LengthUnit>,
}

/// The pixels of a mask that belong to the object.
#[derive(Clone, Copy, Debug, Args, Serialize, Deserialize)]
pub(crate) struct MaskOptions {
    /// The smallest value of the mask that is on the object, such as 128 or 0.5. For soft masks and
    /// probabilities.
    #[arg(long, value_name = "N", value_parser = finite, allow_negative_numbers = true)]
    mask_threshold: Option<f64>,
    /// The value of the mask that is on the object, such as 3, or a color such as #ff0000. For
    /// label images.
    #[arg(
        long,
        value_name = "N",
        value_parser = label,
        allow_negative_numbers = true,
        conflicts_with = "mask_threshold"
    )]
    mask_value: Option<f64>,
}

/// Parses a number or a color.
fn label(text: &str) -> Result<f64, String> {
    let color = text.strip_prefix('#').filter(|hex| hex.len() == 6);
    match color.and_then(|hex| u32::from_str_radix(hex, 16).ok()) {
        Some(color) => Ok(MaskRule::COLOR + f64::from(color)),
        None => finite(text).map_err(|_| "expected a number, or a color as #rrggbb".to_owned()),
    }
}

impl MaskOptions {
    pub(crate) fn rule(self) -> MaskRule {
        match (self.mask_threshold, self.mask_value) {
            (Some(least), _) => MaskRule::AtLeast(least),
            (None, Some(value)) => MaskRule::Equal(value),
            (None, None) => MaskRule::NotZero,
        }
    }
}

/// The mask of the object, or its box.
#[derive(Clone, Debug, Args, Serialize, Deserialize)]
#[command(group(ArgGroup::new("region").required(true).args(["mask", "bbox"])))]
pub(crate) struct RegionOptions {
    /// The object's mask, of the depth image's size: PNG, TIFF, BMP, NPY, NPZ or PGM. Nonzero on
    /// the object, or opaque if the opacity varies.
    #[arg(long, value_name = "FILE")]
    pub(super) mask: Option<PathBuf>,
    #[command(flatten)]
    pub(super) mask_options: MaskOptions,
    /// Without a mask: a box around the object, in pixels: its left and upper side, width and
    /// height. `hybrid`, `hybrid-visible` and the baselines treat a table in it as part of the
    /// object.
    #[arg(
        long,
        value_name = "X,Y,W,H",
        value_parser = bbox,
        allow_hyphen_values = true
    )]
    bbox: Option<Bbox>,
}

/// A box: x, y, width and height, pixels.
type Bbox = [f64; 4];

/// Parses a box.
fn bbox(text: &str) -> Result<Bbox, String> {
    let numbers: Result<Vec<f64>, _> = text
        .split(',')
        .map(|number| number.trim().parse())
        .collect();
    let bbox: Option<Bbox> = numbers.ok().and_then(|numbers| numbers.try_into().ok());
    bbox.filter(|[x, y, width, height]| {
        let is_finite = [x, y, width, height].iter().all(|n| n.is_finite());
        is_finite && *width >= 1.0 && *height >= 1.0
    })
    .ok_or_else(|| {
        "expected x,y,width,height in pixels, with a width and height of 1 or more".to_owned()
    })
}

/// Reads a camera for the images of `size` in `image`.
pub(crate) fn read_camera(
    path: &Path,
    size: (u32, u32),
    image: &Path,
) -> anyhow::Result<CameraFile> {
    match limits().read_camera(path, size) {
        Err(error) if error.kind == IoErrorKind::CameraSize => bail!(
            "{}: found {}, but {} is {}x{}, expected the same size",
            path.display(),
            error.found,
            image.display(),
            size.0,
            size.1
        ),
        read => Ok(read?),
    }
}

/// Converts a depth image to meters and removes the distortion of its lens.
///
/// Also returns the millimeters per unit: `scale`, or if not given, those of the camera file at
/// `path`, or 1000 for floating point.
pub(crate) fn to_meters(
    depth: RawDepth,
    scale: Option<f64>,
    camera: &CameraFile,
    path: &Path,
) -> anyhow::Result<(DepthImage, f64)> {
    let default = match depth.is_float() {
        true => Some(1000.0),
        false => camera.depth_scale,
    };
    let Some(scale) = scale.or(default) else {
        bail!(
            "{}: no depth_scale, expected this key or --depth-scale (millimeters per unit of the depth image)",
            path.display()
        )
    };
    let depth = depth.scaled(Some(scale))?;
    let undistorted = camera.distortion.as_ref();
    let undistorted = undistorted.map(|lens| lens.undistort_depth(&camera.camera, &depth));
    Ok((undistorted.unwrap_or(depth), scale))
}

/// Reads the color image of a camera, and removes the distortion of its lens.
fn read_color(path: &Path, camera: &CameraFile, camera_path: &Path) -> anyhow::Result<ColorImage> {
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

/// The inputs of a refinement, or without an initial pose those of an estimate.
///
/// They are the options of the program, and a trace stores them as JSON.
#[derive(Clone, Debug, Args, Serialize, Deserialize)]
pub(crate) struct Inputs {
    #[command(flatten)]
    pub(crate) files: ImageFiles,
    #[command(flatten)]
    pub(crate) region: RegionOptions,
    /// The rough pose, model to camera, as JSON, YAML, XML, text, NPY or NPZ. The file has
    /// cam_R_m2c (nine numbers, row-major) and cam_t_m2c (three numbers in mm), a 4x4 matrix, R and
    /// t, a translation and a quaternion of stated order, or a TUM line (x y z qx qy qz qw).
    #[arg(long, value_name = "FILE", required = true)]
    pub(crate) init: Option<PathBuf>,
    /// Unit of the translation of --init: m, mm or cm. If not given: mm for cam_t_m2c, m for all
    /// other forms.
    #[arg(long, value_name = "UNIT")]
    pub(crate) init_unit: Option<LengthUnit>,
}

/// The content of the files.
pub(crate) struct Read {
    pub(crate) model: Model,
    pub(crate) depth: DepthImage,
    pub(crate) mask: Mask,
    pub(crate) color: Option<ColorImage>,
    pub(crate) camera: PinholeCamera,
    pub(crate) init: Option<PoseFile>,
    /// Millimeters per unit of the depth image.
    pub(crate) depth_scale: f64,
    pub(crate) warnings: Vec<String>,
}

impl Inputs {
    /// Reads all files.
    pub(crate) fn read(&self) -> anyhow::Result<Read> {
        let limits = limits();
        let files = &self.files;
        let depth = limits.read_raw_depth(&files.depth)?;
        let (depth_size, mut warnings) = (depth.size(), Vec::new());
        let read_other = |path: &PathBuf| read_camera(path, depth_size, &files.depth);
        let depth_camera = files.depth_camera.as_ref().map(read_other).transpose()?;
        let region = &self.region;
        let bbox = region.bbox.unwrap_or_default();
        let file_mask = match &region.mask {
            Some(path) => {
                let read = limits.read_mask(path, region.mask_options.rule())?;
                let MaskFile { mask, warning, .. } = read;
                let (width, height) = (mask.width(), mask.height());
                if (width, height) != depth_size && depth_camera.is_none() {
                    let (w, h) = depth_size;
                    bail!(
                        "{} is {width}x{height} pixels, but {} is {w}x{h}, expected the same size (--depth-camera and --camera-from-depth state another camera)",
                        path.display(),
                        files.depth.display()
                    );
                }
                warnings.extend(warning.map(|text| format!("{}: {text}", path.display())));
                Some(mask)
            }
            None => {
                let ([x, y, width, height], (w, h)) = (bbox, depth_size);
                if !box_overlaps(bbox, depth_size) {
                    bail!(
                        "--bbox {x},{y},{width},{height}: the box is outside of the {w}x{h} image {}, expected x,y,width,height in its pixels",
                        files.depth.display()
                    );
                }
                let warning = warning_of_box(bbox, depth_size);
                warnings
                    .extend(warning.map(|text| format!("--bbox {x},{y},{width},{height}: {text}")));
                None
            }
        };
        let (size, sized) = match (&file_mask, &region.mask) {
            (Some(mask), Some(path)) if depth_camera.is_some() => {
                ((mask.width(), mask.height()), path)
            }
            _ => (depth_size, &files.depth),
        };
        let of_mask = read_camera(&files.camera, size, sized)?;
        let of_depth = depth_camera.as_ref().unwrap_or(&of_mask);
        let camera = of_mask.camera;
        let named = files.depth_camera.as_ref().unwrap_or(&files.camera);
        let (mut depth, depth_scale) = to_meters(depth, files.depth_scale, of_depth, named)?;
        if let Some(path) = &files.camera_from_depth {
            let pose = limits.read_pose(path, files.camera_from_depth_unit)?;
            let pose = pose.camera_from_object;
            let meters = pose.translation.vector.norm();
            if meters > FARTHEST_CAMERAS_METERS {
                warnings.push(format!(
                    "{}: the cameras are {meters:.1} m apart: check --camera-from-depth-unit",
                    path.display()
                ));
            }
            depth = register_depth(&depth, &of_depth.camera, &camera, &pose);
        }
        let mask = match (file_mask, &of_mask.distortion) {
            (Some(mask), Some(distortion)) => distortion.undistort_mask(&camera, &mask),
            (Some(mask), None) => mask,
            (None, _) => Mask::in_box(depth.width(), depth.height(), bbox),
        };
        let rgb = files.rgb.as_deref();
        let (model, of_object) = files.object.read(rgb)?;
        warnings.extend(of_object);
        let color = rgb.map(|path| read_color(path, &of_mask, &files.camera));
        let init = self.init.as_ref();
        let init = init.map(|path| limits.read_pose(path, self.init_unit));
        Ok(Read {
            mask,
            color: color.transpose()?,
            init: init.transpose()?,
            model,
            depth,
            camera,
            depth_scale,
            warnings,
        })
    }

    /// Creates the observation from the content of the files.
    pub(crate) fn observe(
        &self,
        depth: DepthImage,
        mask: Mask,
        color: Option<ColorImage>,
        camera: PinholeCamera,
    ) -> anyhow::Result<Observation> {
        let (depth_file, mask_name) = (self.files.depth.display(), self.mask_name());
        let observation = Observation::new(depth, mask, camera)
            .with_context(|| format!("{depth_file} and {mask_name} do not fit together"))?;
        Ok(match color {
            Some(color) => observation.with_color(color)?,
            None => observation,
        })
    }

    /// Returns the path of the mask, or the option of the box.
    pub(crate) fn mask_name(&self) -> String {
        match &self.region.mask {
            Some(path) => path.display().to_string(),
            None => "--bbox".to_owned(),
        }
    }

    /// Returns the files with the options that name them.
    pub(crate) fn files(&self) -> impl Iterator<Item = (&'static str, &PathBuf)> {
        let files = &self.files;
        let given = [
            ("--model", Some(&files.object.mesh)),
            ("--symmetries", files.object.symmetries.as_ref()),
            ("--depth", Some(&files.depth)),
            ("--mask", self.region.mask.as_ref()),
            ("--rgb", files.rgb.as_ref()),
            ("--camera", Some(&files.camera)),
            ("--depth-camera", files.depth_camera.as_ref()),
            ("--camera-from-depth", files.camera_from_depth.as_ref()),
            ("--init", self.init.as_ref()),
        ];
        let given = given.into_iter();
        given.filter_map(|(option, path)| Some((option, path?)))
    }
}

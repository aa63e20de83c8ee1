//! Reading and writing of files for Hybrid ICP: meshes, depth images, masks, cameras, poses, BOP
//! datasets and result files.
//!
//! **Should you use this crate?** Use it to read the files of robots, scanners and benchmarks into
//! the types of `hicp-core`, and to write them. It is not a general mesh or image library: it keeps
//! geometry and the color of the surface, and drops all other properties of materials.
//!
//! - Units: files may be in millimeters. Values in memory are in meters and seconds, unless their
//!   names state another unit.
//! - Errors: for any content, a reader returns a value or an [`IoError`]. The error names the file,
//!   the place in it, the value found and the value expected.
//! - Safety: no reader panics or allocates more memory than the size of the file justifies.
//! - Writers replace a file completely or leave it unchanged ([`write_atomically`]).
//!
//! ```
//! use hicp_core::{DepthImage, Isometry3, Translation3};
//! use hicp_io::{LengthUnit, read_depth_png, read_mesh, write_depth_png};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let dir = tempfile::tempdir()?;
//! # let (mesh_path, depth_path) = (dir.path().join("part.obj"), dir.path().join("depth.png"));
//! std::fs::write(&mesh_path, "v 0 0 0\nv 100 0 0\nv 0 100 0\nf 1 2 3\n")?;
//! let mesh = read_mesh(&mesh_path, LengthUnit::Millimeters)?;
//! assert!((mesh.area() - 0.005).abs() < 1e-9); // square meters
//!
//! let depth = DepthImage::from_meters(2, 1, vec![0.5, 0.0])?;
//! write_depth_png(&depth_path, &depth, 0.1)?; // 0.1 mm per unit
//! assert_eq!(read_depth_png(&depth_path, 0.1)?, depth);
//!
//! let camera_from_object = Isometry3::from(Translation3::new(0.0, 0.0, 0.8));
//! assert_eq!(hicp_io::pose_to_bop(&camera_from_object).1, [0.0, 0.0, 800.0]);
//! # Ok(()) }
//! ```

mod error;
mod format;
#[cfg(feature = "npy")]
mod npy;
mod number;

mod limits;
pub use limits::ReadLimits;

mod source;
pub use source::is_absent;

mod atomic;
mod atomic_folder;
pub use atomic::{check_writable, destination, is_stream, write_atomically};
pub use atomic_folder::NewFolder;
pub use error::{IoError, IoErrorKind, Place};

mod row_log;
pub use row_log::RowLog;

mod unit;
pub use unit::LengthUnit;

mod mesh;
pub use mesh::{MeshFile, read_mesh, write_obj, write_ply};

mod cloud;
pub use cloud::{PointCloud, read_cloud, write_point_cloud_ply};

mod image;
pub use image::{
    MaskFile, MaskRule, RawDepth, read_color, read_depth, read_depth_png, read_mask, read_mask_png,
    read_png_size, write_depth_png, write_mask_png, write_rgb_png,
};

mod document;
mod json;

mod pose;
pub use pose::{PoseFile, pose_from_bop, pose_to_bop, read_pose, read_pose_json, write_pose_json};

mod camera;
pub use camera::{CameraFile, Distortion, read_camera, read_camera_json, register_depth};

pub mod bop;

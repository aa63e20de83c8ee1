//! The data types of Hybrid ICP: poses, cameras, depth images, observations, models and pairs.
//!
//! It also defines the trait of renderers.
//!
//! **Should you use this crate?** Yes, if you write a component (an association, a metric, a score)
//! and want few dependencies. To refine poses, use `hybrid-icp`, which re-exports this crate.
//!
//! Everything is in meters and radians. A transform reads `b_from_a` and maps coordinates in frame
//! `a` to frame `b`: the paper's T_CO is `camera_from_object`. Cameras look along +z, with x right
//! and y down. Pixel centers are at integers. Buffers hold `f32`; poses and normal equations hold
//! `f64`.
//!
//! ```
//! use hicp_core::{DepthImage, Isometry3, Mask, Observation, PinholeCamera, Point3, TriMesh, Model};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let camera = PinholeCamera::new(60.0, 60.0, 31.5, 23.5, 64, 48)?;
//! let depth = DepthImage::from_meters(64, 48, vec![0.5; 64 * 48])?;
//! let observation = Observation::new(depth, Mask::full(64, 48), camera)?;
//! let (a, b) = (0.05, 0.1);
//! let corners = vec![Point3::new(0.0, 0.0, 0.0), Point3::new(a, 0.0, 0.0), Point3::new(0.0, b, 0.0)];
//! let model = Model::new(TriMesh::new(corners, vec![[0, 1, 2]])?);
//! assert!((model.diameter() - f64::hypot(0.05, 0.1)).abs() < 1e-6);
//! assert_eq!(observation.n_surfels(), 64 * 48);
//! # Ok(()) }
//! ```

// Counts and pixel coordinates are converted to floating point throughout; all are far below 2²⁴.
#![allow(clippy::cast_precision_loss)]

mod cloud;
mod correspondences;
mod derived;
mod id;
#[doc(hidden)]
pub mod internal;
mod object;
mod pose;
mod problem;
mod render;
mod sensor;
mod surfel;

pub use cloud::Cloud;
pub use correspondences::{Correspondences, Pair, RigidTransform};
pub use derived::Derived;
pub use id::Id;
pub use internal::suggest::UnknownName;
pub use nalgebra;
pub use nalgebra::{
    Isometry3, Matrix3, Matrix4, Matrix6, Point2, Point3, Quaternion, Translation3, UnitQuaternion,
    UnitVector3, Vector3, Vector6,
};
pub use object::diameter::diameter;
pub use object::mesh::{Facing, MAX_COORDINATE_METERS, MAX_MESH_ELEMENTS, MeshError, TriMesh};
pub use object::mesh_survey::MeshSurvey;
pub use object::model::{Model, ModelConfig};
pub use object::sampling::{MAX_SAMPLES, sample_colored_surface, sample_surface};
pub use object::sides::{Side, Sides};
pub use object::surface_color::{SurfaceColor, TexturedTriangle};
pub use object::symmetry::{MAX_SYMMETRY_MOTIONS, Symmetries, SymmetryAxis, SymmetryError};
pub use pose::rotation::{PoseMatrixError, RotationError, pose_from_matrix, rotation_from_matrix};
pub use pose::rotation_grid::rotation_grid;
pub use pose::{se3, so3};
pub use problem::{Context, Iteration, Problem, Source, Target};
pub use render::{NO_TRIANGLE, RenderCache, RenderedView, Renderer};
pub use sensor::camera::{
    CameraError, MAX_FOCAL_LENGTH, MAX_IMAGE_SIDE, MIN_FOCAL_LENGTH, PinholeCamera, PixelCenters,
};
pub use sensor::image::{
    ColorImage, DepthImage, DistanceImage, ImageError, MAX_DEPTH_METERS, MIN_DEPTH_METERS, Mask,
};
pub use sensor::normals::NormalWindow;
pub use sensor::observation::Observation;
pub use sensor::region::PixelRegion;
pub use surfel::Surfel;

pub use nalgebra::{
    Isometry3, Matrix3, Matrix6, Point2, Point3, Translation3, UnitQuaternion, UnitVector3,
    Vector3, Vector6,
};
mod camera;
mod derived;
mod diameter;
mod error;
mod id;
mod image;
mod mesh;
mod model;
mod region;
mod rotation;
mod sampling;
pub mod se3;
pub mod so3;
mod surfel;
mod symmetry;
pub use camera::{MAX_IMAGE_SIDE, PinholeCamera, PixelCenters};
pub use derived::Derived;
pub use diameter::diameter;
pub use error::{CameraError, ImageError, MeshError, RotationError, SymmetryError};
pub use id::Id;
pub use image::{DepthImage, DistanceImage, MAX_DEPTH_METERS, Mask};
pub use mesh::{Facing, MAX_COORDINATE_METERS, MAX_MESH_ELEMENTS, TriMesh};
pub use model::{Model, ModelConfig};
pub use region::PixelRegion;
pub use rotation::{ROTATION_TOLERANCE, rotation_from_matrix};
pub use sampling::sample_surface;
pub use surfel::Surfel;
pub use symmetry::{CONTINUOUS_STEPS, Symmetries, SymmetryAxis};
mod render;
pub use render::{NO_TRIANGLE, RenderCache, RenderedView, Renderer};

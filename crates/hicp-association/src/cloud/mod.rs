//! Preparation of point clouds: normals and downsampling.

pub(crate) mod downsampling;
pub(crate) mod normals;

pub use downsampling::voxel_downsample;
pub use normals::estimate_normals;

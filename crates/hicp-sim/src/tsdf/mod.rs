//! Surfaces from many depth images: a truncated signed distance function, its mesh and its parts.

mod components;
mod meshing;
mod volume;

pub use components::{Component, components, join};
pub use meshing::ScalarGrid;
pub use volume::{MAX_VOXELS, TsdfConfig, TsdfVolume};

//! Selections: the model points to register.

pub(crate) mod all_samples;
pub(crate) mod keep;
pub(crate) mod normal_space;
pub(crate) mod observed_surface;
pub(crate) mod point_selection;
pub(crate) mod random_sample;
pub(crate) mod stable_sampling;
pub(crate) mod uniform_count;
pub(crate) mod visible_side;
pub(crate) mod visible_surface;
pub(crate) mod voxel_grid;
pub(crate) mod without_boundary;

pub use all_samples::AllSamples;
pub use normal_space::NormalSpace;
pub use observed_surface::ObservedSurface;
pub use point_selection::PointSelection;
pub use random_sample::RandomSample;
pub use stable_sampling::StableSampling;
pub use uniform_count::UniformCount;
pub use visible_side::VisibleSide;
pub use visible_surface::{SelectAt, VisibleSurface};
pub use voxel_grid::VoxelGrid;
pub use without_boundary::WithoutBoundary;

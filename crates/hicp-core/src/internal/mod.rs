//! Helpers that the crates of this workspace share. No stability is promised.

mod background;
mod disjoint_sets;
mod index;
mod label;
mod noise;
pub(crate) mod number;
mod plane;
mod scratch;
mod seen_colors;
pub mod small;
mod statistics;
pub(crate) mod suggest;
mod tuples;
mod vectorized;
mod whole;
mod work;

pub use background::{Background, Surroundings};
pub use disjoint_sets::DisjointSets;
pub use index::index;
pub use label::type_label;
pub use plane::DepthPlane;
pub use scratch::Scratch;
pub use seen_colors::{ColorSamples, FacingSample, SeenColors, faces_camera};
pub use statistics::{bounds, centroid, median};
pub use suggest::{named, nearest_name};
pub use vectorized::{VectorLoop, stored, vectorized};
pub use whole::whole;
pub use work::Work;

pub use crate::for_tuples;
pub use crate::object::mesh::coordinate_step;
pub use crate::render::pose_bits;
pub use crate::sensor::image::check_size;

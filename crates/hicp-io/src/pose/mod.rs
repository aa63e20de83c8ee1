//! Reading and writing of poses.

mod bop;
mod forms;

pub(crate) use bop::Rotation;
pub use bop::{PoseFile, pose_from_bop, pose_to_bop, read_pose_json, write_pose_json};
pub use forms::read_pose;

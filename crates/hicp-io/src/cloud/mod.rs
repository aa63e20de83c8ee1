//! Reading and writing of point clouds.

mod lzf;
mod pcd;
mod ply;
mod points;
mod read;
mod table;

pub use ply::write_point_cloud_ply;
pub use points::PointCloud;
pub use read::read_cloud;

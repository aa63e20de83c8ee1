//! Search structures that associations share.

pub(crate) mod box_tree;
#[cfg(feature = "kiddo")]
pub(crate) mod kd_tree;
pub(crate) mod nearest;
pub(crate) mod neighborhood;
pub(crate) mod observed_points;
pub(crate) mod point_index;
pub(crate) mod point_search;
pub(crate) mod point_tree;
pub(crate) mod triangle;

pub use nearest::Nearest;
pub use point_search::PointSearch;

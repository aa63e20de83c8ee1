//! Search structures that associations share.

pub(crate) mod box_tree;
pub(crate) mod observed_points;
pub(crate) mod point_grid;
pub(crate) mod point_tree;
pub(crate) mod triangle;
pub(crate) mod wide_tree;

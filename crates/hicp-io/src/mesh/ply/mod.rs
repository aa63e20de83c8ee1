//! PLY files, ASCII and binary.

mod header;
mod parse;
mod rows;
mod write;

pub(crate) use parse::{check_head, parse_mesh, parse_points};
pub(crate) use write::write;

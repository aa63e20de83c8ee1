//! The book and its pictures.

pub(crate) mod book;
pub(crate) mod look;
pub(crate) mod pictures;

//! Helpers: runs of the program, a scene in files, and a dataset in files.

mod folder;
mod scene;
mod world;

pub(crate) use folder::*;
pub(crate) use scene::*;
pub(crate) use world::*;

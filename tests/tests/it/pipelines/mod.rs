//! Pipelines from files.

mod cross;
mod files;
mod limits;

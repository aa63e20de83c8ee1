//! Reconstructed models, shared by all threads.

use std::sync::OnceLock;

use hicp_core::Model;

use crate::error::ExperimentError;

/// Largest number of reconstructions of an object.
const LEVELS: usize = 4;

/// The reconstructions of every object. The first thread that needs one creates it.
#[derive(Debug)]
pub struct Models {
    made: Vec<[OnceLock<Result<Model, String>>; LEVELS]>,
}

impl Models {
    pub(crate) fn new(objects: usize) -> Self {
        Self {
            made: (0..objects).map(|_| Default::default()).collect(),
        }
    }

    /// Returns reconstruction `level`, from 0, of an object. If there is none yet, calls `make`.
    pub(crate) fn get(
        &self,
        object: usize,
        level: usize,
        make: impl FnOnce() -> Result<Model, ExperimentError>,
    ) -> Result<&Model, String> {
        let made = self.made[object][level].get_or_init(|| make().map_err(|e| e.to_string()));
        made.as_ref().map_err(Clone::clone)
    }
}

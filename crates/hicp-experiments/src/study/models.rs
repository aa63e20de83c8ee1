//! Reconstructed models, shared by all threads.

use std::sync::OnceLock;

use hicp_core::Model;

use crate::error::ExperimentError;

/// Most reconstructions of an object.
const LEVELS: usize = 4;

/// The reconstructions of every object. Each is made by the first thread that needs it.
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

    /// Returns reconstruction `level` of an object, from 0; `make` is called if there is none yet.
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

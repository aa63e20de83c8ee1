//! The models of a dataset's objects.

use std::collections::BTreeSet;
use std::path::Path;

use hicp_bop::{ModelFolder, Models};
use hicp_io::IoError;
use rayon::prelude::*;

/// Reads the models of some objects from a folder, on all threads.
pub(crate) fn read(dir: &Path, objects: &BTreeSet<u32>) -> Result<Models, IoError> {
    let folder = ModelFolder::open(dir)?;
    let objects: Vec<u32> = objects.iter().copied().collect();
    let read: Vec<_> = objects
        .par_iter()
        .map(|id| (*id, folder.read(*id)))
        .collect();
    Ok(read.into_iter().collect())
}

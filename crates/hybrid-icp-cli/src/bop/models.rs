//! The models of a dataset's objects.

use std::collections::BTreeSet;
use std::path::Path;

use hicp_bop::{ModelFolder, Models};
use hicp_io::IoError;
use hicp_io::bop::Dataset;
use rayon::prelude::*;

use crate::limits::limits;

/// Reads the models of some objects from a folder, on all threads.
pub(crate) fn read(dir: &Path, objects: &BTreeSet<u32>) -> Result<Models, IoError> {
    let folder = ModelFolder::open_within(limits(), dir)?;
    let objects: Vec<u32> = objects.iter().copied().collect();
    let read: Vec<_> = objects
        .par_iter()
        .map(|id| (*id, folder.read(*id)))
        .collect();
    Ok(read.into_iter().collect())
}

/// Tells which objects a folder has no model of, and where the first was looked for.
pub(crate) fn tell_missing(models: &Models, dir: &Path) -> Option<String> {
    let first = Dataset::model_path_in(dir, *models.missing.first()?);
    let ids: Vec<String> = models.missing.iter().map(u32::to_string).collect();
    Some(format!(
        "the dataset has no model of object {}, expected {}",
        ids.join(", "),
        first.display()
    ))
}

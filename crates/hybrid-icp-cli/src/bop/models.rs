//! The models of a dataset's objects.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use hicp_bop::{ModelFolder, Models};
use hicp_io::IoError;
use hicp_io::bop::Dataset;
use hybrid_icp::{Model, warning_of_diameter};
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

/// Tells of which objects the folder's `models_info.json` states another diameter than the mesh has, on all threads.
pub(crate) fn diameter_warnings(models: &Models, dir: &Path) -> BTreeMap<u32, String> {
    let models: Vec<_> = models.by_id.iter().collect();
    let doubted = models
        .par_iter()
        .filter_map(|(id, model)| Some((**id, diameter_warning(**id, model, dir)?)));
    doubted.collect()
}

/// Tells if the folder's `models_info.json` states another diameter of an object than its mesh has: masks, pairs, the MVE and recalls are
/// judged by it, and all of them go on working with a wrong one.
pub(crate) fn diameter_warning(obj_id: u32, model: &Model, dir: &Path) -> Option<String> {
    let info = dir.join("models_info.json");
    // Without the file the mesh's own diameter was taken.
    if hicp_io::is_absent(&info) {
        return None;
    }
    let warning = warning_of_diameter(model)?;
    Some(format!(
        "{}: object {obj_id}: {warning}: poses, the MVE and recalls depend on it, check both",
        info.display()
    ))
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

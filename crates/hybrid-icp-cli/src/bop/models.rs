//! The models of a dataset's objects.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use hicp_bop::{ModelFolder, Models};
use hicp_io::IoError;
use hicp_io::bop::Dataset;
use hybrid_icp::core::Model;
use hybrid_icp::warning_of_diameter;
use rayon::prelude::*;

use crate::limits::limits;

/// Reads the models of some objects from a folder, on all threads.
pub(crate) fn read(dir: &Path, objects: &BTreeSet<u32>) -> Result<Models, IoError> {
    let folder = ModelFolder::open_within(limits(), dir)?;
    let read = objects.par_iter().map(|id| (*id, folder.read(*id)));
    Ok(read.collect::<Vec<_>>().into_iter().collect())
}

/// Returns messages about the objects whose stated diameter differs from that of the mesh, on all threads.
pub(crate) fn wrong_diameters(models: &Models, dir: &Path) -> BTreeMap<u32, String> {
    let models = models.by_id.par_iter();
    let wrong = models.filter_map(|(id, model)| Some((*id, wrong_diameter(*id, model, dir)?)));
    wrong.collect()
}

/// Returns a message if the folder's `models_info.json` states another diameter of an object than its mesh has.
///
/// Masks, pairs, the MVE and recalls depend on the diameter, and none of them fails if it is wrong.
pub(crate) fn wrong_diameter(obj_id: u32, model: &Model, dir: &Path) -> Option<String> {
    let info = dir.join("models_info.json");
    // Without the file, the diameter is that of the mesh.
    if hicp_io::is_absent(&info) {
        return None;
    }
    let warning = warning_of_diameter(model)?;
    Some(format!(
        "{}: object {obj_id}: {warning}: poses, the MVE and recalls depend on it, check both",
        info.display()
    ))
}

/// Returns a message about the objects without a model in a folder, with the path where the first was expected.
pub(crate) fn missing(models: &Models, dir: &Path) -> Option<String> {
    let first = Dataset::model_path_in(dir, *models.missing.first()?);
    Some(format!(
        "the dataset has no model of object {}, expected {}",
        ids(&models.missing),
        first.display()
    ))
}

/// Lists ids, separated by commas.
pub(crate) fn ids<'a>(ids: impl IntoIterator<Item = &'a u32>) -> String {
    let ids: Vec<String> = ids.into_iter().map(u32::to_string).collect();
    ids.join(", ")
}

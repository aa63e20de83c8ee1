//! The models of a dataset's objects.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use clap::Args;
use hicp_bop::{ModelFolder, Models, chain};
use hicp_io::bop::Dataset;
use hicp_io::{IoError, LengthUnit};
use hybrid_icp::Warning;
use hybrid_icp::checks::{warning_of_diameter, warning_of_symmetries, warnings_of_model};
use hybrid_icp::core::Model;
use rayon::prelude::*;

use crate::bop::advice::is_about_diameter;
use crate::limits::limits;
use crate::terminal::warn;

/// The options for the models to register.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct ModelOptions {
    /// Take the meshes from another folder: one of the dataset, such as models_color, or a path.
    /// Diameters and symmetries are still those of models/models_info.json.
    #[arg(long = "models", value_name = "DIR")]
    folder: Option<PathBuf>,
    /// Ignore the colors of the meshes and the images in rgb/. Otherwise, they are used if both
    /// exist.
    #[arg(long)]
    pub(crate) no_color: bool,
}

impl ModelOptions {
    /// Opens the folder of the meshes.
    pub(crate) fn open(&self, dataset: &Dataset) -> Result<ModelFolder, IoError> {
        let mut dataset = dataset.clone();
        if let Some(folder) = &self.folder {
            dataset = dataset.with_models(folder)?;
        }
        let (dir, info) = (dataset.models_dir()?, dataset.models_info_path()?);
        let folder = ModelFolder::with_info(limits(), dir, info)?;
        Ok(match self.no_color {
            true => folder.without_color(),
            false => folder,
        })
    }
}

/// Returns the reasons why the colors of the meshes cannot be used.
///
/// Without `--models`, they matter only if the pipeline `compares` colors. Reads the meshes without
/// color again.
pub(crate) fn color_faults(
    options: &ModelOptions,
    models: &Models,
    folder: &ModelFolder,
    compares: bool,
) -> Vec<String> {
    if options.no_color || (options.folder.is_none() && !compares) {
        return Vec::new();
    }
    let fault = |(obj_id, model): (&u32, &Model)| {
        let path = Dataset::model_path_in(folder.dir(), *obj_id);
        let plain = model.mesh().color().is_none();
        let file = plain.then(|| limits().read_mesh_file(path, LengthUnit::Millimeters));
        file?.ok()?.color_fault.map(|fault| chain(&fault))
    };
    models.by_id.iter().filter_map(fault).collect()
}

/// Reads the models of some objects from a folder, without colors, on all threads.
pub(crate) fn read(dir: &Path, objects: &BTreeSet<u32>) -> Result<Models, IoError> {
    let folder = ModelFolder::with_info(limits(), dir, dir.join("models_info.json"))?;
    Ok(read_from(&folder.without_color(), objects))
}

/// Reads the models of some objects, on all threads.
pub(crate) fn read_from(folder: &ModelFolder, objects: &BTreeSet<u32>) -> Models {
    let read = objects.par_iter().map(|id| (*id, folder.read(*id)));
    read.collect::<Vec<_>>().into_iter().collect()
}

/// Warns of models that seem to have another unit, and of diameters that differ from the meshes.
///
/// `dir` is their folder, and `info` the path of `models_info.json`.
pub(crate) fn warn_of(models: &Models, dir: &Path, info: &Path) {
    undescribed(models, info).into_iter().for_each(warn);
    wrong_symmetries(models, info).iter().for_each(warn);
    let diameters = wrong_diameters(models, info);
    for (obj_id, model) in &models.by_id {
        let diameter = diameters.get(obj_id);
        diameter.into_iter().for_each(warn);
        for warning in warnings_of_model(model) {
            // One warning about the same number is enough.
            let is_told = diameter.is_some() && is_about_diameter(&warning);
            if !is_told && !matches!(warning, Warning::Symmetry { .. }) {
                let dir = dir.display();
                warn(format_args!(
                    "object {obj_id}: {warning}: check that {dir} is in mm"
                ));
            }
        }
    }
}

/// Returns a message for each object whose diameter in `models_info.json` differs from its mesh.
///
/// `info` is the path of that file. Masks, pairs, the MVE and recalls depend on the diameter, and
/// none of them fails if it is wrong.
/// Works on all threads.
pub(crate) fn wrong_diameters(models: &Models, info: &Path) -> BTreeMap<u32, String> {
    // Without the file, the diameter is that of the mesh.
    if hicp_io::is_absent(info) {
        return BTreeMap::new();
    }
    let wrong = models.by_id.par_iter().filter_map(|(obj_id, model)| {
        let warning = warning_of_diameter(model)?;
        let text = format!(
            "{}: object {obj_id}: {warning}: check both, because poses, the MVE and recalls depend on it",
            info.display()
        );
        Some((*obj_id, text))
    });
    wrong.collect()
}

/// Returns a message for each object with a symmetry in `models_info.json`, at path `info`, that
/// moves it to another place.
pub(crate) fn wrong_symmetries(models: &Models, info: &Path) -> Vec<String> {
    let wrong = models.by_id.iter().filter_map(|(obj_id, model)| {
        let warning = warning_of_symmetries(model)?;
        Some(format!("{}: object {obj_id}: {warning}", info.display()))
    });
    wrong.collect()
}

/// Returns a message about the objects that `models_info.json` does not describe, at path `info`.
///
/// Their symmetries are not declared then, so that equivalent poses count as wrong.
pub(crate) fn undescribed(models: &Models, info: &Path) -> Option<String> {
    let absent = hicp_io::is_absent(info);
    let known = match absent {
        true => BTreeMap::new(),
        false => limits().read_models_info(info).ok()?,
    };
    let objects = models.by_id.keys().copied();
    let unknown: Vec<u32> = objects.filter(|id| !known.contains_key(id)).collect();
    let fault = match absent {
        true => "is missing".to_owned(),
        false => format!("does not describe object {}", ids(&unknown)),
    };
    (!unknown.is_empty()).then(|| {
        format!(
            "{} {fault}: no symmetries are declared, and diameters are those of the meshes",
            info.display()
        )
    })
}

/// Returns a message about the objects without a model in a folder.
///
/// It names the path at which the first model was expected.
pub(crate) fn missing(models: &Models, dir: &Path) -> Option<String> {
    let first = Dataset::model_path_in(dir, *models.missing.first()?);
    Some(format!(
        "the dataset has no model for object {}, expected {}",
        ids(&models.missing),
        first.display()
    ))
}

/// Lists ids, separated by commas.
pub(crate) fn ids<'a>(ids: impl IntoIterator<Item = &'a u32>) -> String {
    let ids: Vec<String> = ids.into_iter().map(u32::to_string).collect();
    ids.join(", ")
}

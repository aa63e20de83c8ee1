//! The models of a dataset's objects.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use hicp_io::bop::{Dataset, ModelInfo, read_models_info};
use hicp_io::{IoError, LengthUnit};
use hybrid_icp::{Model, ModelConfig};
use rayon::prelude::*;

use super::problem::chain;
use crate::limits::limits;

/// Models by object id, read once.
#[derive(Debug)]
pub(crate) struct Models {
    /// Those that can be used.
    pub(crate) by_id: BTreeMap<u32, Model>,
    /// Objects that the dataset has no model of.
    pub(crate) missing: Vec<u32>,
    /// What is wrong with the others.
    pub(crate) broken: Vec<String>,
}

impl Models {
    /// Reads the models of some objects from a folder of the dataset, with their sizes and symmetries where it states them.
    pub(crate) fn read(dir: &Path, objects: &BTreeSet<u32>) -> Result<Self, IoError> {
        let info_path = dir.join("models_info.json");
        let infos = if info_path.is_file() {
            read_models_info(info_path)?
        } else {
            BTreeMap::new()
        };
        let objects: Vec<u32> = objects.iter().copied().collect();
        let read: Vec<_> = objects
            .par_iter()
            .map(|id| (*id, read_model(dir, infos.get(id), *id)))
            .collect();
        let mut models = Self {
            by_id: BTreeMap::new(),
            missing: Vec::new(),
            broken: Vec::new(),
        };
        for (id, model) in read {
            match model {
                Ok(Some(model)) => {
                    models.by_id.insert(id, model);
                }
                Ok(None) => models.missing.push(id),
                Err(error) => models.broken.push(chain(&error)),
            }
        }
        Ok(models)
    }
}

/// Reads an object's model; `None` if there is none.
fn read_model(dir: &Path, info: Option<&ModelInfo>, obj_id: u32) -> Result<Option<Model>, IoError> {
    let path = Dataset::model_path_in(dir, obj_id);
    if !path.is_file() {
        return Ok(None);
    }
    let config = ModelConfig {
        diameter: info.map(|i| i.diameter_m),
        symmetries: info.map(|i| i.symmetries.clone()).unwrap_or_default(),
        ..ModelConfig::default()
    };
    let mesh = limits().read_mesh(path, LengthUnit::Millimeters)?;
    Ok(Some(Model::with_config(mesh, config)))
}

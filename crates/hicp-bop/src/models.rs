//! The models of a dataset's objects.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use hicp_io::bop::{Dataset, ModelInfo};
use hicp_io::{IoError, LengthUnit, ReadLimits, is_absent};
use hybrid_icp::core::{Model, ModelConfig};

use crate::fault::chain;

/// A folder of models, with the sizes and symmetries that it states.
#[derive(Clone, Debug)]
pub struct ModelFolder {
    dir: PathBuf,
    infos: BTreeMap<u32, ModelInfo>,
    limits: ReadLimits,
}

impl ModelFolder {
    /// Opens a folder: reads its `models_info.json` where there is one, and no model yet.
    ///
    /// # Errors
    ///
    /// As [`ReadLimits::read_models_info`].
    pub fn open(dir: impl AsRef<Path>) -> Result<Self, IoError> {
        Self::open_within(ReadLimits::DEFAULT, dir)
    }

    /// Opens a folder as [`ModelFolder::open`] does; sizes and models are read within these limits.
    ///
    /// # Errors
    ///
    /// As [`ReadLimits::read_models_info`].
    pub fn open_within(limits: ReadLimits, dir: impl AsRef<Path>) -> Result<Self, IoError> {
        let dir = dir.as_ref().to_owned();
        let info = dir.join("models_info.json");
        let infos = if is_absent(&info) {
            BTreeMap::new()
        } else {
            limits.read_models_info(info)?
        };
        Ok(Self { dir, infos, limits })
    }

    /// Reads the model of an object, metres; `None` if there is none.
    ///
    /// # Errors
    ///
    /// As [`ReadLimits::read_mesh`].
    pub fn read(&self, obj_id: u32) -> Result<Option<Model>, IoError> {
        let path = Dataset::model_path_in(&self.dir, obj_id);
        if is_absent(&path) {
            return Ok(None);
        }
        let info = self.infos.get(&obj_id);
        let config = ModelConfig {
            diameter: info.map(|i| i.diameter_m),
            symmetries: info.map(|i| i.symmetries.clone()).unwrap_or_default(),
            ..ModelConfig::default()
        };
        let mesh = self.limits.read_mesh(path, LengthUnit::Millimeters)?;
        Ok(Some(Model::with_config(mesh, config)))
    }
}

/// Models by object id: those that can be used, and what became of the others.
///
/// Collects what [`ModelFolder::read`] returned, so that a program reads models on its own threads, or when they are first needed.
#[derive(Debug, Default)]
pub struct Models {
    /// Those that can be used.
    pub by_id: BTreeMap<u32, Model>,
    /// Objects that the dataset has no model of, ascending.
    pub missing: BTreeSet<u32>,
    /// What is wrong with the models of the other objects.
    pub broken: BTreeMap<u32, String>,
}

impl Models {
    /// Reads the models of some objects, one after the other.
    #[must_use]
    pub fn read(folder: &ModelFolder, objects: &BTreeSet<u32>) -> Self {
        objects.iter().map(|id| (*id, folder.read(*id))).collect()
    }

    /// Returns whether the model of an object was asked for, whatever came of it.
    #[must_use]
    pub fn knows(&self, obj_id: u32) -> bool {
        self.by_id.contains_key(&obj_id)
            || self.missing.contains(&obj_id)
            || self.broken.contains_key(&obj_id)
    }
}

impl FromIterator<(u32, Result<Option<Model>, IoError>)> for Models {
    fn from_iter<T: IntoIterator<Item = (u32, Result<Option<Model>, IoError>)>>(read: T) -> Self {
        let mut models = Self::default();
        for (id, model) in read {
            match model {
                Ok(Some(model)) => models.by_id.extend([(id, model)]),
                Ok(None) => models.missing.extend([id]),
                Err(error) => models.broken.extend([(id, chain(&error))]),
            }
        }
        models
    }
}

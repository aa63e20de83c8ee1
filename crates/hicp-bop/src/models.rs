//! The models of a dataset's objects.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use hicp_io::bop::{Dataset, ModelInfo};
use hicp_io::{IoError, LengthUnit, ReadLimits, is_absent};
use hybrid_icp::core::{Model, ModelConfig};

use crate::fault::chain;

/// A folder of models, with the diameters and symmetries of its `models_info.json`.
#[derive(Clone, Debug)]
pub struct ModelFolder {
    dir: PathBuf,
    infos: BTreeMap<u32, ModelInfo>,
    limits: ReadLimits,
}

impl ModelFolder {
    /// Opens a folder and reads its `models_info.json` if there is one.
    ///
    /// # Errors
    ///
    /// As for [`ReadLimits::read_models_info`].
    pub fn open(dir: impl AsRef<Path>) -> Result<Self, IoError> {
        Self::open_within(ReadLimits::DEFAULT, dir)
    }

    /// Opens a folder as [`ModelFolder::open`] does, within `limits`.
    ///
    /// # Errors
    ///
    /// As for [`ReadLimits::read_models_info`].
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

    /// Reads the model of an object in meters, or returns `None` if its file does not exist.
    ///
    /// # Errors
    ///
    /// As for [`ReadLimits::read_mesh`].
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

/// Models by object id, and the objects whose model is missing or cannot be used.
///
/// It can be collected from the results of [`ModelFolder::read`], so a program can read models in
/// several threads.
#[derive(Debug, Default)]
pub struct Models {
    /// The models that can be used.
    pub by_id: BTreeMap<u32, Model>,
    /// Objects without a model in the dataset, ascending.
    pub missing: BTreeSet<u32>,
    /// Error messages of the models that cannot be used.
    pub broken: BTreeMap<u32, String>,
}

impl Models {
    /// Reads the models of `objects`, one after the other.
    #[must_use]
    pub fn read(folder: &ModelFolder, objects: &BTreeSet<u32>) -> Self {
        objects.iter().map(|id| (*id, folder.read(*id))).collect()
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

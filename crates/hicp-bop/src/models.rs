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
    info_path: PathBuf,
    infos: BTreeMap<u32, ModelInfo>,
    limits: ReadLimits,
    with_color: bool,
}

impl ModelFolder {
    /// Opens a folder and reads its `models_info.json` if there is one.
    ///
    /// # Errors
    ///
    /// As for [`ReadLimits::read_models_info`].
    pub fn open(dir: impl AsRef<Path>) -> Result<Self, IoError> {
        let dir = dir.as_ref();
        Self::with_info(ReadLimits::DEFAULT, dir, dir.join("models_info.json"))
    }

    /// Opens a folder as [`ModelFolder::open`] does, within `limits`, with the diameters and
    /// symmetries of another file, if it exists ([`Dataset::models_info_path`]).
    ///
    /// # Errors
    ///
    /// As for [`ReadLimits::read_models_info`].
    pub fn with_info(
        limits: ReadLimits,
        dir: impl AsRef<Path>,
        info: impl AsRef<Path>,
    ) -> Result<Self, IoError> {
        let info_path = info.as_ref().to_owned();
        let infos = if is_absent(&info_path) {
            BTreeMap::new()
        } else {
            limits.read_models_info(&info_path)?
        };
        Ok(Self {
            dir: dir.as_ref().to_owned(),
            info_path,
            infos,
            limits,
            with_color: true,
        })
    }

    /// Reads the models without their colors. Color images are then not read either.
    #[must_use]
    pub fn without_color(mut self) -> Self {
        self.with_color = false;
        self
    }

    /// Returns the folder.
    #[must_use]
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Returns the path of the file of diameters and symmetries. The file may not exist.
    #[must_use]
    pub fn info_path(&self) -> &Path {
        &self.info_path
    }

    /// Reads the model of an object in meters, or returns `None` if its file does not exist.
    ///
    /// Colors that cannot be used are left out.
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
        let mesh = match self.with_color {
            true => self.limits.read_mesh(path, LengthUnit::Millimeters)?,
            false => self
                .limits
                .read_mesh_geometry(path, LengthUnit::Millimeters)?,
        };
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

//! A dataset folder in the layout of BOP.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use hicp_core::TriMesh;

use super::models_info::ModelInfo;
use super::scene::Scene;
use super::targets::Target;
use crate::error::IoError;
use crate::limits::ReadLimits;
use crate::source::is_absent;
use crate::unit::LengthUnit;

/// A dataset in BOP's layout: a folder of models, and scenes in folders such as `test` or
/// `test_primesense`.
///
/// Opening a dataset only checks that the folder exists. Each method reports the files that are
/// missing.
///
/// ```no_run
/// # fn main() -> Result<(), hicp_io::IoError> {
/// let dataset = hicp_io::bop::Dataset::open("bop/ycbv")?;
/// let scene = dataset.scene("test", 50)?;
/// for image in scene.image_ids() {
///     let depth = scene.read_depth(image)?;
///     let camera = scene.camera(image)?.pinhole(depth.width(), depth.height());
/// }
/// # Ok(()) }
/// ```
#[derive(Clone, Debug)]
pub struct Dataset {
    root: PathBuf,
    limits: ReadLimits,
    models: Option<PathBuf>,
    sensor: Option<String>,
}

impl Dataset {
    /// Opens the dataset in a folder.
    ///
    /// # Errors
    ///
    /// [`IoErrorKind::Missing`](crate::IoErrorKind::Missing) if the folder does not exist.
    pub fn open(root: impl AsRef<Path>) -> Result<Self, IoError> {
        let root = root.as_ref().to_owned();
        if root.is_dir() {
            let limits = ReadLimits::DEFAULT;
            Ok(Self {
                root,
                limits,
                models: None,
                sensor: None,
            })
        } else {
            Err(IoError::missing(root, "dataset folder"))
        }
    }

    /// Sets the limits for reading models, images and annotations, instead of
    /// [`ReadLimits::DEFAULT`].
    #[must_use]
    pub fn with_limits(mut self, limits: ReadLimits) -> Self {
        self.limits = limits;
        self
    }

    /// Reads the meshes from another folder: one of the dataset, such as `models_color`, or a path.
    ///
    /// Diameters and symmetries still come from [`Dataset::models_info_path`].
    ///
    /// # Errors
    ///
    /// [`IoErrorKind::Missing`](crate::IoErrorKind::Missing) if there is no such folder.
    pub fn with_models(mut self, folder: impl AsRef<Path>) -> Result<Self, IoError> {
        let folder = folder.as_ref();
        let places = [self.root.join(folder), folder.to_owned()];
        let found = places.into_iter().find(|dir| dir.is_dir());
        let missing = || IoError::missing(self.root.join(folder), "folder of models");
        self.models = Some(found.ok_or_else(missing)?);
        Ok(self)
    }

    /// Selects the sensor of scenes with several, such as `cam1` ([`Scene::open_within`]).
    #[must_use]
    pub fn with_sensor(mut self, sensor: Option<&str>) -> Self {
        self.sensor = sensor.map(str::to_owned);
        self
    }

    /// Returns the folder.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Returns the folder of the models: that of [`Dataset::with_models`], or `models`, or
    /// `models_eval` if it is the only one.
    ///
    /// # Errors
    ///
    /// [`IoErrorKind::Missing`](crate::IoErrorKind::Missing) if neither exists.
    pub fn models_dir(&self) -> Result<PathBuf, IoError> {
        let other = self.models.clone().map(Ok);
        other.unwrap_or_else(|| self.first_dir(["models", "models_eval"]))
    }

    /// Returns the path of the file of diameters and symmetries. The file may not exist.
    ///
    /// It is `models_info.json` in `models`, or in `models_eval` if it is the only folder. If the
    /// dataset has neither, it is in the folder of [`Dataset::with_models`].
    ///
    /// # Errors
    ///
    /// As for [`Dataset::models_dir`].
    pub fn models_info_path(&self) -> Result<PathBuf, IoError> {
        let dir = self.first_dir(["models", "models_eval"]);
        Ok(dir.or_else(|_| self.models_dir())?.join("models_info.json"))
    }

    /// Returns the folder of the models over which BOP's errors are defined.
    ///
    /// It is `models_eval`, or `models` if it is the only one.
    ///
    /// # Errors
    ///
    /// [`IoErrorKind::Missing`](crate::IoErrorKind::Missing) if neither exists.
    pub fn eval_models_dir(&self) -> Result<PathBuf, IoError> {
        self.first_dir(["models_eval", "models"])
    }

    fn first_dir(&self, names: [&str; 2]) -> Result<PathBuf, IoError> {
        names
            .map(|name| self.root.join(name))
            .into_iter()
            .find(|dir| !is_absent(dir))
            .ok_or_else(|| IoError::missing(self.root.join("models"), "folder of models"))
    }

    /// Returns the path of an object's mesh: `models/obj_000001.ply` for object 1. The file may not
    /// exist.
    ///
    /// # Errors
    ///
    /// As for [`Dataset::models_dir`].
    pub fn model_path(&self, obj_id: u32) -> Result<PathBuf, IoError> {
        Ok(Self::model_path_in(&self.models_dir()?, obj_id))
    }

    /// Returns the path of an object's mesh in a folder of models.
    ///
    /// For object 1, it is `obj_000001.ply`, or else `obj_000001.obj`, or one of them in the folder
    /// `obj_000001`. If none of these files exists, returns the first path.
    #[must_use]
    pub fn model_path_in(models: &Path, obj_id: u32) -> PathBuf {
        let name = format!("obj_{obj_id:06}");
        let path = |stem: &Path, extension: &str| stem.with_extension(extension);
        let (stem, inner) = (models.join(&name), models.join(&name).join(&name));
        let first = path(&stem, "ply");
        let others = [path(&stem, "obj"), path(&inner, "ply"), path(&inner, "obj")];
        let found = others.into_iter().find(|other| !is_absent(other));
        found.filter(|_| is_absent(&first)).unwrap_or(first)
    }

    /// Reads the mesh of an object, in meters.
    ///
    /// # Errors
    ///
    /// As for [`Dataset::models_dir`] and [`read_mesh`](crate::read_mesh).
    pub fn read_model(&self, obj_id: u32) -> Result<TriMesh, IoError> {
        let path = self.model_path(obj_id)?;
        self.limits.read_mesh(path, LengthUnit::Millimeters)
    }

    /// Reads the diameters and symmetries of all objects, by object id.
    ///
    /// # Errors
    ///
    /// As for [`Dataset::models_dir`] and [`read_models_info`](super::read_models_info).
    pub fn read_models_info(&self) -> Result<BTreeMap<u32, ModelInfo>, IoError> {
        self.limits.read_models_info(self.models_info_path()?)
    }

    /// Reads the targets of the benchmark from the dataset's `test_targets_bop19.json`.
    ///
    /// # Errors
    ///
    /// As for [`read_targets`](super::read_targets).
    pub fn read_targets(&self) -> Result<Vec<Target>, IoError> {
        self.limits
            .read_targets(self.root.join("test_targets_bop19.json"))
    }

    /// Returns the ids of the scenes of a split, ascending.
    ///
    /// A split is named by its folder, such as `test`.
    ///
    /// # Errors
    ///
    /// [`IoErrorKind::Missing`](crate::IoErrorKind::Missing) if the split does not exist,
    /// [`IoErrorKind::Read`](crate::IoErrorKind::Read) if its folder cannot be listed.
    pub fn scene_ids(&self, split: &str) -> Result<Vec<u32>, IoError> {
        let dir = self.split_dir(split)?;
        let entries = std::fs::read_dir(&dir).map_err(|e| IoError::read(&dir, e))?;
        let mut ids = Vec::new();
        for entry in entries {
            let entry = entry.map_err(|e| IoError::read(&dir, e))?;
            let name = entry.file_name();
            if let Some(id) = name.to_str().and_then(|name| name.parse().ok())
                && entry.path().is_dir()
            {
                ids.push(id);
            }
        }
        ids.sort_unstable();
        Ok(ids)
    }

    /// Opens a scene of a split: its cameras and its ground truth, if any.
    ///
    /// # Errors
    ///
    /// [`IoErrorKind::Missing`](crate::IoErrorKind::Missing) if the split or the scene does not
    /// exist, otherwise as for [`Scene::open`].
    pub fn scene(&self, split: &str, scene_id: u32) -> Result<Scene, IoError> {
        let folder = self.split_dir(split)?.join(format!("{scene_id:06}"));
        Scene::open_within(self.limits, folder, self.sensor.as_deref())
    }

    fn split_dir(&self, split: &str) -> Result<PathBuf, IoError> {
        let dir = self.root.join(split);
        if is_absent(&dir) {
            return Err(IoError::missing(dir, "split"));
        }
        Ok(dir)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::IoErrorKind;
    use std::fs;

    #[test]
    fn errors_name_the_missing_part() {
        let dir = tempfile::tempdir().unwrap();
        assert!(matches!(
            Dataset::open(dir.path().join("no")),
            Err(IoError { kind: IoErrorKind::Missing, expected, .. }) if expected == "dataset folder"
        ));
        let dataset = Dataset::open(dir.path()).unwrap();
        assert!(matches!(
            dataset.models_dir(),
            Err(IoError {
                kind: IoErrorKind::Missing,
                ..
            })
        ));
        assert!(matches!(
            dataset.scene_ids("test"),
            Err(IoError {
                kind: IoErrorKind::Missing,
                ..
            })
        ));
        assert!(matches!(
            dataset.read_targets(),
            Err(IoError {
                kind: IoErrorKind::Read,
                ..
            })
        ));
        fs::create_dir(dir.path().join("test")).unwrap();
        assert!(dataset.scene_ids("test").unwrap().is_empty());
        assert!(matches!(
            dataset.scene("test", 3),
            Err(IoError { kind: IoErrorKind::Missing, expected, .. }) if expected == "scene"
        ));
    }

    #[test]
    fn models_fall_back_to_the_evaluation_models() {
        let dir = tempfile::tempdir().unwrap();
        let dataset = Dataset::open(dir.path()).unwrap();
        fs::create_dir(dir.path().join("models_eval")).unwrap();
        assert!(
            dataset
                .model_path(12)
                .unwrap()
                .ends_with("models_eval/obj_000012.ply")
        );
        assert_eq!(
            dataset.eval_models_dir().unwrap(),
            dataset.models_dir().unwrap()
        );
        fs::create_dir(dir.path().join("models")).unwrap();
        assert!(
            dataset
                .model_path(12)
                .unwrap()
                .ends_with("models/obj_000012.ply")
        );
        let for_evaluation = dataset.eval_models_dir().unwrap();
        assert!(for_evaluation.ends_with("models_eval"));
    }

    #[test]
    fn scenes_are_listed_in_order() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["000010", "000002", "notes"] {
            fs::create_dir_all(dir.path().join("val").join(name)).unwrap();
        }
        fs::write(dir.path().join("val/000003"), "a file").unwrap();
        let dataset = Dataset::open(dir.path()).unwrap();
        assert_eq!(dataset.scene_ids("val").unwrap(), [2, 10]);
    }
}

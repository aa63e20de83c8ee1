//! Options that the commands over datasets share.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use clap::Args;
use hicp_io::IoErrorKind;
use hicp_io::bop::Dataset;

use crate::limits::limits;
use crate::options::file_name;
use crate::outputs;

/// The options that choose images of a dataset.
#[derive(Clone, Debug, Args)]
pub(crate) struct DatasetOptions {
    /// The dataset's folder, with models/ and the split's folder.
    #[arg(long = "dataset", id = "dataset", value_name = "DIR")]
    pub(crate) root: PathBuf,
    /// The split's folder: test, test_primesense, train_pbr, …
    #[arg(long, value_name = "NAME", default_value = "test")]
    pub(crate) split: String,
    /// The sensor, if scenes have several: cam1 for scene_camera_cam1.json and depth_cam1/.
    #[arg(long, value_name = "NAME")]
    pub(crate) sensor: Option<String>,
}

impl DatasetOptions {
    /// Opens the dataset with the limits of this run, and checks that it has the split.
    pub(crate) fn open(&self) -> anyhow::Result<Dataset> {
        let dataset = Dataset::open(&self.root)?.with_limits(limits());
        let dataset = dataset.with_sensor(self.sensor.as_deref());
        match dataset.scene_ids(&self.split) {
            Ok(_) => Ok(dataset),
            Err(error) if error.kind == IoErrorKind::Missing => match &self.splits()[..] {
                [] => bail!(
                    "{error}, expected --dataset to name the folder with models/ and {}/",
                    self.split
                ),
                splits => bail!(
                    "{error}, expected --split to name one of: {}",
                    splits.join(", ")
                ),
            },
            Err(error) => Err(error.into()),
        }
    }

    /// Returns the names of the folders that contain scenes.
    fn splits(&self) -> Vec<String> {
        let names = |folder: &Path| {
            let folders = outputs::entries(folder)
                .into_iter()
                .filter(|path| path.is_dir());
            folders.map(|path| file_name(&path))
        };
        let is_scene = |name: String| name.parse::<u32>().is_ok();
        let has_scenes = |name: &String| names(&self.root.join(name)).any(is_scene);
        let mut splits: Vec<String> = names(&self.root).filter(has_scenes).collect();
        splits.sort();
        splits
    }

    /// Returns whether a scene of the split has a folder of color images.
    pub(crate) fn has_color(&self) -> bool {
        let scenes = std::fs::read_dir(self.root.join(&self.split));
        let mut scenes = scenes.into_iter().flatten().flatten();
        scenes.any(|scene| scene.path().join(self.of_sensor("rgb")).is_dir())
    }

    /// Returns the name of a file or folder of the scenes, without its extension.
    pub(crate) fn of_sensor(&self, name: &str) -> String {
        let suffix = self.sensor.iter().map(|sensor| format!("_{sensor}"));
        suffix.fold(name.to_owned(), |name, suffix| name + &suffix)
    }

    /// Returns the name of the dataset's folder.
    pub(crate) fn name(&self) -> String {
        let root = self.root.canonicalize();
        file_name(root.as_deref().unwrap_or(&self.root))
    }
}

/// The option for the number of threads.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct ThreadOptions {
    /// Number of threads; the number of cores if not given. Only times depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..), allow_negative_numbers = true)]
    threads: Option<u16>,
}

impl ThreadOptions {
    /// Starts the threads, at most one per image.
    pub(crate) fn pool(self, images: usize) -> anyhow::Result<rayon::ThreadPool> {
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        let threads = self.threads.map_or_else(cores, usize::from);
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads.min(images.max(1)))
            .build()
            .context("cannot start the threads")
    }
}
